"""Several runs side by side, each in a fresh process of its own.

Spawned, never forked, and one run per process: Taichi hangs in a fork, and its fields belong to the process.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import time
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.common import discovery, signals
from workflows.common.exit_codes import reason_of
from workflows.common.fresh_processes import end_with_parent
from workflows.common.reports import Progress, as_dict
from workflows.common.run_folder import is_begun, is_done

SEND_EVERY_S = 0.2
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
LOG_LINES = 20

P = ParamSpec("P")
T = TypeVar("T")

Job = tuple[str, str, Any, str | os.PathLike]


class ReplicaError(SimulationError):
    """Some of the runs failed; `failures` maps a label to the reason, or to how the process ended."""

    def __init__(self, failures: dict[str, str]) -> None:
        texts = (f"run {label} failed:\n{text.rstrip()}" for label, text in failures.items())
        super().__init__("\n".join(texts))
        self.failures = failures

    def __reduce__(self):
        return ReplicaError, (self.failures,)


@dataclass
class _Running:
    label: str
    process: BaseProcess
    pipe: Any  # Connection, or PipeConnection on Windows
    log: Path
    report: dict
    failure: str | None = None
    refused: bool = False


def run_replicas(
    jobs: Sequence[Job], at_a_time: int = 2, progress: Progress | None = None, resume: bool = False
) -> list[Path]:
    """Run every job, `at_a_time` of them at once; returns the folders of the runs, in the order of the jobs.

    A failing run does not stop the others.

    Parameters
    ----------
    jobs
        (label, module_name, params, out_dir) each; the process calls module.run(params, out=..., progress=...,
        existing=...): the folders belong to the experiment that makes the runs.
    at_a_time
        Number of processes at once.
    progress
        Receives each child's reports as a dict, with its label and, at the start and end, its state
        (started | done | failed); None is silent, and so are the children.
    resume
        Runs of the same parameters that are complete are not repeated, and those that were begun go on; else all begin
        anew.

    Raises
    ------
    ReplicaError
        When all have ended, if a run failed.
    InputError
        Likewise, if all that failed was refused as bad input.
    Interrupted
        After the signal was passed on and the children have flushed their files and ended.
    ValueError
        For equal labels.
    """
    labels = [job[0] for job in jobs]
    if len(set(labels)) < len(labels) or at_a_time < 1:
        raise ValueError(f"run_replicas: labels {labels} must differ, at_a_time {at_a_time} must be >= 1")
    show = progress or (lambda report: None)
    waiting = deque(job for job in jobs if not (resume and is_done(Path(job[3]), job[2])))
    running, failures, refused = [], {}, set()
    with tempfile.TemporaryDirectory(prefix="lsm-") as logs:
        try:
            while waiting or running:
                while waiting and len(running) < at_a_time:
                    job = waiting.popleft()
                    _start(job, Path(logs) / f"{len(waiting)}.log", progress is not None, resume, running)
                    show({"label": job[0], "state": "started"})
                running = _attend(running, show, failures, refused)
        except BaseException as error:
            _stop(running, error.signum if isinstance(error, signals.Interrupted) else signal.SIGTERM)
            raise
    if failures and refused == set(failures):
        raise InputError("\n".join(dict.fromkeys(failures.values())))
    if failures:
        raise ReplicaError({label: failures[label] for label in labels if label in failures})
    return [Path(job[3]) for job in jobs]


def _start(job: Job, log: Path, reports: bool, resume: bool, running: list[_Running]) -> None:
    """Start the process of a job and add it to `running`."""
    label, module_name, params, out = job
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    # Pickled here, and read by the child only once it can import a plugin's Params.
    existing = "resume" if resume and is_begun(Path(out)) else "overwrite"
    payload = pickle.dumps((module_name, params, str(out), reports, existing))
    process = context.Process(target=_child, args=(label, payload, sender, str(log)), name=f"lsm {label}", daemon=True)
    resource_tracker.ensure_running()  # or the first start would launch it, which unblocks the signals again
    # The child inherits both: numpy reads the limits when it is imported, and a signal that arrives before
    # the child has its handlers waits instead of killing it. It is handled once the child is in `running`.
    with _environment(ONE_THREAD), signals.blocked():
        process.start()
        running.append(_Running(label, process, receiver, log, {"label": label}))
    sender.close()


def _attend(
    running: list[_Running], show: Callable[[dict], None], failures: dict[str, str], refused: set[str]
) -> list[_Running]:
    """Wait for a report or an end, pass reports on, record failures; returns the runs that have not ended."""
    wait([r.pipe for r in running] + [r.process.sentinel for r in running])
    still = []
    for run in running:
        alive = run.process.is_alive()  # asked first: what it sent before its end is then still read below
        _drain(run, show)
        if alive:
            still.append(run)
            continue
        run.process.join()
        if run.failure is None and run.process.exitcode != 0:
            run.failure = _how_it_ended(run)
        if run.failure is not None:
            failures[run.label] = run.failure
            refused |= {run.label} if run.refused else set()
        show(run.report | {"state": "failed" if run.failure else "done"})
        run.pipe.close()
    return still


def _drain(run: _Running, show: Callable[[dict], None]) -> None:
    try:
        while run.pipe.poll():
            kind, content = run.pipe.recv()
            if kind == "report":
                run.report = content | {"label": run.label}
                show(run.report)
            else:
                run.failure, run.refused = content, kind == "refused"
    except (EOFError, OSError):
        time.sleep(0.01)  # its end of the pipe is closed: it is about to end, and `wait` would return at once


def _stop(running: list[_Running], signum: int) -> None:
    """Pass on the signal, and any further one, and wait until every child has flushed its files and ended."""
    while running:
        try:
            for run in running:
                if run.process.is_alive():
                    os.kill(run.process.pid or 0, signum)
            running = [run for run in running if not _joined(run)]
        except signals.Interrupted as again:
            signum = again.signum


def _joined(run: _Running) -> bool:
    while run.process.is_alive():
        # Read on, or a child that waits until its pipe has space never flushes its files.
        wait([run.pipe, run.process.sentinel])
        _drain(run, lambda report: None)
    run.process.join()
    run.pipe.close()
    return True


def _how_it_ended(run: _Running) -> str:
    code = run.process.exitcode or 0
    text = f"the process ended with exit code {code}"
    if code < 0:
        text = f"the process was killed by {signal.Signals(-code).name}"
        text += ", perhaps for want of memory" if -code == signal.SIGKILL else ""
    lines = run.log.read_text(errors="replace").splitlines()[-LOG_LINES:] if run.log.exists() else []
    return "\n".join([text, *lines])


@contextmanager
def _environment(changes: dict[str, str]):
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _child(label: str, payload: bytes, pipe: Any, log: str) -> None:
    """The whole life of one run's process."""
    _redirect_output(log)
    _set_title(f"lsm {label}")
    code = 1
    try:
        signals.install()
        signals.unblock()
        end_with_parent()
        discovery.load_path()
        module_name, params, out, reports, existing = pickle.loads(payload)
        Path(out).mkdir(parents=True, exist_ok=True)
        module = importlib.import_module(module_name)
        module.run(params, out=Path(out), progress=_sender(pipe) if reports else None, existing=existing)
        code = 0
    except signals.Interrupted as interrupted:
        code = 128 + interrupted.signum
    except InputError as error:
        _send(pipe, "refused", str(error))
    except (SimulationError, MemoryError, OSError) as error:
        _send(pipe, "failure", reason_of(error))
    except BaseException:
        _send(pipe, "failure", traceback.format_exc())
    finally:
        pipe.close()
        sys.stdout.flush()
        sys.stderr.flush()
    sys.exit(code)


def _redirect_output(log: str) -> None:
    """Send what the run and its libraries print to a file: the parent's display owns the terminal."""
    sys.stdout.flush()
    sys.stderr.flush()
    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    os.close(handle)


def _set_title(title: str) -> None:
    """The name that top and ps show; only Linux has a file for it."""
    with suppress(OSError):
        Path("/proc/self/comm").write_text(title[:15])


def _sender(pipe: Any) -> Callable[[Any], None]:
    last, stage = -SEND_EVERY_S, None

    def send(report: Any) -> None:
        nonlocal last, stage
        report = as_dict(report)
        begins = report.get("stage") != stage
        if "state" in report or begins or time.monotonic() - last >= SEND_EVERY_S:
            last, stage = time.monotonic(), report.get("stage")
            _send(pipe, "report", report)

    return send


def _send(pipe: Any, kind: str, content: Any) -> None:
    with suppress(OSError):  # the parent was killed
        pipe.send((kind, content))
