"""One run in a process of its own: how it ended is told, and it ends when it is asked to or its starter is gone."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import taichi_lsm as lsm
from workflows.common.one_run import COMPLETED, FAILED, INTERRUPTED, KILLED, REFUSED, Limits, Stop, carry_out

pytestmark = pytest.mark.usefixtures("toy")


def config(tmp_path, **values):
    """Arguments of `carry_out` for a toy with these parameters."""
    lines = [f"{name} = {json.dumps(value)}" for name, value in values.items()]
    (tmp_path / "run").mkdir(parents=True)
    (tmp_path / "run.toml").write_text("\n".join(lines))
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
    code = f"from workflows.common.one_run import *\ncarry_out(*{given!r}, Limits())"
    worker = subprocess.Popen(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    )
    wait_for(tmp_path / "run" / "ready")
    worker.send_signal(signal.SIGKILL)
    worker.wait(20)
    wait_for(tmp_path / "run" / "flushed")


def test_why_a_run_did_not_come_to_its_end_is_told_whole(tmp_path):
    """Every line of a refusal, and what was printed where the run could not say anything."""
    refused = carry_out(*config(tmp_path / "a", grains=1, dim=7))
    assert refused.status == REFUSED and refused.log == ""
    assert [line.split()[0] for line in refused.note.splitlines()] == ["--grains", "--dim"]
    unknown = carry_out("no-such-run", *config(tmp_path / "b")[1:])
    assert unknown.status == REFUSED and unknown.note.startswith("no-such-run: unknown experiment, must be one of")
    crashed = carry_out(*config(tmp_path / "c", act="crash"))
    assert crashed.status == FAILED and crashed.note == "KeyError: 'a programming error'"
    assert crashed.log.startswith("Traceback") and 'raise KeyError("a programming error")' in crashed.log


def test_what_becomes_of_a_run_that_is_there(tmp_path):
    given = config(tmp_path, preset="smoke")
    process = tmp_path / "run" / "process"

    def made(existing):
        return carry_out(*given, existing=existing), process.read_text()

    began, first = made("resume")
    assert began.status == COMPLETED and json.loads((tmp_path / "run/summary.json").read_text())["preset"] == "smoke"
    (tmp_path / "run" / "config.toml").write_text('experiment = "toy-run"\npreset = "smoke"\n')
    assert made("resume")[1] == first
    again, second = made("overwrite")
    assert again.status == COMPLETED and second != first
    Path(given[1]).write_text("grains = 11")
    assert made("resume")[1] != second  # the run that is there has other parameters
    assert json.loads((tmp_path / "run/summary.json").read_text())["preset"] is None


def test_a_former_process_in_the_folder_is_waited_for(tmp_path):
    given = config(tmp_path)
    with ThreadPoolExecutor(1) as pool:
        with lsm.locked(tmp_path / "run"):
            run = pool.submit(carry_out, *given)
            time.sleep(1.5)
            assert not run.done() and not (tmp_path / "run" / "process").exists()
        assert run.result().status == COMPLETED


def test_all_signals_are_passed_on_and_no_run_is_begun_after_one(tmp_path):
    given, stop = config(tmp_path, act="count"), Stop()
    with ThreadPoolExecutor(1) as pool:
        run = pool.submit(carry_out, *given, stop=stop)
        for name, signum in (("ready", signal.SIGTERM), ("first", signal.SIGHUP)):
            wait_for(tmp_path / "run" / name)
            stop.ask(signum)
        assert run.result().status == INTERRUPTED and run.result().note == "interrupted by SIGHUP"
    assert (tmp_path / "run" / "first").read_text() == f"{int(signal.SIGTERM)}"
    assert (tmp_path / "run" / "second").read_text() == f"{int(signal.SIGHUP)}"
    (tmp_path / "run.log").unlink()
    assert carry_out(*given, stop=stop).status == INTERRUPTED and not (tmp_path / "run.log").exists()


def wait_for(path):
    """Wait until a file is there."""
    deadline = time.monotonic() + 30
    while not path.exists():
        assert time.monotonic() < deadline, path
        time.sleep(0.05)
