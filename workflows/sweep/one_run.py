"""Carries out one run of a sweep in a process of its own, on whatever machine a worker has."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from workflows.common.exit_codes import BAD_INPUT, COMPLETE
from workflows.common.parallel_runs import ONE_THREAD
from workflows.common.run_folder import is_begun, is_complete

POLL_S = 0.2  # between two looks at the time and memory of a run
LOCKED_S = 60.0  # for which a run waits for a former process in its folder to end
LAST_WORDS_S = 60.0  # that a run has to write its files once it is asked to end
HERE = Path(__file__).resolve().parents[2]
COMPLETED, FAILED, KILLED = "complete", "failed", "killed"


@dataclass(frozen=True)
class Limits:
    """What a run may take.

    Attributes
    ----------
    seconds
        Wall-clock time [s]; None is unlimited.
    memory
        Resident memory [bytes]; None is unlimited.
    """

    seconds: float | None = None
    memory: float | None = None


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    status
        COMPLETED; FAILED for a reason that would be the same in a second try; KILLED by something else.
    note
        Why, if it is not complete.
    seconds
        Wall-clock time [s].
    """

    status: str
    note: str
    seconds: float


def carry_out(experiment: str, config: str, out: str, limits: Limits) -> Outcome:
    """Run an experiment, or go on with a run that was begun, in a fresh process; a complete run is left alone.

    Parameters
    ----------
    experiment
        Its name.
    config
        TOML file with the parameters.
    out
        Folder of the run.
    limits
        What it may take.
    """
    began, folder, log = time.monotonic(), Path(out), Path(config).with_suffix(".log")
    if is_complete(folder):
        return Outcome(COMPLETED, "", 0.0)
    words = ["resume", out] if is_begun(folder) else [experiment, "--config", config, "--out", out, "--yes"]
    while True:
        code, stopped = _run([*words, "--quiet"], log, limits, began)
        told = _last_line(log)
        if code != BAD_INPUT or "is in use by" not in told or time.monotonic() - began > LOCKED_S:
            break
        time.sleep(1.0)  # a run whose worker was killed still writes its files
    seconds = time.monotonic() - began
    if stopped:
        return Outcome(FAILED, stopped, seconds)
    if code == COMPLETE and is_complete(folder):
        return Outcome(COMPLETED, "", seconds)
    if code < 0:
        return Outcome(KILLED, f"killed by {signal.Signals(-code).name}, perhaps for want of memory", seconds)
    return Outcome(FAILED, told.removeprefix("lsm: ") or f"exit code {code}", seconds)


def _run(words: list[str], log: Path, limits: Limits, began: float) -> tuple[int, str]:
    """(exit code, why the run was stopped, or "") of one process of `lsm`."""
    path = (str(HERE), os.environ.get("PYTHONPATH"))  # the same version as here, wherever the worker was started
    with open(log, "wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "workflows.sweep.child", *words],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, path))},
        )
    why = ""
    try:
        while process.poll() is None and not why:
            time.sleep(POLL_S)
            if limits.seconds is not None and time.monotonic() - began > limits.seconds:
                why = f"it ran for more than {limits.seconds:g} s, the limit"
            elif limits.memory is not None and process.poll() is None:
                used = _memory_of(process.pid)
                if used > limits.memory:
                    why = f"it took {used / 1e9:.3g} GB of memory, the limit is {limits.memory / 1e9:.3g} GB"
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(LAST_WORDS_S)
            except subprocess.TimeoutExpired:
                process.kill()
        if process.stdin:
            process.stdin.close()
    return process.wait(), why


def _memory_of(pid: int) -> int:
    """Resident memory of a process and of those that it has started [bytes]; 0 once it has ended."""
    import psutil

    used = 0
    with suppress(psutil.Error):
        process = psutil.Process(pid)
        for one in (process, *process.children(recursive=True)):
            with suppress(psutil.Error):  # it has just ended
                used += one.memory_info().rss
    return used


def _last_line(log: Path) -> str:
    """The last message of `lsm` in a log, or its last line."""
    lines = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    said = [line for line in lines if line.startswith("lsm: ")]
    return (said or lines or [""])[-1]
