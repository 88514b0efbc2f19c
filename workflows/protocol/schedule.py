"""The schedule of an experiment: stages, each with its drive, its end and the spacing of its rows."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from workflows.protocol.conditions import Condition, Memory

FIRST_STAGE = "generate"  # of the row and the snapshot before the schedule begins


@dataclass(frozen=True)
class Stage:
    """One stage of a schedule.

    Attributes
    ----------
    name
        In files and in the progress line.
    until
        The end of the stage.
    sample_steps
        Steps from sample to sample, >= 1. Rows lie evenly in time: strain and slip at a velocity are times.
    samples
        Samples in a row of run.nc, >= 1.
    velocity
        Of the load point or the platen along the shear [m s-1], or a multiple of the thickness as shear begins [s-1]
        where `per_thickness`; None: the drive stays as it is.
    per_thickness
        See `velocity`.
    snapshot_strain
        Shear strain from snapshot to snapshot of grains.nc [1]; None: one at the end of the stage.
    """

    name: str
    until: Condition
    sample_steps: int
    samples: int
    velocity: float | None = None
    per_thickness: bool = False
    snapshot_strain: float | None = None


@dataclass
class Position:
    """Where a run stands in its schedule; with the state of grains and layer it decides all that follows.

    Attributes
    ----------
    stage
        Index of the stage; the length of the schedule at its end.
    begun
        Whether its drive is set and its memory begun.
    samples
        In the present row.
    next_sample
        Step of the next sample.
    thickness
        Of the layer as shear began [m], None before.
    snapshots
        Taken in this stage.
    memory
        Of the condition that ends the stage.
    ended
        Position at the last row of the stage before, and the snapshots in grains.nc then: a finished run whose last
        stage is made longer goes on from there.
    """

    stage: int = 0
    begun: bool = False
    samples: int = 0
    next_sample: int = 0
    thickness: float | None = None
    snapshots: int = 0
    memory: Memory = field(default_factory=dict)
    ended: dict[str, Any] | None = None

    def as_plain(self) -> dict[str, Any]:
        """All values as numbers and dicts."""
        return asdict(self)
