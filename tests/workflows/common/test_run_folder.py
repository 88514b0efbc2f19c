"""The folder of a run: refused, made, or cleared of what former runs left, and of nothing else."""

import os
import re
from pathlib import Path

import pytest

import taichi_lsm
import workflows
from taichi_lsm.core.errors import InputError
from taichi_lsm.io import checkpoints
from workflows.common.run_folder import CHECKPOINTS, WRITTEN, check_folder, is_complete, is_done, run_folder

OTHERS = ("notes.txt", "friction.xlsx", "run.nc.bak", "figures/run.png", "runs/mine/data.csv", "runs/note.md")
LEFT = ("run.nc", "stopped.nc", "checkpoint.nc", "run.pdf", "summary.json", ".grains.nc.part")
NAMED = re.compile(r'/ f?"([\w.{}]+)"')  # out / "run.nc", out / f"run.{kind}"
TABLE = re.compile(r'"(\w+\.nc)"')


@pytest.fixture
def used(tmp_path, toy):
    """A folder that two runs and a user have written to."""
    for place in ("", "runs/round-1", "runs/round-2", "runs/mine"):
        (tmp_path / "used" / place).mkdir(parents=True, exist_ok=True)
        for name in ("config.toml", *LEFT):
            (tmp_path / "used" / place / name).write_text("old")
    for name in OTHERS:
        (tmp_path / "used" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "used" / name).write_text("mine")
    return tmp_path / "used"


def files_in(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir()}


def begin_run(params, out, existing="refuse", **options):
    with run_folder(params, "toy-run", out, existing, **options) as folder:
        return folder


def test_what_former_runs_left_is_removed_and_nothing_else(used, toy):
    assert begin_run(toy.Params(seed=3), used, existing="overwrite") == used
    assert files_in(used) == {"config.toml", *OTHERS}
    assert not (used / "runs/round-1").exists() and "seed = 3" in (used / "config.toml").read_text()


def test_complete_runs_with_which_an_experiment_goes_on_stay(used, toy):
    (used / "runs/mine/summary.json").unlink()
    for run in ("round-1", "round-2"):
        (used / "runs" / run / "summary.json").write_text('{"metrics": {}}')
    begin_run(toy.Params(), used, "overwrite", keep_runs=True)
    assert {"runs/round-1/run.nc", "runs/round-2/config.toml"} <= files_in(used)
    assert not files_in(used) & set(LEFT) and "runs/mine/run.nc" not in files_in(used)


def test_a_folder_that_no_run_has_begun_keeps_all_it_holds(used, toy):
    for place in (".", "runs/round-1"):
        (used / place / "config.toml").unlink()
    begin_run(toy.Params(), used, existing="overwrite")
    kept = {*LEFT, "runs/round-1/run.nc"} - {"checkpoint.nc"}  # from which a later run must not go on
    assert kept <= files_in(used) and "runs/round-2/run.nc" not in files_in(used)
    assert not list(used.rglob("checkpoint.nc"))


def test_a_folder_that_is_not_empty_is_refused_as_it_is(used, toy):
    before = files_in(used)
    with pytest.raises(InputError, match=rf"^out {used}: is not empty, must be .* unless existing='overwrite'"):
        begin_run(toy.Params(), used)
    assert files_in(used) == before and (used / "config.toml").read_text() == "old"


def test_folders_that_cannot_be_written_are_refused(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    for path, words in (("file", "is a file"), ("file/below", "file is a file"), ("x" * 300, "cannot be used: .*long")):
        with pytest.raises(InputError, match=words):
            check_folder(tmp_path / path, existing="overwrite")
    monkeypatch.setattr(os, "access", lambda *given: False)
    with pytest.raises(InputError, match=r"^--out .*: may not be written to\.$"):
        check_folder(tmp_path, "overwrite", "--out")


def test_every_file_that_the_code_names_is_known():
    """A new kind of file would be left behind by --overwrite."""
    named = set()
    for package in (workflows, taichi_lsm):
        for path in Path(package.__file__).parent.rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            found = [name for name in NAMED.findall(text) if "." in name] + TABLE.findall(text)
            named |= {re.sub(r"\{[\w.]*(kind|format)\}", "svg", name) for name in found}
    assert {"run.nc", "compare.nc", "friction.svg", "stopped.svg", "hard_cases.md", "checkpoint.nc"} <= named
    named -= {"scene.py", "settled.nc"}  # the folder of the package; within one hard case, in a folder of its own
    assert {f"{name}.nc" for name in CHECKPOINTS} == {checkpoints.LAST, checkpoints.PREVIOUS, checkpoints.NEW}
    named -= {"composed.nc", "fresh.nc", "{name}.json"}  # in memory; in the folder of parts
    named -= {"{i}.toml"}  # in a temporary folder
    named -= {"{name}.toml", ".cache"}  # of a sweep or a calibration; that of kernels
    named -= {".{CONFIG}.part", "{name}.nc", "{name}.svg"}  # .config.toml.part; checkpoints, pictures
    named -= {"{stem}.nc", "sweep.toml"}  # which are read
    named -= {"sweep.nc", "{run.label}.toml"}  # of a sweep, whose folder nothing overwrites; neither do these
    named -= {"sensitivity.nc", "sensitivity.svg", "posterior.nc", "calibration.svg"}
    named -= {"grains.csv", "contacts.csv", "grains.gsd", "grains.lammpstrj", "grains.xyz", "{name}.pvd"}  # of exports
    assert named <= WRITTEN, named - WRITTEN


def test_a_run_goes_on_with_its_own_parameters_in_a_folder_of_its_own(tmp_path, toy):
    with run_folder(toy.Params(seed=3), "toy-run", tmp_path / "new") as folder:
        assert not is_complete(folder)
        with (
            pytest.raises(InputError, match="is in use by process"),
            run_folder(toy.Params(), "toy-run", folder, "resume"),
        ):
            pytest.fail("two runs in one folder")
    (folder / "summary.json").write_text('{"metrics": {}}')
    assert is_complete(folder) and is_done(folder, toy.Params(seed=3, threads=4)) and not is_done(folder, toy.Params())
    with pytest.raises(InputError, match="--seed 1: is 3 in the run in"):
        begin_run(toy.Params(), folder, "resume")
    assert is_complete(folder)
    begin_run(toy.Params(seed=3), folder, "resume")
    assert not is_complete(folder)  # it goes on
    (folder / "summary.json").write_text('{"run_status": "interrupted", "metrics": {}}')
    assert not is_complete(folder)
    with pytest.raises(InputError, match=r"holds no config\.toml"):
        begin_run(toy.Params(), tmp_path / "none", "resume")


@pytest.mark.parametrize("name", [".run.nc.part", "config.toml", "runs/a/run.nc", "parts", "runs"])
@pytest.mark.parametrize("existing", ["refuse", "overwrite", "resume"])
def test_nothing_is_written_through_a_link(tmp_path, toy, name, existing):
    """The folder of a run may come from someone else."""
    (tmp_path / "mine").write_text("mine")
    link = tmp_path / "run" / name
    link.parent.mkdir(parents=True)
    link.symlink_to(tmp_path / "mine")
    with pytest.raises(InputError, match=rf"holds the link {name}, over which"):
        begin_run(toy.Params(), tmp_path / "run", existing)
    assert (tmp_path / "mine").read_text() == "mine"
