"""What a sweep is doing while it goes on: a table in a terminal, lines elsewhere.

Of the runs that go on the table tells what varies, for how long, and the strain that is reached, which stands in the
run.nc that each of them writes. In plain output each run has a line when it ends, and every half minute without one a
line tells how many have ended.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from workflows.cli.how_far import last_row
from workflows.cli.progress import clock
from workflows.common import signals
from workflows.common.metrics import shown
from workflows.common.one_run import COMPLETED, FAILED, REFUSED, Outcome
from workflows.sweep.drive import AGAIN, folder_of
from workflows.sweep.plan import PlannedRun, SweepPlan

WAITING, RUNNING = "waiting", "running"
STATUSES = (WAITING, RUNNING, COMPLETED, FAILED, REFUSED)
DRAW_EVERY_S = 1.0
READ_EVERY_S = 10.0  # the strain of each run that goes on
SILENCE_S = 30.0  # the longest in plain output
MOST_ROWS = 16  # of runs that go on, those that have gone on for longest


class SweepProgress:
    """Shows a sweep until `close`; any thread may call it.

    Parameters
    ----------
    plan, out
        The sweep and its folder.
    quiet
        Show nothing.
    console
        Where to show it; None is the standard output.
    """

    def __init__(self, plan: SweepPlan, out: Path, quiet: bool = False, console: Console | None = None) -> None:
        self.plan, self.out, self.quiet = plan, out, quiet
        self.console = console or Console()
        self.status = {run.label: WAITING for run in plan.runs}
        self.since: dict[str, float] = {}  # label of a run that goes on: when it began [s]
        self.took: list[float] = []  # by runs that were completed here [s]
        self.began = self.told_at = time.monotonic()
        self.strains: dict[str, tuple[float, str]] = {}  # label: when it was read, and what
        self.lock, self.closed = threading.RLock(), threading.Event()
        self.live: Live | None = None
        if quiet:
            return
        if self.console.is_terminal:
            self.live = Live(console=self.console, auto_refresh=False)
            self.live.start()
        with signals.blocked():  # the thread leaves them to the main one
            threading.Thread(target=self._go_on, name="lsm sweep progress", daemon=True).start()

    def begin(self, ended: Mapping[str, Outcome]) -> None:
        """How those runs ended, by their label, that are not to be made: refused, or complete before."""
        with self.lock:
            self.status |= {label: outcome.status for label, outcome in ended.items()}
            found = Counter(outcome.status for outcome in ended.values())
            before = f", {found[COMPLETED]} of them complete before" if found[COMPLETED] else ""
            refused = f", {found[REFUSED]} refused" if found[REFUSED] else ""
            self.tell(f"{len(self.status)} runs of {self.plan.experiment}{before}{refused}, in {self.out}")

    def lost(self, why: str) -> None:
        """No run goes on: those that did wait again."""
        with self.lock:
            self.status |= dict.fromkeys(self.since, WAITING)
            self.since.clear()
            self.tell(why)

    def started(self, label: str) -> None:
        """A worker has begun the run `label`, or has begun it again."""
        with self.lock:
            if self.status[label] in (WAITING, RUNNING):
                self.status[label], self.since[label] = RUNNING, time.monotonic()

    def stopped(self, label: str) -> None:
        """The worker of this run is lost: it waits again."""
        with self.lock:
            if self.status[label] == RUNNING:
                self.status[label] = WAITING
                self.since.pop(label, None)

    def changed(self, run: PlannedRun, status: str, outcome: Outcome) -> None:
        """A run has ended, or was killed and waits to be begun again (AGAIN)."""
        with self.lock:
            self.status[run.label] = WAITING if status == AGAIN else status
            self.since.pop(run.label, None)
            if status == COMPLETED and outcome.seconds > 0.0:
                self.took.append(outcome.seconds)
            ended = sum(now not in (WAITING, RUNNING) for now in self.status.values())
            varied = ", ".join(f"{name} {_short(value)}" for name, value in run.point.items())
            why = f": {outcome.note.splitlines()[0]}" if outcome.note else ""
            took = f"{outcome.seconds:.0f} s"
            self.tell(f"{ended}/{len(self.status)} run {run.label} ({varied}) {status}, {took}{why}")

    def tell(self, text: str) -> None:
        """A line, above the table if there is one."""
        with self.lock:
            if self.quiet:
                return
            self.told_at = time.monotonic()
            if self.live is not None:
                self.console.print(Text(f"sweep: {text}"))
            else:
                print(f"sweep: {text}", file=self.console.file, flush=True)

    def close(self) -> None:
        """Leave the last table where it is."""
        self.closed.set()
        with self.lock:
            if self.live is not None:
                self.live.update(self.table(time.monotonic()), refresh=True)
                self.live.stop()
                self.live = None

    def __enter__(self):
        return self

    def __exit__(self, *exc_info):
        self.close()

    def _go_on(self) -> None:
        """Until the end: draw the table anew, or break the silence."""
        while not self.closed.wait(DRAW_EVERY_S):
            try:
                self.draw()
            except OSError:  # nobody reads: the next change meets the same error, where it can end the sweep
                return

    def draw(self) -> None:
        """The table as it is now, or the line that breaks a silence."""
        with self.lock:
            now = time.monotonic()
            if self.closed.is_set():
                return
            if self.live is not None:
                self.live.update(self.table(now), refresh=True)
            elif now - self.told_at >= SILENCE_S - DRAW_EVERY_S:
                self.tell(self.line(now))

    def line(self, now: float) -> str:
        """`12/24 complete, 2 running, 0 failed | 03:10 gone, about 02:50 left`."""
        found = Counter(self.status.values())
        parts = [f"{found[COMPLETED]}/{len(self.status)} {COMPLETED}"]
        parts += [f"{found[status]} {status}" for status in (RUNNING, FAILED)]
        parts += [f"{found[REFUSED]} {REFUSED}"] * (found[REFUSED] > 0)
        return f"{', '.join(parts)} | {self.times(now)}"

    def times(self, now: float) -> str:
        """The time gone and an estimate of what is left."""
        left = self.left(now)
        rest = "" if math.isnan(left) else f", about {clock(left)} left"
        return f"{clock(now - self.began)} gone{rest}"

    def left(self, now: float) -> float:
        """Expected time [s] until the end, if what is left takes as long as what was completed; nan if nothing was."""
        if not self.took:
            return math.nan
        mean, rest = sum(self.took) / len(self.took), Counter(self.status.values())
        done = sum(min(mean, now - since) for since in self.since.values())
        return ((rest[WAITING] + rest[RUNNING]) * mean - done) / max(1, rest[RUNNING])

    def table(self, now: float) -> RenderableType:
        """Counts, the runs that go on, and the times."""
        found = Counter(self.status.values())
        counts = Text(f"sweep of {self.plan.experiment}: ")
        counts.append(", ".join(f"{found[status]} {status}" for status in STATUSES))
        running = sorted(self.since.items(), key=lambda item: item[1])
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        varied = self.plan.varied
        for name in ("run", *varied, "for", "reached"):
            table.add_column(name, justify="right" if name == "for" else "left", no_wrap=True)
        of_label = {run.label: run for run in self.plan.runs}
        for label, since in running[:MOST_ROWS]:
            run = of_label[label]
            values = (_value(run.point[name]) for name in varied)
            table.add_row(*map(Text, (label, *values, clock(now - since), self.strain_of(run, now))))
        more = f"and {len(running) - MOST_ROWS} more" if len(running) > MOST_ROWS else ""
        return Group(counts, *([table] if running else []), *([Text(more)] if more else []), Text(self.times(now)))

    def strain_of(self, run: PlannedRun, now: float) -> str:
        """`shear, strain 1.24/3.00` of a run that goes on, read every READ_EVERY_S."""
        read_at, text = self.strains.get(run.label, (-math.inf, ""))
        if now - read_at >= READ_EVERY_S:
            found = last_row(folder_of(self.out, run))
            goal = "" if found is None or math.isnan(found[2]) else f"/{found[2]:.2f}"  # stages have none
            text = "" if found is None else f"{found[0]}, strain {found[1]:.2f}{goal}"
            self.strains[run.label] = now, text
        return text


def _value(value: Any) -> str:
    return shown(value) if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _short(value: Any) -> str:
    """A value of a parameter with the digits that tell runs apart."""
    return f"{value:.5g}" if isinstance(value, float) else str(value)
