"""Carries out one run in a fresh process, on whatever machine this is, and tells how it ended.

Taichi hangs in a fork, and its fields belong to the process: each run has one of its own, which
`workflows/common/run_child.py` describes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from workflows.common.child_reports import SILENT, ReportFile
from workflows.common.exit_codes import BAD_INPUT, COMPLETE
from workflows.common.run_folder import Existing

POLL_S = 0.2  # between two checks of what a run takes, and whether it is to be stopped
LAST_WORDS_S = 60.0  # that a run has to write its files once a limit ends it
LOG_LINES = 20  # that are told of a run which ended without a word
SAYS = "lsm: "  # before each line of a message of a run
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
HERE = str(Path(__file__).resolve().parents[2])
COMPLETED, FAILED, REFUSED, KILLED, INTERRUPTED = "complete", "failed", "refused", "killed", "interrupted"


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

    def exceeded(self, pid: int, seconds: float) -> str:
        """Which of them a process exceeds that has run for some time [s]; "" if none."""
        if self.seconds is not None and seconds > self.seconds:
            return f"it ran for more than {self.seconds:g} s, the limit"
        used = 0 if self.memory is None else _memory_of(pid)
        if self.memory is not None and used > self.memory:
            return f"it took {used / 1e9:.3g} GB of memory, the limit is {self.memory / 1e9:.3g} GB"
        return ""


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    status
        COMPLETED; FAILED for a reason that would be the same in a second try; REFUSED as bad input; KILLED by something
        else; INTERRUPTED by `Stop`.
    note
        Why, if it is not complete.
    seconds
        Wall-clock time [s].
    log
        The last of what it printed, if it could not say itself why it ended.
    """

    status: str
    note: str
    seconds: float
    log: str = ""


class Stop:
    """Asks runs that other threads carry out to end.

    Attributes
    ----------
    signums
        The signals that are passed on to the runs, in their order. After the first one no run is begun.
    """

    def __init__(self) -> None:
        self.signums: list[int] = []

    def ask(self, signum: int) -> None:
        """Pass on a signal."""
        self.signums.append(int(signum))


UNLIMITED, NEVER = Limits(), Stop()


def carry_out(
    experiment: str,
    config: str,
    out: str,
    limits: Limits = UNLIMITED,
    existing: Existing = "resume",
    reports: ReportFile = SILENT,
    stop: Stop = NEVER,
) -> Outcome:
    """Make one run of an experiment in a fresh process with one thread, and wait for its end.

    Any thread may call it, and so may a worker of Dask, which needs no `stop`. If the calling process is killed, the
    run writes its files and ends.

    Parameters
    ----------
    experiment
        Its name.
    config
        TOML file with the parameters; what the run prints is beside it, in a file with the suffix .log.
    out
        Folder of the run. One that a former process still writes to is waited for.
    limits
        What it may take.
    existing
        What becomes of a run that is there, as `run` of an experiment takes it; "resume" also begins one if none is
        there, and leaves alone a complete one of the same parameters.
    reports
        Takes the reports of the run.
    stop
        Ends it.
    """
    began, log = time.monotonic(), Path(config).with_suffix(".log")
    if stop.signums:
        return Outcome(INTERRUPTED, "it was not begun", 0.0)
    with _process([experiment, config, out, existing, reports.path, reports.label], log) as process:
        exceeded = _wait(process, limits, stop, began)
    seconds = time.monotonic() - began
    if stop.signums:
        return Outcome(INTERRUPTED, f"interrupted by {_name(stop.signums[-1])}", seconds)
    if exceeded:
        return Outcome(FAILED, exceeded, seconds)
    return _outcome(process.returncode, log.read_text(encoding="utf-8", errors="replace").splitlines(), seconds)


@contextmanager
def _process(words: Sequence[str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """The process of a run during the block; if it goes on after that, it is asked to end, or killed if it does not."""
    path = (HERE, os.environ.get("PYTHONPATH"))  # the same version as here, wherever this process was started
    with open(log, "wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-P", "-u", "-m", "workflows.common.run_child", *words],
            stdin=subprocess.PIPE,  # held open: its end tells that of this process
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, path))},
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(LAST_WORDS_S)
            except subprocess.TimeoutExpired:
                process.kill()
        if process.stdin:
            process.stdin.close()
        process.wait()


def _wait(process: subprocess.Popen[bytes], limits: Limits, stop: Stop, began: float) -> str:
    """Wait until a process has ended, with signals passed on, or exceeds a limit; returns which, or ""."""
    passed = 0
    while True:
        for signum in stop.signums[passed:]:
            process.send_signal(signum)
            passed += 1
        try:
            process.wait(POLL_S)
            return ""
        except subprocess.TimeoutExpired:
            exceeded = limits.exceeded(process.pid, time.monotonic() - began)
        if exceeded and not passed:  # else it is writing its files
            return exceeded


def _outcome(code: int, log: list[str], seconds: float) -> Outcome:
    """The outcome of a process that ended by itself, by its exit code and the lines that it printed."""
    if code == COMPLETE:
        return Outcome(COMPLETED, "", seconds)
    printed = [line for line in log if line.strip()]
    tail = "\n".join(printed[-LOG_LINES:])
    if code < 0:
        why = ", perhaps for want of memory" if -code == signal.SIGKILL else ""
        return Outcome(KILLED, f"killed by {_name(-code)}{why}", seconds, tail)
    status, said = REFUSED if code == BAD_INPUT else FAILED, _last_words(log)
    if said:
        return Outcome(status, said, seconds)
    return Outcome(status, printed[-1] if printed else f"exit code {code}", seconds, tail)


def _last_words(log: list[str]) -> str:
    """The last message in a log, of one line or of several; "" if there is none."""
    said: list[str] = []
    for line in reversed(log):
        if line.startswith(SAYS):
            said.insert(0, line.removeprefix(SAYS))
        elif said:
            break
    return "\n".join(said)


def _name(signum: int) -> str:
    """SIGTERM, or the number of a signal that has no name."""
    with suppress(ValueError):
        return signal.Signals(signum).name
    return f"signal {signum}"


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
