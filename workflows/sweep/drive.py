"""Carries out the runs of a sweep on the workers of Dask, whatever becomes of some of them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.common.one_run import COMPLETED, FAILED, KILLED, REFUSED, Limits, Outcome, carry_out
from workflows.common.run_folder import is_complete
from workflows.sweep.cluster import client_of
from workflows.sweep.plan import PlannedRun, SweepPlan

AGAIN = "begun again"  # of a run that was killed
LOST_S = 600.0  # for which a scheduler that is gone is waited for


class Progress(Protocol):
    """Is told what becomes of the runs, and from any thread when one is begun."""

    def begin(self, ended: Mapping[str, Outcome]) -> None:
        """How those runs ended, by their label, that are not to be made: refused, or complete before."""

    def lost(self, why: str) -> None:
        """No run goes on, since the scheduler is gone."""

    def started(self, label: str) -> None:
        """A worker has begun this run."""

    def stopped(self, label: str) -> None:
        """The worker of this run is lost, another one will begin it."""

    def changed(self, run: PlannedRun, status: str, outcome: Outcome) -> None:
        """A run has this status now: it ended, or was killed and is begun again."""

    def tell(self, text: str) -> None:
        """What else there is to say."""


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
    ended: dict[str, Outcome],
    progress: Progress,
) -> None:
    """Carry out all runs that are not complete, and note in `ended` how each ended, by its label.

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
    ended
        Takes the outcomes, also where this is interrupted.
    progress
        Is told of every change of a run.

    Raises
    ------
    InputError
        If there is no scheduler.
    SimulationError
        If the scheduler goes away and does not come back.
    """
    ended |= {run.label: Outcome(REFUSED, run.refusal, 0.0) for run in plan.runs if run.params is None}
    ended |= {run.label: Outcome(COMPLETED, "", 0.0) for run in plan.runs if is_complete(folder_of(out, run))}
    progress.begin(ended)
    lost_at = None
    while len(ended) < len(plan.runs):
        before = len(ended)
        try:
            with client_of(scheduler, jobs) as client:
                progress.tell(f"dashboard of the workers, which needs bokeh: {client.dashboard_link}")
                _carry_out_on(client, plan, out, retries, limits, ended, progress)
        except (OSError, asyncio.CancelledError, _SchedulerLost, InputError) as error:  # the scheduler has gone away
            if isinstance(error, InputError) and lost_at is None:  # or was never there
                raise
            lost_at = time.monotonic() if lost_at is None or len(ended) > before else lost_at
            if scheduler is None or time.monotonic() - lost_at > LOST_S:
                raise SimulationError(f"the scheduler is lost: {error}; repeat the command to go on") from error
            progress.lost(f"the scheduler {scheduler} is lost, waiting for it")
            time.sleep(2.0)


class _SchedulerLost(RuntimeError):
    """The scheduler has forgotten what it was asked to do."""


def _carry_out_on(
    client: Any,
    plan: SweepPlan,
    out: Path,
    retries: int,
    limits: Limits,
    ended: dict[str, Outcome],
    progress: Progress,
) -> None:
    """Submit all runs that have not ended, and take their outcomes as they come."""
    from distributed import as_completed

    def begin(event: tuple[float, str]) -> None:
        progress.started(event[1])

    def lose_worker(event: tuple[float, dict[str, Any]]) -> None:
        if event[1].get("action") == "remove-worker":
            for key in event[1].get("processing-tasks", ()):
                if key in labels:
                    progress.stopped(labels[key])

    labels: dict[str, str] = {}  # of the runs, by the key that the scheduler knows them by
    here = out.absolute()  # workers may have been started in another folder
    futures, tries = {}, dict.fromkeys((run.label for run in plan.runs), 0)

    def submit(run: PlannedRun) -> Any:
        given = plan.experiment, str(config_of(here, run)), str(folder_of(here, run)), limits
        # Keys differ from those of an earlier client, whose results the scheduler may still know.
        key = f"{plan.experiment}-{run.label}-{tries[run.label]}-{time.time_ns()}"
        future = client.submit(carry_out_told, topic_of(out), run.label, *given, key=key, pure=False, retries=retries)
        futures[future], labels[key] = run, run.label
        return future

    with _told(client, {topic_of(out): begin, "all": lose_worker}):
        waiting = as_completed([submit(run) for run in plan.runs if run.label not in ended])
        for future in waiting:
            run = futures.pop(future)
            if future.status == "cancelled" or future.status == "lost":
                raise _SchedulerLost(f"run {run.label} was {future.status}")
            outcome = future.result() if future.status == "finished" else _of_error(future.exception())
            if outcome.status == KILLED and tries[run.label] < retries:
                tries[run.label] += 1
                progress.changed(run, AGAIN, outcome)
                waiting.add(submit(run))
                continue
            ended[run.label] = Outcome(FAILED, outcome.note, outcome.seconds) if outcome.status == KILLED else outcome
            progress.changed(run, ended[run.label].status, ended[run.label])


@contextmanager
def _told(client: Any, handlers: Mapping[str, Callable[[Any], None]]) -> Iterator[None]:
    """Events of these topics are handled within the block; none is sent to a client that is being closed."""
    for topic, handler in handlers.items():
        client.subscribe_topic(topic, handler)
    try:
        yield
    finally:
        if client.status == "running":
            for topic in handlers:
                client.unsubscribe_topic(topic)


def topic_of(out: Path) -> str:
    """The topic of the events of a sweep, of which a scheduler may serve many."""
    return f"lsm sweep {out.resolve()}"


def carry_out_told(topic: str, label: str, experiment: str, config: str, out: str, limits: Limits) -> Outcome:
    """As `carry_out`, on a worker, which first tells that it has begun the run `label`."""
    from distributed import get_worker

    get_worker().log_event(topic, label)
    return carry_out(experiment, config, out, limits)


def _of_error(error: BaseException | None) -> Outcome:
    """The outcome of a run whose worker was lost more often than it may be, or could not begin it."""
    from distributed import KilledWorker

    lost = isinstance(error, KilledWorker)
    why = "its worker was lost" if lost else "no worker could begin it; have all the same version and the same packages"
    return Outcome(FAILED, f"{why}: {' '.join(str(error).split())}", 0.0)


def counts(ended: Mapping[str, Outcome]) -> dict[str, int]:
    """Number of runs by status."""
    found = [outcome.status for outcome in ended.values()]
    return {status: found.count(status) for status in (COMPLETED, FAILED, REFUSED)}
