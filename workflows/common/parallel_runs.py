"""Several runs side by side on this machine, each in a fresh process of its own."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.common import signals
from workflows.common.child_reports import READ_EVERY_S, ChildReports, child_reports
from workflows.common.discovery import command_of
from workflows.common.one_run import COMPLETED, INTERRUPTED, REFUSED, Outcome, Stop, carry_out
from workflows.common.reports import Progress
from workflows.common.run_folder import is_done
from workflows.common.toml_writer import to_toml

Job = tuple[str, str, Any, str | os.PathLike]


class ReplicaError(SimulationError):
    """Some of the runs failed; `failures` maps a label to the reason, or to how the process ended."""

    def __init__(self, failures: dict[str, str]) -> None:
        texts = (f"run {label} failed:\n{text.rstrip()}" for label, text in failures.items())
        super().__init__("\n".join(texts))
        self.failures = failures

    def __reduce__(self):
        return ReplicaError, (self.failures,)


def run_replicas(
    jobs: Sequence[Job], at_a_time: int = 2, progress: Progress | None = None, resume: bool = False
) -> list[Path]:
    """Run every job, `at_a_time` of them at once; returns the folders of the runs, in the order of the jobs.

    A failing run does not stop the others. Threads of a pool wait for the runs, which `carry_out` makes; a client of
    Dask has the same `submit`, and `lsm sweep` hands the same function to it.

    Parameters
    ----------
    jobs
        (label, module_name, params, out_dir) each, params of the module's Params. A process calls module.run(params,
        out=..., progress=..., existing=...): the folders belong to the experiment that makes the runs.
    at_a_time
        Number of processes at once.
    progress
        Receives each child's reports as a dict, with its label and, at the start and end, its state
        (started | done | failed); None is silent, and so are the children. Threads call it, one at a time.
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
    missing = [job for job in jobs if not (resume and is_done(Path(job[3]), job[2]))]
    stop, pool = Stop(), ThreadPoolExecutor(at_a_time, thread_name_prefix="lsm run")
    with tempfile.TemporaryDirectory(prefix="lsm-") as folder, child_reports(progress) as reports:
        try:
            with signals.blocked():  # the threads leave them to this one
                configs = [Path(folder) / f"{i}.toml" for i in range(len(missing))]
                work = zip(missing, configs, strict=True)
                ends = [pool.submit(_made, job, config, reports, resume, stop) for job, config in work]
            waiting = set(ends)
            while waiting:
                ended, waiting = wait(waiting, READ_EVERY_S, FIRST_COMPLETED)
                reports.show_new()  # raises here if nobody reads
                for end in ended:
                    end.result()  # raises what is no outcome of a run
            pool.shutdown()
        except BaseException as error:
            _end(pool, stop, error.signum if isinstance(error, signals.Interrupted) else signal.SIGTERM)
            raise
    outcomes = {job[0]: end.result() for job, end in zip(missing, ends, strict=True)}
    failed = {label: outcome for label, outcome in outcomes.items() if outcome.status != COMPLETED}
    if failed and all(outcome.status == REFUSED for outcome in failed.values()):
        raise InputError("\n".join(dict.fromkeys(outcome.note for outcome in failed.values())))
    if failed:
        raise ReplicaError({label: f"{outcome.note}\n{outcome.log}".rstrip() for label, outcome in failed.items()})
    return [Path(job[3]) for job in jobs]


def _made(job: Job, config: Path, reports: ChildReports, resume: bool, stop: Stop) -> Outcome:
    """How the run of a job ended; a thread of the pool waits for it here."""
    label, module_name, params, out = job
    experiment = command_of(module_name)
    config.write_text(to_toml(params, experiment), encoding="utf-8")
    reports.show({"label": label, "state": "started"})
    existing = "resume" if resume else "overwrite"
    outcome = carry_out(experiment, str(config), str(out), existing=existing, reports=reports.of(label), stop=stop)
    if outcome.status != INTERRUPTED:
        reports.show_end(label, "done" if outcome.status == COMPLETED else "failed")
    return outcome


def _end(pool: ThreadPoolExecutor, stop: Stop, signum: int) -> None:
    """Pass on a signal, and any further one, and wait until every child has flushed its files and ended."""
    while True:
        stop.ask(signum)
        try:
            pool.shutdown(cancel_futures=True)
            return
        except signals.Interrupted as again:
            signum = again.signum
