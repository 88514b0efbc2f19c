"""The schedule of an experiment: stages, each with its drives, its end and the spacing of its rows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from workflows.protocol.conditions import Condition, Memory
from workflows.protocol.moments import Events, Marks, Moments

NO_MOMENTS, NO_RATE = Moments(), Events(0.0)
FIRST_STAGE = "generate"  # of the row and the snapshot before the schedule begins


@dataclass(frozen=True)
class Spacing:
    """How far apart the rows of a stage are: evenly, or closer where something has changed and then ever wider.

    Attributes
    ----------
    steps
        Of the first row.
    samples
        Of a row, which lie evenly in it, >= 1.
    growth
        Steps of a row over those of the row before, >= 1.
    most
        Steps of a row at most.
    """

    steps: float
    samples: int
    growth: float = 1.0
    most: float = float("inf")

    def sample_steps(self, row: int) -> int:
        """Steps from sample to sample in the row of this number, from 0 on, >= 1."""
        steps = self.steps
        if self.growth > 1.0:
            wanted = math.log(max(1.0, self.most / steps)) / math.log(self.growth)  # rows until they are the widest
            steps = self.most if row >= wanted else steps * self.growth**row
        return max(1, round(steps / self.samples))


@dataclass(frozen=True)
class Change:
    """A value that a stage drives: from where it was to another one, along a straight line in time.

    Attributes
    ----------
    to
        The value.
    within
        Time that the change takes [s]; 0: at once.
    amplitude, period
        Share of the value by which it oscillates, and the period of that [s]; as a sine from the end of the change on.
    """

    to: float
    within: float = 0.0
    amplitude: float = 0.0
    period: float = 1.0

    def at(self, elapsed: float, before: float) -> float:
        """The value a time [s] after the stage began, before which it was `before`."""
        if elapsed < self.within:
            return before + (self.to - before) * elapsed / self.within
        wave = math.sin(2.0 * math.pi * (elapsed - self.within) / self.period)
        return self.to * (1.0 + self.amplitude * wave)

    def changes_at(self, elapsed: float) -> bool:
        """Whether the value changes at that time after the stage began."""
        return elapsed < self.within or self.amplitude != 0.0


@dataclass(frozen=True)
class Stage:
    """One stage of a schedule.

    Attributes
    ----------
    name
        In files and in the progress line.
    until
        The end of the stage.
    spacing
        Of rows and samples.
    drives
        {name of what is driven: Change}, in units of whoever sets the drives; others stay as they are. A stage with any
        is one of shear.
    cycle
        Number of the repetition that it belongs to, from 1 on; 0: of none.
    kept
        Whether its end has a snapshot in grains.nc and a checkpoint; of many short stages not every one does.
    snapshots, contacts
        Moments at which grains.nc and contacts.nc are written, besides the end of a stage that is kept, where grains.nc
        always is.
    events
        What counts as an event.
    """

    name: str
    until: Condition
    spacing: Spacing
    drives: Mapping[str, Change] = field(default_factory=dict)
    cycle: int = 0
    kept: bool = True
    snapshots: Moments = NO_MOMENTS
    contacts: Moments = NO_MOMENTS
    events: Events = NO_RATE


@dataclass
class Position:
    """Where a run stands in its schedule; with the state of grains and layer it decides all that follows.

    Attributes
    ----------
    stage
        Index of the stage; the length of the schedule at its end.
    begun
        Whether its drive is set and its memory begun.
    rows
        Of this stage.
    samples
        In the present row.
    next_sample
        Step of the next sample.
    thickness, shear_since
        Of the layer as shear began [m], and the time of that [s]; None before.
    since
        Time at which this stage began [s].
    slip
        Of the layer at that time [m].
    before
        {name: value} of what this stage changes, as it was.
    marks
        What the moments of grains.nc and contacts.nc remember, from stage to stage.
    memory
        Of the condition that ends the stage.
    ended
        Position at the last row of the stage before, and what was in grains.nc and contacts.nc then: a finished run
        whose last stage is made longer goes on from there.
    """

    stage: int = 0
    begun: bool = False
    rows: int = 0
    samples: int = 0
    next_sample: int = 0
    thickness: float | None = None
    shear_since: float | None = None
    since: float = 0.0
    slip: float = 0.0
    before: dict[str, float] = field(default_factory=dict)
    marks: Marks = field(default_factory=dict)
    memory: Memory = field(default_factory=dict)
    ended: dict[str, Any] | None = None

    def as_plain(self) -> dict[str, Any]:
        """All values as numbers and dicts."""
        return asdict(self)
