"""What `lsm info` says of a folder."""

import contextlib
import json
import math
import os
import types

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.cli.main import main
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import to_toml


@pytest.mark.parametrize("text", ["", "[]", '{"workflow": "a", "preset": null, "metrics": []}', "\xff"])
def test_a_summary_that_is_none_is_called_unreadable(tmp_path, capsys, text):
    (tmp_path / "summary.json").write_text(text, encoding="latin-1")
    assert main(["info", str(tmp_path)]) == 0
    assert "summary.json: unreadable" in capsys.readouterr().out


def test_a_summary_of_an_earlier_version_is_called_that(tmp_path, capsys):
    (tmp_path / "summary.json").write_text('{"workflow": "a", "preset": null, "figures": {}}')
    assert main(["info", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "summary.json: made by an earlier version, which wrote `figures`" in out and "unreadable" not in out


def test_info_shows_status_metrics_and_dimensions(tmp_path, capsys):
    with netCDF4.Dataset(tmp_path / "run.nc", "w") as file:
        file.createDimension("time", 4)
        file.run_status = "interrupted"
        file.seed = 11
    (tmp_path / "grains.nc").write_bytes(b"half a file")
    write_summary(tmp_path, "toy-run", None, {"drift": Metric(0.02, "1", 0.025, True)}, quiet=True)
    assert main(["info", str(tmp_path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "run_status: interrupted seed: 11" in text
    assert "drift 0.02 0.025 holds" in text
    assert "run.nc time 4, 0 variables" in text and "grains.nc unreadable" in text


def test_info_shows_the_groups_of_a_file(tmp_path, capsys):
    with netCDF4.Dataset(tmp_path / "cycles.nc", "w") as file:
        for name, cycles in (("up", 3), ("down", 2)):
            group = file.createGroup(name)
            group.createDimension("cycle", cycles)
            group.createVariable("friction", "f8", ("cycle",))
            group.createDimension("name_length", 9)  # letters of texts are no dimension of the data
            group.createVariable("name", "S1", ("cycle", "name_length"))
    assert main(["info", str(tmp_path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "cycles.nc group up: cycle 3, 2 variables; group down: cycle 2, 2 variables" in text


def test_info_shows_no_time_step_of_a_table_that_has_none(tmp_path, capsys):
    with netCDF4.Dataset(tmp_path / "hard_cases.nc", "w") as file:
        file.dt, file.seed = math.nan, 3
    assert main(["info", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "seed: 3" in out and "nan" not in out and "dt" not in out


def test_info_opens_the_files_of_runs_only(tmp_path, capsys, monkeypatch):
    opened = []
    monkeypatch.setattr(lsm, "opened_netcdf", lambda path: opened.append(path.relative_to(tmp_path)) or closed())
    for folder in ("", "runs/a", "runs/b", "runs/a/deeper", "elsewhere"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "run.nc").touch()
    (tmp_path / "runs/empty").mkdir()
    assert main(["info", str(tmp_path)]) == 0
    assert set(map(str, opened)) == {"run.nc", "runs/a/run.nc", "runs/b/run.nc"}
    lines = capsys.readouterr().out.splitlines()
    assert lines[-5:-1] == ["Runs:", "  runs/a  failed", "  runs/b  failed", ""]
    assert main(["info", str(tmp_path / "runs/empty")]) == 2


def test_info_lists_figures_and_says_what_shows_the_run(tmp_path, capsys):
    """What lsm plot has drawn lies in plots."""
    (tmp_path / "run.nc").write_bytes(b"")
    (tmp_path / "plots").mkdir()
    for name in ("run.png", "plots/energy.svg", "plots/note.txt"):
        (tmp_path / name).write_text("12345")
    assert main(["info", str(tmp_path)]) == 0
    *lines, blank, last = capsys.readouterr().out.splitlines()
    assert lines[-3:] == ["Figures:", "  run.png           5 bytes", "  plots/energy.svg  5 bytes"]
    assert not blank and last == f"to see it: lsm plot {tmp_path}, lsm report {tmp_path}"
    assert "run.png" not in " ".join(lines[:-3]) and "note.txt" not in " ".join(lines)
    for name in ("grains.nc", "sweep.nc"):
        (tmp_path / name).touch()
    main(["info", str(tmp_path)])
    last = capsys.readouterr().out.splitlines()[-1]
    assert f"lsm sweep-plot {tmp_path}, " in last and last.endswith(f"lsm export {tmp_path} --format vtk")


def closed():
    """Stands in for a NetCDF file of a failed run."""
    file = types.SimpleNamespace(ncattrs=lambda: ["run_status"], getncattr=lambda name: "failed")
    file.dimensions = file.variables = {}
    return contextlib.nullcontext(file)


def test_info_says_how_far_an_unfinished_run_has_come(tmp_path, capsys):
    with netCDF4.Dataset(tmp_path / "run.nc", "w") as file:
        file.run_status = "running"
        file.createDimension("time", 3)
        file.createVariable("strain", "f8", ())[...] = 5.0
        file.createVariable("shear_strain", "f8", "time")[:] = [0.0, 0.5, 1.0]
        file.createVariable("stage", str, "time")[:] = np.array(["generate", "shear", "shear"], object)
    main(["info", str(tmp_path)])
    assert "so far: stage shear, shear strain 1 of 5 in the last row\n" in capsys.readouterr().out
    with netCDF4.Dataset(tmp_path / "checkpoint.nc", "w") as file:
        file.setncatts({"grains": 40, "step": 700, "run_state": json.dumps({"rows": 2, "seconds": 30.0})})
    main(["info", str(tmp_path)])
    said = capsys.readouterr().out
    assert "of 5 in the last row, about 04:00 left\n" in said  # 30 s for a strain of 0.5, 4 are left
    assert "  checkpoint.nc  checkpoint of 40 grains at step 700\n" in said
    with netCDF4.Dataset(tmp_path / "run.nc", "a") as file:  # of stages, which say themselves how far they go
        file["strain"][...] = math.nan
    main(["info", str(tmp_path)])
    assert "so far: stage shear, shear strain 1 in the last row\n" in capsys.readouterr().out
    with netCDF4.Dataset(tmp_path / "run.nc", "a") as file:
        file.run_status = "complete"
    (tmp_path / "config.toml").write_text('experiment = "shear-gouge"\n')
    main(["info", str(tmp_path)])
    assert "stopped: all rows are there, its summary is missing; to go on" in capsys.readouterr().out
    (tmp_path / "summary.json").write_text('{"metrics": {}}')
    main(["info", str(tmp_path)])
    assert "so far" not in capsys.readouterr().out


def test_info_says_stage_cycle_and_share_of_a_run_through_stages(tmp_path, capsys):
    """After 30 of 80 t_i; the checkpoint counts 20 of them, in 40 s."""
    until, sample = {"time": 20.0}, {"time": 1.0}
    stages = [{"name": "slide", "velocity": 1.0, "until": until, "sample": sample}]
    stages += [{"name": "creep", "shear_stress": 0.1, "until": until, "sample": sample, "repeat": 3}]
    params = shear_gouge.Params(stages=stages)
    (tmp_path / "config.toml").write_text(to_toml(params, "shear-gouge"))
    with netCDF4.Dataset(tmp_path / "run.nc", "w") as file:
        file.run_status = "interrupted"
        file.createDimension("time", 5)
        file.createVariable("time", "f8", "time")[:] = params.inertial_time * np.array([0.0, 30.0, 40.0, 50.0, 60.0])
        file.createVariable("strain", "f8", ())[...] = math.nan
        file.createVariable("shear_strain", "f8", "time")[:] = [0.0, 0.0, 0.01, 0.02, 0.02]
        names = ["generate", "consolidate", "slide", "slide", "creep"]
        file.createVariable("stage", str, "time")[:] = np.array(names, object)
        file.createVariable("cycle", "i4", "time")[:] = [0, 0, 0, 0, 2]
    with netCDF4.Dataset(tmp_path / "checkpoint.nc", "w") as file:
        file.setncatts({"grains": 40, "step": 700, "run_state": json.dumps({"rows": 4, "seconds": 40.0})})
    main(["info", str(tmp_path)])
    said = capsys.readouterr().out
    assert "stage creep 2, 38 % of the time of all stages, shear strain 0.02 in the last row, about 01:40 left" in said
    with netCDF4.Dataset(tmp_path / "run.nc", "a") as file:  # stages that took longer than they were expected to
        file["time"][4] = 190.0 * params.inertial_time
    main(["info", str(tmp_path)])
    said = capsys.readouterr().out
    assert "200 % of the time of all stages, shear strain 0.02 in the last row, about 00:00 left" in said


def test_info_says_how_to_go_on_with_a_run_that_has_only_begun(tmp_path, capsys):
    """And that an experiment without a NetCDF file of its own is complete."""
    (tmp_path / "config.toml").write_text('experiment = "shear-gouge"\n')
    assert main(["info", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "run_status: unknown: no file of the whole run" in said and f"lsm resume {tmp_path}" in said
    with lsm.locked(tmp_path):
        main(["info", str(tmp_path)])
    said = capsys.readouterr().out
    assert f"in use: process {os.getpid()} on" in said and "lsm resume" not in said
    (tmp_path / "runs" / "round-1").mkdir(parents=True)
    (tmp_path / "runs" / "round-1" / "config.toml").write_text('experiment = "shear-gouge"\n')
    with lsm.locked(tmp_path / "runs" / "round-1"):  # whose parent was killed
        main(["info", str(tmp_path)])
    assert "in use: process" in capsys.readouterr().out
    (tmp_path / "summary.json").write_text('{"metrics": {}}')
    assert main(["info", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "run_status: complete" in said and "lsm resume" not in said
