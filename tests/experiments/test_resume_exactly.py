"""Runs that are stopped at random, moved to other threads, repeated, or run into a full disk: the same bits."""

import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from taichi_lsm.core.errors import SimulationError
from tests.crash.random_kills import differences
from tests.helpers.processes import run_module
from workflows import shear_gouge

pytestmark = pytest.mark.validate

STOPS = 50
# More grains than one thread gets alone, for a time in which they are pressed and begin to be sheared.
MANY = ["--layer-thickness", 30, "--length", 60, "--inertial-number", 0.05, "--strain", 0.5, "--steady-from", 0.1]


@pytest.mark.parametrize("shape", ["sphere", "angular"])
def test_a_run_stopped_at_random_steps_goes_on_to_the_same_bits(sheared, tmp_path, shape):
    """Half of STOPS for each shape: at any step, between two samples or at one."""
    folder, _, whole = sheared(shape)
    steps = np.random.default_rng(4).integers(1, round(float(whole.time[-1]) / whole.dt), STOPS // 2)
    for of_process in np.array_split(steps, len(steps) // 2 + 1):
        lines = run_module("tests.helpers.stopped_runs", folder, tmp_path, *of_process).splitlines()
        assert [line for line in lines if line.startswith("step ")] == [f"step {n}: differs in []" for n in of_process]


def test_threads_and_repetitions_change_no_bit(tmp_path):
    """One and two threads, a run that begins on two and goes on with one, and ten repetitions of a small one."""
    run_module("workflows.cli.main", "shear-gouge", *MANY, "--out", tmp_path / "one")
    run_module("workflows.cli.main", "shear-gouge", *MANY, "--out", tmp_path / "two", "--threads", 2)
    assert differences(tmp_path / "two", tmp_path / "one") == []
    command = [sys.executable, "-m", "workflows.cli.main", "shear-gouge", *map(str, MANY), "--threads", "2"]
    begun = subprocess.Popen([*command, "--checkpoint-seconds", "0.01", "--out", tmp_path / "both"])
    while not (tmp_path / "both" / "checkpoint.nc").exists() and begun.poll() is None:
        time.sleep(0.1)
    begun.terminate()
    assert begun.wait() == 128 + signal.SIGTERM
    run_module("workflows.cli.main", "resume", tmp_path / "both", "--threads", 1)
    assert differences(tmp_path / "both", tmp_path / "one") == []
    small = ["--layer-thickness", 8, "--length", 8, "--inertial-number", 0.05, "--strain", 0.5, "--steady-from", 0.1]
    for i in range(10):
        run_module("workflows.cli.main", "shear-gouge", *small, "--out", tmp_path / f"small-{i}")
        assert differences(tmp_path / f"small-{i}", tmp_path / "small-0") == []


def test_the_file_of_a_run_repeats_it(tmp_path, sheared):
    folder, _, _ = sheared("angular")
    again = tmp_path / folder.name
    run_module("workflows.cli.main", "shear-gouge", "--config", folder / "run.nc", "--out", again)
    assert differences(again, folder) == []


def test_a_run_goes_on_once_there_is_room_on_the_disk(runtime, sheared, tmp_path):
    folder, params, _ = sheared("sphere")
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", disk], capture_output=True, text=True)
    if mounted.returncode:
        pytest.skip(f"no file system can be mounted: {mounted.stderr.strip()}")
    out, ballast, rows = disk / folder.name, disk / "ballast", 0

    def fill(report):
        """Take all the room once shear has begun."""
        nonlocal rows
        rows += report.get("stage") == "shearing"
        if rows == 20 and not ballast.exists():
            ballast.write_bytes(bytes(shutil.disk_usage(disk).free - 8192))

    try:
        eager = params.model_copy(update={"checkpoint_seconds": 0.01})
        with pytest.raises(SimulationError, match=r"disk full: .*MB free in .*; make room and resume"):
            shear_gouge.run(eager, out, fill)
        ballast.unlink()
        shear_gouge.run(eager, out, existing="resume")
        assert differences(out, folder) == []
    finally:
        subprocess.run(["umount", "-l", disk], check=True)
