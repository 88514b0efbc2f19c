"""A sweep of a toy on workers of this machine: what fails is told, what is complete is not repeated."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows.cli.main import main
from workflows.sweep.one_run import COMPLETED, FAILED, KILLED, Limits, carry_out

pytestmark = pytest.mark.usefixtures("toy")

SWEEP = """
experiment = "toy-run"
grains = 10
[sweep.grid]
normal_stress = [1e3, 2e3]
act = ["finish", "diverge", "kill"]
"""


def test_a_sweep_tells_of_every_run_and_repeats_only_what_failed(tmp_path, capsys):
    file, out = tmp_path / "sweep.toml", tmp_path / "out"
    file.write_text(SWEEP)
    command = ["sweep", str(file), "--out", str(out), "--retries", "1"]
    assert main(command) == 0
    said = capsys.readouterr()
    assert "run 2 failed: diverged at step 7" in said.err and "run 3 failed: killed by SIGKILL" in said.err
    assert said.out.count("begun again") == 2 and "6/6 run" in said.out
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


def config(tmp_path, **values):
    lines = [f"{name} = {json.dumps(value)}" for name, value in values.items()]
    (tmp_path / "run.toml").write_text("\n".join(lines))
    (tmp_path / "run").mkdir()
    return "toy-run", str(tmp_path / "run.toml"), str(tmp_path / "run")


@pytest.mark.validate  # waits
def test_a_run_that_takes_too_long_or_too_much_is_stopped_and_may_write_its_files(tmp_path):
    outcome = carry_out(*config(tmp_path, act="wait"), Limits(seconds=3.0))
    assert outcome.status == FAILED and outcome.note == "it ran for more than 3 s, the limit"
    assert not (tmp_path / "run" / "ready").exists() or (tmp_path / "run" / "flushed").exists()


def test_a_run_that_takes_too_much_memory_is_stopped(tmp_path):
    outcome = carry_out(*config(tmp_path, act="wait"), Limits(memory=1e6))
    assert outcome.status == FAILED and "GB of memory, the limit is 0.001 GB" in outcome.note


@pytest.mark.validate  # as in the sweep above
def test_a_run_that_is_killed_is_told_apart_from_one_that_fails(tmp_path):
    assert carry_out(*config(tmp_path, act="kill"), Limits()).status == KILLED


def test_a_run_ends_with_its_worker(tmp_path):
    """Killed, it leaves no run behind that would hold the folder."""
    given = config(tmp_path, act="wait")
    code = f"from workflows.sweep.one_run import *\ncarry_out(*{given!r}, Limits())"
    worker = subprocess.Popen(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    )
    wait_for(tmp_path / "run" / "ready")
    worker.send_signal(signal.SIGKILL)
    worker.wait(20)
    wait_for(tmp_path / "run" / "flushed")


def wait_for(path):
    """Wait until a file is there."""
    deadline = time.monotonic() + 30
    while not path.exists():
        assert time.monotonic() < deadline, path
        time.sleep(0.05)
