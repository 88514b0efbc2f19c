"""`lsm export`: tables and text as other programs read them, runs that go on, and what is refused."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import pytest

import taichi_lsm as lsm
from tests.helpers.exported_runs import LENGTH, TIMES, write_run
from tests.helpers.shaped_grains import append_snapshot, grains_file
from workflows.cli.main import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run"), 2)


def export(*words):
    return main(["export", *map(str, words)])


def test_tables_are_read_by_pandas_with_their_units(folder, tmp_path, capsys):
    assert export(folder, "--format", "csv", "--out", tmp_path / "csv") == 0
    assert "3 snapshots: " in capsys.readouterr().out
    run, rows = lsm.open_run(folder / "run.nc"), pandas.read_csv(tmp_path / "csv" / "run.csv")
    assert rows.columns[0] == "time [s]" and np.array_equal(rows["time [s]"], run.time)
    assert np.array_equal(rows["friction [1]"], run.friction) and rows.stage.tolist() == run.stage.values.tolist()
    assert np.array_equal(rows["dissipated_energy.coulomb_friction [J]"], run.dissipated_energy[:, 1])
    table = pandas.read_csv(tmp_path / "csv" / "run_effect_parameter.csv")
    assert table["parameter_name"].tolist() == run.parameter_name.values.tolist()
    grains, all_rows = lsm.open_run(folder / "grains.nc"), pandas.read_csv(tmp_path / "csv" / "grains.csv")
    assert all_rows.columns[:3].tolist() == ["time [s]", "stage", "grain"] and len(all_rows) == 27
    for i, time in enumerate(TIMES):
        own = all_rows[all_rows["time [s]"] == time]
        assert own.grain.tolist() == list(range(9)) and np.array_equal(own["mass [kg]"], grains.mass)
        assert np.array_equal(own[["position.x [m]", "position.y [m]"]], grains.position[i])
        assert np.array_equal(own["orientation.z [1]"], grains.orientation[i, :, 3])


def test_extended_xyz_has_a_box_and_named_columns(folder, tmp_path):
    assert export(folder, "--format", "xyz", "--out", tmp_path / "xyz", "--times", "last") == 0
    count, head, *rows = (tmp_path / "xyz" / "grains.xyz").read_text().splitlines()
    assert int(count) == len(rows) == 9
    fields = dict(re.findall(r'(\w+)=("[^"]*"|\S+)', head))
    assert fields["pbc"] == '"T F F"' and float(fields["Time"]) == TIMES[2]
    box = np.array(fields["Lattice"].strip('"').split(), float).reshape(3, 3)
    assert box[0].tolist() == [LENGTH, 0.0, 0.0]
    columns, at = {}, 0
    for name, width in re.findall(r"(\w+):[SRI]:(\d)", fields["Properties"]):
        columns[name], at = slice(at, at + int(width)), at + int(width)
    table = np.array([["0", *row.split()[1:]] for row in rows], float)
    assert table.shape == (9, at) and {row.split()[0] for row in rows} == {"X"}
    now = lsm.open_run(folder / "grains.nc").isel(time=2)
    assert table[:, columns["id"]].ravel().tolist() == list(range(9))
    assert np.allclose(table[:, columns["mass"]].ravel(), now.mass)
    assert np.allclose(table[:, columns["pos"]][:, 1], now.position[:, 1], atol=1e-11)
    assert np.allclose(table[:, columns["velo"]][:, :2], now.velocity)
    assert np.allclose(table[:, columns["orientation"]], now.orientation[:, [1, 2, 3, 0]])  # x, y, z, w as in OVITO


def test_snapshots_are_selected(folder, tmp_path):
    assert export(folder, "--format", "lammps-data", "--out", tmp_path / "all", "--times", "all", "--every", "2") == 0
    assert sorted(p.name for p in (tmp_path / "all").iterdir()) == ["grains_0.data", "grains_2.data"]


def test_a_run_that_goes_on_gives_its_whole_snapshots(tmp_path):
    """Half a record behind the last one is of a snapshot that is being written, or of a killed run."""
    run = write_run(tmp_path / "run", 2, "running")
    with open(run / "grains.nc", "ab") as file:
        file.write(b"half a record")
    assert export(run, "--format", "csv", "--quiet") == 0
    assert len(pandas.read_csv(run / "export-csv" / "grains.csv")) == 27


def test_a_folder_is_written_over_when_that_is_asked_for(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert export(folder, "--format", "lammps-data", "--times", "all", "--out", out) == 0
    (out / "mine.txt").write_text("kept")
    assert export(folder, "--format", "lammps-data", "--out", out) == 2
    assert "is not empty, must be new or empty unless --overwrite is given" in capsys.readouterr().err
    assert export(folder, "--format", "lammps-data", "--out", out, "--overwrite") == 0
    assert sorted(p.name for p in out.iterdir()) == ["grains_2.data", "mine.txt"]


@pytest.mark.parametrize(("form", "library"), [("vtk", "pyvista"), ("gsd", "gsd.hoomd")])
def test_a_missing_library_names_the_extra(folder, tmp_path, monkeypatch, capsys, form, library):
    monkeypatch.setitem(sys.modules, library, None)
    assert export(folder, "--format", form, "--out", tmp_path / "out") == 2
    assert "which is not installed; pip install 'taichi-lsm[export]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_is_no_run_is_told(folder, tmp_path, capsys):
    cases = [
        ((tmp_path / "none", "--format", "csv"), "there is no such folder"),
        ((tmp_path, "--format", "csv"), "holds no run"),
        ((folder / "run.nc", "--format", "csv"), "is a file, must be the folder of a run, such as"),
        ((folder, "--format", "csv", "--times", "9"), "9 s is not within the run"),
        ((folder, "--format", "csv", "--every", "0"), "--every 0: must be >= 1"),
        ((folder, "--format", "stl"), "stl"),
    ]
    for words, message in cases:
        assert export(*words) == 2 and message in capsys.readouterr().err, message
    study = tmp_path / "study"
    write_run(study / "runs" / "a", 2)
    assert export(study, "--format", "vtk") == 2
    assert f"holds no grains.nc, which --format vtk needs; its runs do, such as {study / 'runs' / 'a'}" in (
        capsys.readouterr().err
    )
    empty = tmp_path / "empty"
    empty.mkdir()
    grains_file(empty / "grains.nc", [lsm.disc()], [0], [1e-3])
    assert export(empty, "--format", "xyz") == 2 and "holds no snapshot yet" in capsys.readouterr().err
    assert not list(folder.glob("export-*"))


@pytest.mark.validate
@pytest.mark.parametrize("form", ["vtk", "gsd", "lammps-dump", "csv"])
def test_a_thousand_snapshots_take_less_than_a_gigabyte(tmp_path, form):
    """600 pentagons each, so that the file itself has 60 MB."""
    writer = grains_file(
        tmp_path / "grains.nc", [lsm.shapes.regular_polygon(5)], np.zeros(600, int), np.full(600, 1e-3)
    )
    place = np.random.default_rng(1).uniform(0.0, 1.0, (600, 2))
    for i in range(1000):
        append_snapshot(writer, 1e-3 * i, place)
    command = [sys.executable, "-m", "workflows.cli.main", "export", str(tmp_path), "--format", form]
    process = subprocess.Popen(command, cwd=Path(__file__).resolve().parents[3])
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0 and used.ru_maxrss < 1e6  # kB
