"""What single runs gave: the points at which a calibration knows the metrics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflows.sweep.factors import Point

ERRORS = ("_mean", "_se")  # a metric friction_mean has its standard error in friction_se


@dataclass(frozen=True)
class Sample:
    """One run.

    Attributes
    ----------
    point
        Values of the parameters that vary.
    metrics
        Value by name, as summary.json has them; {} of a run that gave none.
    note
        Why it gave none, else "".
    units
        Unit by name.
    """

    point: Point
    metrics: Mapping[str, float] = field(default_factory=dict)
    note: str = ""
    units: Mapping[str, str] = field(default_factory=dict)

    def error(self, metric: str) -> float:
        """Standard error of a metric within the run; nan if it is unknown."""
        stem, ending = metric.removesuffix(ERRORS[0]), ERRORS[1]
        return self.metrics.get(stem + ending, math.nan) if metric.endswith(ERRORS[0]) else math.nan

    def has(self, metrics: Sequence[str]) -> bool:
        """Whether the run gave all of these metrics."""
        return all(math.isfinite(self.metrics.get(name, math.nan)) for name in metrics)


def sample_of(point: Point, entries: Mapping[str, Mapping[str, Any]], note: str = "") -> Sample:
    """A sample from the metrics of a summary.json."""
    numbers = {n: float(e["value"]) for n, e in entries.items() if isinstance(e.get("value"), int | float)}
    return Sample(point, numbers, note, {name: str(entry.get("unit", "1")) for name, entry in entries.items()})


def variances_within(samples: Sequence[Sample], metric: str) -> NDArray:
    """(n,) squared standard errors of a metric within the runs; the mean of the known ones where it is unknown, or 0.

    What is unknown beyond that the emulator finds as scatter between the runs.
    """
    squares = np.square([sample.error(metric) for sample in samples])
    known = np.isfinite(squares)
    return np.where(known, squares, squares[known].mean() if known.any() else 0.0)
