"""What runs a file asks for; mistakes are named, and runs that are refused are in the plan with the reason."""

import pytest

from taichi_lsm import data_path
from taichi_lsm.core.errors import InputError
from workflows.cli.main import main
from workflows.common import parameter_files
from workflows.common.discovery import find_workflows
from workflows.common.parameters import merge
from workflows.common.toml_reader import read_toml
from workflows.sweep.plan import plan_of

FOUND = find_workflows()
SHIPPED = [p for p in sorted(data_path("effect_costs.json").parent.glob("*.toml")) if "experiment" in read_toml(p)]
FILE = """
experiment = "shear-gouge"
preset = "smoke"
strain = 1.6

[sweep]
replicas = 2
grid.shape = ["round", "angular"]
grid.corner_radius = [0.05, 0.1]
"""


@pytest.fixture
def planned(tmp_path):
    """planned(text): the plan of a file."""

    def plan(text):
        path = tmp_path / "sweep.toml"
        path.write_text(text)
        return plan_of(path, FOUND)

    return plan


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_the_files_that_pages_name_are_understood(path):
    table = read_toml(path)
    if "sweep" in table:
        assert all(run.refusal == "" for run in plan_of(path, FOUND).runs)
    else:
        merge(FOUND[table["experiment"]].Params, None, path, experiment=table["experiment"])


def test_every_point_has_its_parameters_and_every_replica_its_seed(planned):
    plan = planned(FILE)
    assert plan.experiment == "shear-gouge" and plan.varied == ("shape", "corner_radius", "seed")
    assert [(factor.dim, len(factor.points)) for factor in plan.factors] == [(name, 2) for name in plan.varied]
    assert [run.label for run in plan.runs] == list("12345678")
    assert [run.params.seed for run in plan.runs if run.params] == [1, 2, 1, 2]
    last = plan.runs[-1]
    assert last.point == {"shape": "angular", "corner_radius": 0.1, "seed": 2}
    assert last.params.corner_radius == 0.1 and last.params.strain == 1.6 and last.params.preset_name == "smoke"


def test_runs_that_are_refused_are_told_apart(planned):
    """Discs have no corner radius."""
    refused = [run for run in planned(FILE).runs if run.params is None]
    assert [run.point["shape"] for run in refused] == ["round"] * 4
    assert all("--corner-radius" in run.refusal and "no effect" in run.refusal for run in refused)


def test_the_file_is_read_once_and_what_differs_by_its_seed_alone_is_checked_once(planned, monkeypatch):
    """Checks may pack grains: a plan of many runs would wait for them."""
    read, checked = [], []
    monkeypatch.setattr(parameter_files, "read_toml", lambda path: read.append(path) or read_toml(path))
    monkeypatch.setattr(FOUND["shear-gouge"], "check", checked.append)
    plan = planned(FILE.replace("replicas = 2", "replicas = 5"))
    assert len(plan.runs) == 20 and len(read) == 1
    assert [(p.shape, p.corner_radius, p.seed) for p in checked] == [
        (shape, radius, 1) for shape in ("round", "angular") for radius in (0.05, 0.1)
    ]


def test_another_seed_of_refused_parameters_may_do(planned, monkeypatch):
    def check(params):
        if params.seed == 1:
            raise InputError(f"--seed {params.seed}: the grains do not fit")

    monkeypatch.setattr(FOUND["shear-gouge"], "check", check)
    assert [run.refusal[:8] for run in planned(FILE).runs] == ["--seed 1", ""] * 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[sweep.grid]\nseed = [1, 2]", r"sweep.toml: experiment is missing, must be one of"),
        ('experiment = "shear-gauge"\n[sweep]', r'experiment = "?shear-gauge"?, must be one of .*shear-gouge\?'),
        ('experiment = "shear-gouge"', r"sweep is missing, must be a table"),
        ('experiment = "shear-gouge"\nsweep = 3', r"sweep is no table"),
        ('experiment = "shear-gouge"\n[sweep.gird]', r"sweep.gird: unknown, .*Did you mean grid"),
        ('experiment = "shear-gouge"\n[sweep]\nreplicas = 0', r"sweep.replicas = 0: must be a whole number from 1 to"),
        (
            'experiment = "shear-gouge"\n[sweep]\nreplicas = 2\ngrid.seed = [1, 2]',
            r"gives the seeds, which vary already",
        ),
        ('experiment = "shear-gouge"\n[sweep.grid]\nfrictoin = [1, 2]', r"frictoin = 1 .*unknown parameter.*friction"),
        ('experiment = "shear-gouge"\n[sweep.grid]\nfriction = [-1, -2]', r"--friction -1: must be"),
        ('experiment = "shear-gouge"\n[sweep.grid]\nfriction = 0.5', r"sweep.toml: sweep.grid.friction = 0.5: must be"),
    ],
)
def test_mistakes_are_named(planned, text, message):
    with pytest.raises(InputError, match=message):
        planned(text)


def test_a_file_that_is_not_there_is_named(tmp_path, capsys):
    (tmp_path / "sweep.toml").write_text("")
    assert main(["sweep", str(tmp_path / "swep.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "there is no such file. Did you mean sweep.toml?" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_file_of_a_sweep_serves_a_single_run_too(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(FILE)
    params = merge(FOUND["shear-gouge"].Params, None, path, None, "shear-gouge", {})
    assert params.strain == 1.6 and any("the table [sweep] was not taken" in note for note in params.notes)
