"""A complete run that has kept its checkpoint goes on through more repetitions, more stages and a longer last one."""

import shutil

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from tests.crash.random_kills import contents
from workflows import shear_gouge
from workflows.cli import resume
from workflows.cli.main import main
from workflows.common.parameters import merge, to_toml

RUN_IN = {"name": "run-in", "velocity": 1.0, "until": {"strain": 0.1}}
UP = {"name": "up", "velocity": 3.0, "until": {"slip": 0.2}, "sample": {"time": 0.5}}
DOWN = {"name": "down", "velocity": 1.0, "until": {"slip": 0.2}, "repeat": 2, "repeat_from": "up"}
HOLD = {"name": "hold", "velocity": 0.0, "until": {"time": 10.0}, "sample": {"time": 1.0}}
CREEP = {"name": "creep", "shear_stress": 0.1, "until": {"time": 10.0}, "sample": {"time": 1.0}}
FIRST = [RUN_IN, UP, DOWN]
MORE = [RUN_IN, UP, DOWN | {"repeat": 3}, HOLD]
LONGER = [*MORE[:-1], HOLD | {"until": {"time": 20.0}}]


def params(stages, **others):
    return shear_gouge.Params(layer_thickness=8, length=8, inertial_number=0.02, stages=stages, **others)


@pytest.fixture(scope="module")
def first(tmp_path_factory, runtime):
    """Folder of a complete run through the first stages."""
    folder = tmp_path_factory.mktemp("longer") / "run"
    shear_gouge.run(params(FIRST, keep_checkpoint=True), folder)
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory, runtime):
    """Folder of a run through all stages that was not interrupted."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    shear_gouge.run(params(LONGER), folder)
    return folder


def different(folder, reference):
    """Variables of run.nc that are not equal."""
    mine, theirs = contents(folder / "run.nc"), contents(reference / "run.nc")
    return [name for name in sorted(mine.keys() | theirs.keys()) if mine.get(name) != theirs.get(name)]


def stages_text(stages):
    """The stages alone, as a file has them."""
    text = to_toml(params(stages))
    return text[text.index("\n[[stages]]") :]


def test_the_stages_of_a_file_are_those_of_the_run_that_goes_on(first, tmp_path, monkeypatch):
    """And options win over what else the file has."""
    taken = []

    def execute(name, module, options, config, **others):
        taken.append(merge(module.Params, None, config, options, name))
        return 0

    monkeypatch.setattr(resume, "execute", execute)
    (tmp_path / "more.toml").write_text("threads = 2\nkeep_checkpoint = false\n" + stages_text(MORE))
    assert main(["resume", str(first), "--config", str(tmp_path / "more.toml"), "--threads", "3"]) == 0
    assert taken == [params(MORE, threads=3)]


@pytest.mark.validate
def test_more_repetitions_then_more_stages_and_a_longer_last_one_give_the_bits_of_one_run(first, whole, tmp_path):
    """By the command line, which takes the stages of a file, and then a file with all parameters."""
    out = shutil.copytree(first, tmp_path / "run")
    more, longer = tmp_path / "more.toml", tmp_path / "longer.toml"
    more.write_text(stages_text(MORE))
    assert main(["resume", str(out), "--config", str(more), "--quiet"]) == 0
    assert (out / "checkpoint.nc").exists()
    longer.write_text(to_toml(params(LONGER, keep_checkpoint=True), "shear-gouge"))
    assert main(["resume", str(out), "--config", str(longer), "--keep-checkpoint", "--quiet"]) == 0
    assert different(out, whole) == []
    assert np.count_nonzero(np.diff(shear_gouge.lsm.open_run(out).run.stage_index)) == 9


@pytest.mark.parametrize(
    ("stages", "words"),
    [
        (FIRST[:1], "stages: must begin with those of the run in"),
        ([RUN_IN, UP, DOWN | {"repeat": 1, "repeat_from": None}], "stages: must begin with those of the run in"),
        ([RUN_IN | {"velocity": 2.0}, UP, DOWN, HOLD], "stages: must begin with those of the run in"),
        ([*FIRST, CREEP], "stages: shear_stress cannot come into the run in"),
    ],
)
def test_other_stages_and_fewer_are_refused(first, stages, words):
    before = {path: path.stat().st_mtime_ns for path in first.iterdir() if path.name != ".lock"}
    with pytest.raises(InputError, match=words):
        shear_gouge.check_resume(params(stages, keep_checkpoint=True), first)
    assert not shear_gouge.can_go_on(params(stages, keep_checkpoint=True), first)
    assert {path: path.stat().st_mtime_ns for path in first.iterdir() if path.name != ".lock"} == before


def test_a_run_without_its_checkpoint_cannot_be_made_longer(first, tmp_path):
    out = shutil.copytree(first, tmp_path / "run")
    assert shear_gouge.can_go_on(params(MORE), out)
    for path in out.glob("checkpoint*"):
        path.unlink()
    with pytest.raises(InputError, match=r"is complete and has kept no checkpoint .*--keep-checkpoint"):
        shear_gouge.check_resume(params(MORE), out)
    shear_gouge.check_resume(params(FIRST), out)


def test_a_file_that_does_not_suit_the_run_is_refused(first, tmp_path, capsys):
    path = tmp_path / "other.toml"
    for text, words in (
        ('experiment = "hard-cases"\nkinds = ["steps"]\n', "gives nothing to shear-gouge, of which the run is"),
        ("friction = 0.6\n", "--friction 0.6: is 0.5 in the run in"),
        ('preset = "demo"\n', "preset demo"),
        ("strain = \n", "other.toml: is not valid TOML"),
    ):
        path.write_text(text)
        assert main(["resume", str(first), "--config", str(path)]) == 2
        assert words in capsys.readouterr().err
