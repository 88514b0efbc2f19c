"""Carries out the runs of a sweep on the workers of Dask, whatever becomes of some of them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from taichi_lsm.core.errors import SimulationError
from workflows.common.one_run import COMPLETED, FAILED, KILLED, REFUSED, Limits, Outcome, carry_out
from workflows.common.run_folder import is_complete
from workflows.sweep.cluster import client_of
from workflows.sweep.plan import PlannedRun, SweepPlan

AGAIN = "begun again"  # of a run that was killed
LOST_S = 600.0  # for which a scheduler that is gone is waited for

Report = Callable[[PlannedRun, str, Outcome], None]  # takes a run, its status now and how it ended


def config_of(out: Path, run: PlannedRun) -> Path:
    """The file with the parameters of a run."""
    return out / "points" / f"{run.label}.toml"


def folder_of(out: Path, run: PlannedRun) -> Path:
    """The folder of a run."""
    return out / "runs" / run.label


def drive(
    plan: SweepPlan,
    out: Path,
    scheduler: str | None,
    jobs: int,
    retries: int,
    limits: Limits,
    report: Report,
    announce: Callable[[str], None],
) -> None:
    """Carry out all runs that are not complete; `report` is told how each ended.

    Parameters
    ----------
    plan, out
        The runs; the folder of the sweep, which all workers see under the same path.
    scheduler, jobs
        Address of a scheduler, or None for `jobs` workers on this machine.
    retries
        How often a run is begun again that was killed; it goes on from its checkpoint.
    limits
        Of each run.
    report, announce
        Take every change of a run, and what else there is to tell.

    Raises
    ------
    InputError
        If there is no scheduler.
    SimulationError
        If the scheduler goes away and does not come back.
    """
    ended = {run.label: Outcome(REFUSED, run.refusal, 0.0) for run in plan.runs if run.params is None}
    ended |= {run.label: Outcome(COMPLETED, "", 0.0) for run in plan.runs if is_complete(folder_of(out, run))}
    for run in plan.runs:
        if run.label in ended:
            report(run, ended[run.label].status, ended[run.label])
    lost_at = None
    while len(ended) < len(plan.runs):
        before = len(ended)
        try:
            with client_of(scheduler, jobs) as client:
                announce(f"progress of the workers: {client.dashboard_link}")
                _carry_out_on(client, plan, out, retries, limits, report, ended)
        except (OSError, asyncio.CancelledError, _SchedulerLost) as error:  # the scheduler has gone away
            lost_at = time.monotonic() if lost_at is None or len(ended) > before else lost_at
            if scheduler is None or time.monotonic() - lost_at > LOST_S:
                raise SimulationError(f"the scheduler is lost: {error}; repeat the command to go on") from error
            announce(f"the scheduler {scheduler} is lost, waiting for it")
            time.sleep(2.0)


class _SchedulerLost(RuntimeError):
    """The scheduler has forgotten what it was asked to do."""


def _carry_out_on(
    client: Any,
    plan: SweepPlan,
    out: Path,
    retries: int,
    limits: Limits,
    report: Report,
    ended: dict[str, Outcome],
) -> None:
    """Submit all runs that have not ended, and take their outcomes as they come."""
    from distributed import as_completed

    futures, tries = {}, dict.fromkeys((run.label for run in plan.runs), 0)

    def submit(run: PlannedRun) -> Any:
        config, folder = config_of(out, run), folder_of(out, run)
        # Keys differ from those of an earlier client, whose results the scheduler may still know.
        key = f"{plan.experiment}-{run.label}-{tries[run.label]}-{time.time_ns()}"
        future = client.submit(
            carry_out, plan.experiment, str(config), str(folder), limits, key=key, pure=False, retries=retries
        )
        futures[future] = run
        return future

    waiting = as_completed([submit(run) for run in plan.runs if run.label not in ended])
    for future in waiting:
        run = futures.pop(future)
        if future.status == "cancelled" or future.status == "lost":
            raise _SchedulerLost(f"run {run.label} was {future.status}")
        outcome = future.result() if future.status == "finished" else _of_error(future.exception())
        if outcome.status == KILLED and tries[run.label] < retries:
            tries[run.label] += 1
            report(run, AGAIN, outcome)
            waiting.add(submit(run))
            continue
        ended[run.label] = Outcome(FAILED, outcome.note, outcome.seconds) if outcome.status == KILLED else outcome
        report(run, ended[run.label].status, ended[run.label])


def _of_error(error: BaseException | None) -> Outcome:
    """The outcome of a run whose worker was lost more often than it may be."""
    return Outcome(FAILED, f"its worker was lost: {' '.join(str(error).split())}", 0.0)


def counts(ended: Mapping[str, Outcome]) -> dict[str, int]:
    """Number of runs by status."""
    found = [outcome.status for outcome in ended.values()]
    return {status: found.count(status) for status in (COMPLETED, FAILED, REFUSED)}
