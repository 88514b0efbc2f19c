"""The run loop that every experiment on a layer shares: stages, samples, rows, snapshots, checkpoints, signals.

The bits of a run do not depend on when a checkpoint is written, nor on where it is interrupted and resumed: samples lie
at steps that the schedule fixes, and between them a simulation may run in pieces of any length.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import taichi_lsm as lsm
from workflows.common import signals
from workflows.common.stopwatch import Stopwatch
from workflows.protocol.resume import Start
from workflows.protocol.schedule import FIRST_STAGE, Position, Stage

CHECKPOINT_S = 60.0  # of wall clock between two checkpoints, or
CHECKPOINT_COST = 50.0  # times as long as one takes, if that is more
PIECE_S = 0.5  # of wall clock after which a signal is noticed
FIRST_PIECE = 2e6  # grain steps before the speed of the run is known
LARGEST_PIECE = 1_000_000  # steps

Report = Callable[[Stage, dict[str, Any]], None]  # takes the stage and the row that was recorded


class RunLoop:
    """Takes a layer through a schedule.

    Parameters
    ----------
    layer, recorder
        What is measured, and the files that it is written to.
    schedule
        The stages, in their order.
    drive
        Sets the velocity of the load point or of the platen [m s-1].
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
        layer: lsm.ShearedLayer,
        recorder: lsm.LayerRecorder,
        schedule: Sequence[Stage],
        drive: Callable[[float], None],
        report: Report,
        watch: Stopwatch,
        start: Start,
        identity: Mapping[str, Any],
        checkpoint_seconds: float | None = None,
    ) -> None:
        self.layer, self.recorder, self.sim = layer, recorder, layer.sim
        self.schedule, self.drive, self.report, self.watch = list(schedule), drive, report, watch
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
                self.recorder.row()
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
        """Set the drive of a stage, unless the run was resumed within it."""
        position, layer = self.position, self.layer
        self.recorder.begin_stage(stage.name, position.stage + 1)
        self._first = None
        if position.begun:
            return
        if stage.velocity is not None:
            if position.thickness is None:
                layer.begin_shear()
                position.thickness = layer.thickness
            self.drive(stage.velocity * (position.thickness if stage.per_thickness else 1.0))
        position.memory, position.snapshots, position.samples = stage.until.begin(layer), 0, 0
        position.next_sample, position.begun = self.sim.step + stage.sample_steps, True

    def _to_next_row(self, stage: Stage, pending: signals.Pending) -> bool:
        """Sample until a row is complete and record it; returns whether the stage has ended with it."""
        position = self.position
        while position.samples < stage.samples:
            self._advance(pending)
            self.layer.sample()
            position.samples += 1
            position.next_sample += stage.sample_steps
        row = self.recorder.row()
        position.samples = 0
        ended = stage.until.met(self.layer, row, position.memory)
        if stage.snapshot_strain and self.layer.strain >= (position.snapshots + 1) * stage.snapshot_strain:
            self.recorder.snapshot()
            position.snapshots += 1
        self._time()
        self.report(stage, row)
        return ended

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
        """Take the last snapshot of a stage, unless the state is in the file, and go to the next stage."""
        position = self.position
        position.ended = None
        ended = {"position": position.as_plain(), "snapshots": self.recorder.snapshots}
        if self.recorder.grains.last_time < self.sim.time:
            self.recorder.snapshot()
        self.position = Position(stage=position.stage + 1, thickness=position.thickness, ended=ended)
        self.keep_checkpoint()
