"""NetCDF files: round trip through plain xarray, survival of kills, refusal of wrong rows, CF compliance."""

import json
import os
import random
import runpy
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from taichi_lsm.core.atomic_netcdf import write_atomically
from taichi_lsm.core.schema import Variable
from taichi_lsm.io.effect_table import effect_parameters, read_effects
from taichi_lsm.io.global_attributes import git_commit
from taichi_lsm.io.grains_file import GrainsWriter, static_rows
from taichi_lsm.io.netcdf_variables import Scalar
from taichi_lsm.io.open_run import open_run, open_runs
from taichi_lsm.io.run_file import write_table
from tests.helpers.output_files import (
    LABELS,
    attributes,
    check_described,
    effects,
    grains,
    grains_writer,
    run_row,
    run_writer,
    table,
    write_every_kind,
)

ROOT = Path(__file__).resolve().parents[2]


def test_run_round_trip(tmp_path):
    writer = run_writer(tmp_path / "run.nc")
    count = 1200  # enough for the compressed layout
    for i in range(count):
        writer.append(run_row(i))
    writer.close("complete")
    with xr.open_dataset(tmp_path / "run.nc") as ds:
        i = np.arange(count)
        assert ds.time.dtype == np.float64 and ds.contact_count.dtype == np.int32
        np.testing.assert_array_equal(ds.time, 0.5 * i)
        np.testing.assert_array_equal(ds.friction, i + 0.25)
        np.testing.assert_array_equal(ds.dissipated_energy, np.stack([i, 2 * i], axis=1))
        np.testing.assert_array_equal(ds.plate_velocity, np.stack([-i, i], axis=1))
        np.testing.assert_array_equal(ds.friction.shear_strain, 0.01 * i)
        assert list(ds.dissipated_energy.effect_name.values) == LABELS["effect"]
        assert "effect_name" not in ds.friction.coords
        assert ds.piece.flag_meanings == "left right" and ds.piece.flag_values.dtype == np.int32
        assert list(ds.friction.stage.values[:2]) == ["settle", "shear"] and "stage" in ds.coords
        assert ds.attrs["run_status"] == "complete" and ds.attrs["config_toml"] == 'title = "Grüße"\n'
        assert (ds.attrs["seed"], ds.attrs["dt"]) == (7, 1e-8)
    assert (tmp_path / "run.nc").stat().st_size < count * 9 * 8 / 2


@pytest.mark.parametrize("dim", [2, 3])
def test_grains_round_trip(tmp_path, dim):
    static, snapshot = grains(dim)
    writer = grains_writer(tmp_path / "grains.nc", static, dim)
    for i in range(3):
        writer.append(0.1 * i, {name: array + i for name, array in snapshot.items()} | {"stage": "settle"})
        with xr.open_dataset(tmp_path / "grains.nc") as ds:
            assert ds.sizes["time"] == i + 1 and ds.attrs["run_status"] == "running"
    writer.close("interrupted")
    with xr.open_dataset(tmp_path / "grains.nc") as ds:
        assert ds.attrs["run_status"] == "interrupted"
        for name, array in static.items():
            np.testing.assert_array_equal(ds[name], array)
        for name, array in snapshot.items():
            np.testing.assert_array_equal(ds[name], np.stack([array, array + 1, array + 2]))
        assert "".join(ds.position.space_name.values) == "xyz"[:dim]
        assert "".join(ds.orientation.quaternion_name.values) == "wxyz"
        assert ds.patch_count.sample_dimension == "patch"
        assert ds.kind.flag_meanings == "mobile glued"
        assert list(ds.position.shear_strain.values) == [0.5, 1.5, 2.5] and list(ds.stage.values) == ["settle"] * 3
        assert ds.position.density == 2500.0


def test_rows_of_the_state_serve_as_they_are(tmp_path):
    """A row without time gets it, and "real" follows the precision of the run."""
    rows = [Variable("force", ("grain", "space"), "real", "N", "force")]
    static, _ = grains(2)
    writer = GrainsWriter(tmp_path / "g.nc", static, static_rows(2), rows, attributes(), precision="f32")
    writer.append(0.0, {"force": np.full((5, 2), 0.1)})
    with xr.open_dataset(tmp_path / "g.nc") as ds:
        assert ds.force.dims == ("time", "grain", "space") and ds.force.dtype == np.float32
        assert ds.mass.dtype == np.float64


def test_table_round_trip(tmp_path):
    table(tmp_path / "compare.nc")
    with xr.open_dataset(tmp_path / "compare.nc") as ds:
        assert ds.friction_mean.coords["shape"].values.tolist() == ["sphere", "angular"]
        assert ds.friction_mean.coords["seed"].values.tolist() == [1, 2]
        assert set(ds.coords) == {"seed", "shape"} and set(ds.data_vars) == {"friction_mean", "status"}
        assert ds.friction_mean.values.tolist() == [0.3, 0.45] and ds.status.values.tolist() == ["a", "b"]


def test_rows_are_chosen_by_the_name_of_their_stage(tmp_path):
    writer = run_writer(tmp_path / "run.nc")
    for i in range(4):
        writer.append(run_row(i))
    writer.close("complete")
    ds = open_run(tmp_path / "run.nc")
    assert ds.sel(stage="shear").time.values.tolist() == [0.5, 1.5]
    assert ds.friction.groupby("stage").mean().values.tolist() == [1.25, 2.25]
    assert ds.friction.run == "angular-7" and ds.density == 2500.0 and "density" in ds.coords
    assert set(ds.friction.coords) == {"time", "stage", "shear_strain", "run", "seed", "density"}


def test_many_runs_open_as_one_with_what_tells_them_apart(tmp_path):
    """Of different times, lengths and effects."""
    for i, name in enumerate(("a", "b", "c")):
        (tmp_path / "runs" / name).mkdir(parents=True)
        scalars = [Scalar("run", name, "name of the run"), Scalar("seed", i, "random seed")]
        some = effects()[: 3 - i]
        writer = run_writer(tmp_path / "runs" / name / "run.nc", scalars=scalars, effects=some)
        for row in range(4 + i):
            writer.append(run_row(row) | {"time": 0.5 * row + 0.1 * i, "friction": row + 10.0 * i})
        writer.close("complete")
    runs = open_runs(tmp_path)
    assert list(runs.run.values) == ["a", "b", "c"] and runs.seed.values.tolist() == [0, 1, 2]
    assert runs.sizes["row"] == 6 and runs.time.sel(run="b").values[1] == 0.6
    assert runs.friction.sel(run="a").values[:4].tolist() == [0, 1, 2, 3] and np.isnan(runs.friction.values[0, 4])
    assert runs.friction.where(runs.stage == "shear").max("row").values.tolist() == [3, 13, 25]
    gravity = runs.parameter_value.sel(effect_parameter="gravity.acceleration_1")
    assert gravity.values[0] == -9.81 and np.isnan(gravity.values[1:]).all()
    with pytest.raises(lsm.InputError, match="holds no runs"):
        open_runs(tmp_path / "runs")
    some = open_runs([tmp_path / "runs" / "c", str(tmp_path / "runs" / "a" / "run.nc")])
    assert list(some.run.values) == ["c", "a"] and some.seed.values.tolist() == [2, 0]
    for wrong, words in (
        ([tmp_path / "runs"], "runs: holds no run.nc"),
        ([], "is empty"),
        ([7], "7, must be"),
        (7, "7,"),
    ):
        with pytest.raises(lsm.InputError, match=words):
            open_runs(wrong)


def test_the_recipe_of_a_ratio_in_the_docs_has_no_unit(tmp_path):
    text = (Path(lsm.__file__).parents[1] / "docs" / "conventions.md").read_text(encoding="utf-8")
    recipe = [line.strip() for line in text.splitlines() if line.startswith("      ratio")]
    stress = xr.Dataset({"shear_stress": ("row", [1.0, 3.0]), "normal_stress": ("row", [4.0, 4.0])})
    for name in stress:
        stress[name].attrs["units"] = "Pa"
    lines = "\n".join(line for line in recipe if "=" in line)  # of the docs as they stand
    (tmp_path / "recipe.py").write_text(lines, encoding="utf-8")
    ratio = runpy.run_path(str(tmp_path / "recipe.py"), {"sheared": stress})["ratio"]
    assert ratio.item() == 0.5 and ratio.attrs["units"] == "1"


def test_the_effects_that_acted_are_a_table(tmp_path):
    run_writer(tmp_path / "run.nc", effects=effects()).close("complete")
    rows = {(row.effect, row.name): row for row in read_effects(open_run(tmp_path / "run.nc"))}
    for other in (str(tmp_path / "run.nc"), open_run(tmp_path / "run.nc").expand_dims(run=["a", "b"])):
        with pytest.raises(lsm.InputError, match=r"read_effects: .* of no single run, must be lsm\.open_run"):
            read_effects(other)
    assert rows["linear_elastic", "stiffness"][1:] == ("elasticity", "stiffness", "N m-1", "100000", 1e5)
    assert rows["rate_and_state_friction", "reference_coefficient"].value == 0.1
    evolution = rows["rate_and_state_friction", "evolution"]
    assert evolution[3:5] == ("", "slip") and np.isnan(evolution.value)
    assert rows["gravity", "acceleration_1"][3:] == ("m s-2", "-9.81", -9.81)
    assert effect_parameters([lsm.CoulombFriction(0.5, 1e5)])[-1].name == "tangential_stiffness"  # the last is None


def test_every_variable_is_described(tmp_path):
    """Units and long_name everywhere (texts have no unit), no _FillValue, all global attributes."""
    needed = {
        "title",
        "summary",
        "source",
        "history",
        "references",
        "date_created",
        "id",
        "config_toml",
        "seed",
        "dt",
        "git_commit",
        "run_status",
        "Conventions",
    }
    paths = write_every_kind(tmp_path)
    assert len(paths) == 4
    for path in paths:
        check_described(path)
        with netCDF4.Dataset(path) as ds:
            assert needed <= set(ds.ncattrs())


def cf_messages(path, report):
    """What compliance-checker finds against CF-1.11 at its strictest, as a list of texts."""
    from compliance_checker.runner import CheckSuite, ComplianceChecker

    CheckSuite.load_all_available_checkers()
    ComplianceChecker.run_checker(
        str(path), ["cf:1.11"], 0, "strict", output_filename=str(report), output_format="json"
    )
    found = json.loads(report.read_text())["cf:1.11"]
    return [
        text for level in ("high", "medium", "low") for check in found[f"{level}_priorities"] for text in check["msgs"]
    ]


@pytest.fixture
def offline(monkeypatch):
    def refuse(*_):
        raise OSError("this test must not use the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)


def test_files_comply_with_cf(tmp_path, offline):
    """Only elapsed time without the standard name of a date is remarked on."""
    for path in write_every_kind(tmp_path):
        messages = cf_messages(path, tmp_path / "report.json")
        expected = {"Coordinate variable 'time' should have standard_name='time', found: 'None'"}
        assert set(messages) == (set() if path.name == "compare.nc" else expected), path.name


def test_compliance_messages_are_read(tmp_path, offline):
    """The test above can fail: a unit that does not exist is reported."""
    rows = [Variable("friction", ("run",), "f64", "furlongs_per_moon", "friction")]
    write_table(tmp_path / "bad.nc", {"friction": [0.1]}, rows, attributes())
    messages = cf_messages(tmp_path / "bad.nc", tmp_path / "report.json")
    assert any("furlongs_per_moon" in text for text in messages)


def test_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "run.nc"
    write_atomically(path, lambda dataset: dataset.setncattr("title", "old"))

    def fill(dataset):
        dataset.title = "new"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, fill)
    with netCDF4.Dataset(path) as dataset:
        assert dataset.title == "old"
    assert os.listdir(tmp_path) == ["run.nc"]


def test_file_is_there_from_the_start_and_flushes_in_time(tmp_path, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("taichi_lsm.io.run_file.time.monotonic", lambda: clock[0])
    writer = run_writer(tmp_path / "run.nc", flush_seconds=30)

    def rows_on_file():
        with xr.open_dataset(tmp_path / "run.nc") as ds:
            assert ds.attrs["run_status"] == "running"
            return ds.sizes["time"]

    assert rows_on_file() == 0
    for i, (now, expected) in enumerate([(110, 0), (129, 0), (131, 3), (160, 3), (161, 5)]):
        clock[0] = now
        writer.append(run_row(i))
        assert rows_on_file() == expected, now


WRITE_FOREVER = """
import sys
sys.path.insert(0, {root!r})
from pathlib import Path
from tests.helpers.output_files import run_row, run_writer
writer = run_writer(Path(sys.argv[1]))
i = 0
while True:
    writer.append(run_row(i))
    writer.flush()
    i += 1
"""


def check_rows(path):
    """Open the file, check that every row is whole, return their number."""
    with xr.open_dataset(path) as ds:
        ds.load()
    i = np.arange(ds.sizes["time"])
    np.testing.assert_array_equal(ds.time, 0.5 * i)
    np.testing.assert_array_equal(ds.contact_count, 10 * i)
    assert ds.attrs["run_status"] == "running"
    return len(i)


@pytest.mark.validate
def test_kill_at_any_instant_leaves_a_readable_file(tmp_path):
    """Ten writers are killed in the middle of their work while a reader opens their files again and again."""
    rng = random.Random(3)
    code = WRITE_FOREVER.format(root=str(ROOT))
    for attempt in range(10):
        path = tmp_path / f"run{attempt}.nc"
        process = subprocess.Popen([sys.executable, "-c", code, str(path)], stderr=subprocess.PIPE)
        try:
            deadline = time.monotonic() + 30
            while not path.exists() or check_rows(path) < 2:
                assert process.poll() is None, process.stderr.read().decode()
                assert time.monotonic() < deadline, "the writer does not start"
                time.sleep(0.01)
            for _ in range(rng.randint(1, 12)):
                check_rows(path)
            time.sleep(rng.uniform(0, 0.01))
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()
            process.stderr.close()
        assert check_rows(path) >= 2
        # What the killed process left does not disturb the next writer.
        run_writer(path).close("failed")
        assert not [name for name in os.listdir(tmp_path) if name.endswith(".part")]


def test_git_commit_is_that_of_the_package(tmp_path):
    def git(*arguments):
        done = subprocess.run(
            ["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.strip()

    folder = tmp_path / "venv" / "taichi_lsm"
    folder.mkdir(parents=True)
    assert git_commit(folder) == "unknown"
    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "start")
    assert git_commit(folder) == "unknown"  # somebody else's repository
    (tmp_path / "taichi_lsm").mkdir()
    (tmp_path / "taichi_lsm" / "scene.py").touch()
    assert git_commit(folder) == git("rev-parse", "HEAD")


def test_import_is_light():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); "
        "import taichi_lsm.io.grains_file, taichi_lsm.io.open_run, taichi_lsm.statistics; "
        "print([m for m in ('taichi', 'xarray', 'netCDF4', 'arviz_stats') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(ROOT)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
