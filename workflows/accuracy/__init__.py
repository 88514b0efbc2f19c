"""Choices that trade accuracy for time, and the trials that measure both.

A module of this package has functions that measure some parameters and return Trials. Each function is called in a
process of its own, and alone where costs are timed: costs are medians of processor times, measured in rotation.
Errors are relative to a closed form, or to a reference that the same call computes with the most accurate setting.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import taichi_lsm as lsm


@dataclass(frozen=True)
class Trial:
    """One measurement of one setting of a parameter.

    Attributes
    ----------
    parameter, setting
        Names.
    value
        The setting as a number on an axis.
    quantity
        Quantity that the error refers to.
    replica
        Number of the measurement.
    error
        Absolute deviation from the reference, or a standard error, in the unit of the quantity.
    cost
        Time of one core for a second of the physical time of one grain, or for a unit of strain of a layer [s].
    relative
        `cost` over that of discs at the default settings [1].
    """

    parameter: str
    setting: str
    value: float
    quantity: str
    replica: int
    error: float
    cost: float
    relative: float


def seconds_per_step(sims: dict[Any, lsm.Simulation], steps: int, turns: int) -> dict[Any, float]:
    """Median processor time [s] per grain and step of each of `sims` {name: simulation}, measured in rotation."""
    taken = {name: [] for name in sims}
    for turn in range(turns + 1):
        for name, sim in sims.items():
            began = time.process_time()
            sim.run(steps)
            if turn:  # the first one warms up
                taken[name].append((time.process_time() - began) / steps / len(sim))
    return {name: float(np.median(times)) for name, times in taken.items()}


def order(values: ArrayLike, errors: ArrayLike) -> float:
    """Order p of errors that fall as values^-p, from the slope of the logarithms."""
    return float(-np.polyfit(np.log(values), np.log(errors), 1)[0])
