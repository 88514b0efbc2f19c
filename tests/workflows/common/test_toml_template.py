"""`lsm init`: a file with all parameters, which is taken as it stands."""

import re
import tomllib

import pytest

from workflows.cli.init import init_command
from workflows.cli.main import main
from workflows.common.discovery import find_workflows
from workflows.common.parameter_types import kind
from workflows.common.parameters import merge
from workflows.common.refusals import check_idle
from workflows.common.toml_template import template

WORKFLOWS = find_workflows()
LINE = re.compile(r"^(# )?(\w+) = (.*?)(?:  # (?:no effect|stands for) .*)?$")


def printed(capsys, name, preset="standard"):
    assert init_command(find_workflows())(name, preset=preset) == 0
    out, err = capsys.readouterr()
    assert not err
    return out


@pytest.fixture(params=sorted(WORKFLOWS))
def name(request):
    return request.param


def test_the_file_gives_the_values_of_the_preset(tmp_path, name):
    path, params_class = tmp_path / "a.toml", WORKFLOWS[name].Params
    for preset in ("smoke", "demo", "standard", "reference"):
        wanted = merge(params_class, preset)
        path.write_text(template(wanted, name))
        read = merge(params_class, None, path, experiment=name)
        assert read == wanted and read.preset_name == preset and not read.notes
        check_idle(read)  # what is given has an effect


def test_every_parameter_stands_in_it_once_and_can_be_given(name):
    """Lines that are comments, too, name a parameter and a value of it."""
    params = merge(WORKFLOWS[name].Params)
    fields, text = type(params).model_fields, template(params, name)
    active = tomllib.loads(text)
    single = [match for line in text.splitlines() if (match := LINE.match(line)) and match[2] in fields]
    tables = re.findall(r"^(?:# )?\[\[(\w+)\]\]$", text, re.MULTILINE)
    assert sorted([*(match[2] for match in single), *tables]) == sorted(fields)
    assert set(tables) == {key for key, field in fields.items() if kind(field.annotation) == "toml"}
    for match in single:
        value, wanted = tomllib.loads(f"{match[2]} = {match[3]}")[match[2]], getattr(params, match[2])
        assert (match[1] is None) == (match[2] in active)
        assert value == ("none" if wanted is None else wanted), match[0]


def test_the_command_of_the_experiment_takes_it(tmp_path, capsys, monkeypatch):
    taken, experiment = [], "stick-slip"

    def run(params, out, progress, existing):
        taken.append(params)

    monkeypatch.setattr(WORKFLOWS[experiment], "run", run)
    path = tmp_path / "a.toml"
    assert main(["init", experiment]) == 0
    path.write_text(capsys.readouterr().out)
    assert main([experiment, "--config", str(path), "--out", str(tmp_path / "out"), "--quiet", "--yes"]) == 0
    assert taken == [merge(WORKFLOWS[experiment].Params)] and not capsys.readouterr().err


def test_units_bounds_and_defaults_are_told(plugins, capsys):
    text = printed(capsys, "toy-run", "smoke")
    head, *entries = text.rstrip().split("\n\n")
    told = "# normal stress on the layer [Pa]\n# a number, greater than 0; default 1000000.0\nnormal_stress = 1000.0"
    assert told in entries and "preset smoke" in head
    assert "# effects\n# [[effects]]\n# keys: name, stiffness" in entries
    assert "# space dimensions\n# an integer, from 2 to 3; default 2\ndim = 2" in entries
    assert "# Of this experiment ---" in text
    assert '# one of f64, f32; default "f64"' in text


def test_none_says_what_it_stands_for_and_idle_why(capsys):
    text = printed(capsys, "shear-gouge")
    assert '\n# layer_thickness = "none"  # stands for 24\n' in text
    assert "\n# corner_radius = 0.05  # no effect with --shape round\n" in text


@pytest.mark.parametrize(
    ("name", "preset", "said", "nearest"),
    [
        ("stickslip", "smoke", "stickslip: unknown experiment, must be one of accuracy-cost, ", "stick-slip"),
        ("shear-gouge", "smok", "--preset smok: unknown preset", "smoke"),
    ],
)
def test_what_is_unknown_prints_nothing_on_the_output(capsys, name, preset, said, nearest):
    assert init_command(WORKFLOWS)(name, preset=preset) == 2
    out, err = capsys.readouterr()
    assert not out and said in err and err.endswith(f"Did you mean {nearest}?\n")
