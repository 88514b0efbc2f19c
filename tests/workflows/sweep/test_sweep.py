"""A sweep of a toy on workers of this machine: what fails is told, what is complete is not repeated."""

import json
import subprocess
import sys

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows.cli.main import main
from workflows.cli.sweep_progress import SweepProgress
from workflows.common.one_run import COMPLETED

pytestmark = pytest.mark.usefixtures("toy")

SWEEP = """
experiment = "toy-run"
grains = 10
[sweep.grid]
normal_stress = [1e3, 2e3]
act = ["finish", "diverge", "kill"]
"""


def test_a_sweep_tells_of_every_run_and_repeats_only_what_failed(tmp_path, capsys, monkeypatch):
    begun = []
    monkeypatch.setattr(SweepProgress, "started", lambda progress, label: begun.append(label))
    file, out = tmp_path / "sweep.toml", tmp_path / "out"
    file.write_text(SWEEP)
    command = ["sweep", str(file), "--out", str(out), "--retries", "1"]
    assert main(command) == 0
    said = capsys.readouterr()
    assert "run 2 failed: diverged at step 7" in said.err and "run 3 failed: killed by SIGKILL" in said.err
    assert said.out.count("begun again") == 2 and "6/6 run" in said.out and "dashboard of the workers" in said.out
    assert sorted(begun) == ["1", "2", "3", "3", "4", "5", "6", "6"]  # each worker says what it begins
    cube = lsm.open_sweep(out)
    assert cube.status.dims == ("target_normal_stress", "act") and cube.target_normal_stress.values.tolist() == [
        1e3,
        2e3,
    ]
    assert cube.status.sel(act="finish").values.tolist() == [COMPLETED] * 2
    assert cube.stress.sel(act="finish").values.tolist() == [1e3, 2e3] and cube.stress.units == "Pa"
    assert np.isnan(cube.stress.sel(act=["diverge", "kill"])).all()
    assert json.loads((out / "summary.json").read_text())["metrics"]["complete"]["value"] == 2
    alone = [sys.executable, "-m", "workflows.cli.main", "toy-run", "--config", str(out / "points" / "1.toml")]
    assert subprocess.run([*alone, "--out", str(tmp_path / "alone"), "--quiet"]).returncode == 0
    kept = {path: path.stat().st_mtime_ns for path in (out / "runs" / "1").iterdir()}
    assert main([*command, "--quiet"]) == 0
    assert {path: path.stat().st_mtime_ns for path in (out / "runs" / "1").iterdir()} == kept
    file.write_text(SWEEP.replace("10", "11"))
    assert main(command) == 2 and "holds another sweep" in capsys.readouterr().err
    copy = tmp_path / "out/sweep.toml"
    text = copy.read_bytes()
    copy.write_bytes(b"\xff\xfe")
    assert main(command) == 2 and "holds another sweep" in capsys.readouterr().err
    copy.write_bytes(text)
