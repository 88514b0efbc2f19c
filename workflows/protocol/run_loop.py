"""The run loop that every experiment on a layer shares: stages, samples, rows, snapshots, checkpoints, signals.

The bits of a run do not depend on when a checkpoint is written, nor on where it is interrupted and resumed: samples lie
at steps that the schedule fixes, and between them a simulation may run in pieces of any length.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol

import taichi_lsm as lsm
from workflows.common import signals
from workflows.common.stopwatch import Stopwatch
from workflows.protocol.resume import Start
from workflows.protocol.schedule import FIRST_STAGE, NO_RATE, Position, Stage

CHECKPOINT_S = 60.0  # of wall clock between two checkpoints, or
CHECKPOINT_COST = 50.0  # times as long as one takes, if that is more
PIECE_S = 0.5  # of wall clock after which a signal is noticed
FIRST_PIECE = 2e6  # grain steps before the speed of the run is known
LARGEST_PIECE = 1_000_000  # steps

Report = Callable[[Stage, dict[str, Any]], None]  # takes the stage and the row that was recorded


class Drives(Protocol):
    """What stages drive, by the names that they have for it; values in their units."""

    def value(self, name: str, thickness: float | None) -> float:
        """The value now; thickness: of the layer as shear began [m], None before."""
        ...

    def set(self, name: str, value: float, thickness: float | None) -> None:
        """Set a value from now on."""
        ...


class RunLoop:
    """Takes a layer through a schedule.

    Parameters
    ----------
    layer, recorder
        What is measured, and the files that it is written to.
    schedule
        The stages, in their order.
    drives
        Values of what the stages drive, which it reads and sets.
    report
        Called after every row.
    watch
        Times of the run, which checkpoints keep.
    start
        Where to begin.
    identity
        {name of a parameter: value} of what a run that goes on must have, for its checkpoints.
    checkpoint_seconds
        Wall-clock time between two checkpoints [s]; None: a minute, or as much that they take at most 2 % of the run.

    Attributes
    ----------
    position
        Where the run stands.
    """

    def __init__(
        self,
        layer: lsm.ShearedGrains,
        recorder: lsm.LayerRecorder,
        schedule: Sequence[Stage],
        drives: Drives,
        report: Report,
        watch: Stopwatch,
        start: Start,
        identity: Mapping[str, Any],
        checkpoint_seconds: float | None = None,
    ) -> None:
        self.layer, self.recorder, self.sim = layer, recorder, layer.sim
        self.schedule, self.drives, self.report, self.watch = list(schedule), drives, report, watch
        self.position, self.identity = start.position or Position(), dict(identity)
        self._piece = max(1, int(FIRST_PIECE / len(self.sim)))  # steps
        self._kept, self._given = time.perf_counter(), checkpoint_seconds
        self._interval = checkpoint_seconds or CHECKPOINT_S
        self._first: tuple[float, int] | None = None  # clock and step of the first row of this stage in this process
        self._rate = start.rate

    def run(self) -> None:
        """Go through the rest of the schedule.

        A signal ends the run at the next step that is safe, with a checkpoint: see `signals.held`.

        Raises
        ------
        SimulationError
            If a guard stops the run; the last checkpoint stays.
        """
        with signals.held() as pending:
            if self.position == Position():
                self.recorder.begin_stage(FIRST_STAGE, 0)
                NO_RATE.changed(self.recorder.row(), self.position.marks)  # what is there before any event
                self.recorder.snapshot()
            while self.position.stage < len(self.schedule):
                stage = self.schedule[self.position.stage]
                self._begin(stage)
                while not self._to_next_row(stage, pending):
                    pass
                self._end(stage)
            self.recorder.flush()

    @property
    def grain_steps_per_second(self) -> float:
        """Speed of the last stage after its first row in a process, in which kernels compile [s-1]; nan if none."""
        return self._rate

    def keep_checkpoint(self) -> None:
        """Write all rows, then the state of the run, so that the files have at least the rows that it counts."""
        began = time.perf_counter()
        self.recorder.flush()
        self.sim.keep_checkpoint(
            {
                "position": self.position.as_plain(),
                "layer": self.layer.memory.as_plain(),
                "rows": self.recorder.rows,
                "snapshots": self.recorder.snapshots,
                "moments": self.recorder.moments,
                "id": self.recorder.id,
                "parameters": self.identity,
                "rate": self._rate,
                "seconds": self.watch.seconds,
                "cpu_seconds": self.watch.cpu_seconds,
            }
        )
        self._kept = time.perf_counter()
        self._interval = self._given or max(CHECKPOINT_S, CHECKPOINT_COST * (self._kept - began))

    def _begin(self, stage: Stage) -> None:
        """Begin a stage, unless the run was resumed within it."""
        position, layer = self.position, self.layer
        self._first = None
        if position.begun:
            self.recorder.begin_stage(stage.name, position.stage + 1, stage.cycle, position.slip)
            return
        if stage.drives and position.thickness is None:
            layer.begin_shear()
            position.thickness, position.shear_since = layer.thickness, self.sim.time
        position.since, position.slip = self.sim.time, layer.slip
        self.recorder.begin_stage(stage.name, position.stage + 1, stage.cycle, position.slip)
        position.before = {name: self.drives.value(name, position.thickness) for name in stage.drives}
        position.memory, position.samples, position.rows = stage.until.begin(layer), 0, 0
        position.next_sample, position.begun = self.sim.step + stage.spacing.sample_steps(0), True
        self._drive(stage, stage.drives)

    def _drive(self, stage: Stage, changing: Iterable[str]) -> None:
        """Set what is driven to its value in the middle of the time until the next sample."""
        position, sim = self.position, self.sim
        middle = sim.time - position.since + 0.5 * (position.next_sample - sim.step) * sim.dt
        for name in changing:
            change = stage.drives[name]
            value = change.to if change.within == 0.0 == change.amplitude else change.at(middle, position.before[name])
            self.drives.set(name, value, position.thickness)

    def _to_next_row(self, stage: Stage, pending: signals.Pending) -> bool:
        """Sample until a row is complete and record it; returns whether the stage has ended with it."""
        position = self.position
        while position.samples < stage.spacing.samples:
            self._advance(pending)
            self.layer.sample()
            position.samples += 1
            full = position.samples == stage.spacing.samples
            # What changed at the sample before has to reach the end of its change.
            last = self.sim.time - position.since - stage.spacing.sample_steps(position.rows) * self.sim.dt
            position.next_sample += stage.spacing.sample_steps(position.rows + full)
            self._drive(stage, [name for name, change in stage.drives.items() if change.changes_at(last)])
        row = self.recorder.row()
        position.samples, position.rows = 0, position.rows + 1
        ended = stage.until.met(self.layer, row, position.memory)
        self._record_moments(stage, row)
        self._time()
        self.report(stage, row)
        return ended

    def _record_moments(self, stage: Stage, row: Mapping[str, Any]) -> None:
        """Write the grains and their contacts, if this row is one of their moments."""
        marks = self.position.marks
        event = (stage.snapshots.events or stage.contacts.events) and stage.events.changed(row, marks)
        if stage.snapshots.due("snapshots", row, event, marks):
            self.recorder.snapshot()
        if stage.contacts.due("contacts", row, event, marks):
            self.recorder.moment()

    def _advance(self, pending: signals.Pending) -> None:
        """Run to the next sample; a checkpoint is written, and a signal obeyed, wherever this finds it due."""
        sim = self.sim
        while True:
            if pending.signum is not None:
                self.keep_checkpoint()
                pending.deliver()
            if time.perf_counter() - self._kept >= self._interval:
                self.keep_checkpoint()
            steps = min(self._piece, self.position.next_sample - sim.step)
            if steps <= 0:
                return
            began = time.perf_counter()
            sim.run(steps)
            per_step = (time.perf_counter() - began) / steps
            self._piece = max(1, int(min(PIECE_S / per_step, LARGEST_PIECE)))

    def _time(self) -> None:
        """Measure the speed of the stage."""
        now = time.perf_counter(), self.sim.step
        self._first = self._first or now
        seconds, steps = now[0] - self._first[0], now[1] - self._first[1]
        self._rate = steps * len(self.sim) / seconds if steps else self._rate

    def _end(self, stage: Stage) -> None:
        """Go to the next stage, with what the files have at its end, and a checkpoint if the end is kept."""
        position, recorder = self.position, self.recorder
        position.ended = None
        ended = {"position": position.as_plain(), "snapshots": recorder.snapshots, "moments": recorder.moments}
        kept = stage.kept or position.stage + 1 == len(self.schedule)
        if (kept or stage.snapshots.at_end) and recorder.grains.last_time < self.sim.time:
            recorder.snapshot()
        if stage.contacts.at_end:
            recorder.moment()
        self.position = Position(
            position.stage + 1,
            thickness=position.thickness,
            shear_since=position.shear_since,
            marks=position.marks,
            ended=ended,
        )
        if kept:
            self.keep_checkpoint()
