"""Drag on every grain, to bring a packing to rest."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, require


@ti.data_oriented
@dataclass
class GlobalDamping(Effect):
    """F = -gamma m v and M = -gamma I omega on every mobile grain: motion dies as exp(-gamma t).

    rate gamma [s-1] >= 0. It stands for no physical process and falsifies friction where inertia matters; use it to
    relax packings. The drag is taken at the mean velocity of the step, so that every rate is stable and what it
    takes from the motion is just what is booked.
    """

    rate: float

    phase = "motion"
    role = "global damping"
    dissipates = True
    equation = "F = -gamma m v,  M = -gamma I omega"
    units = {"rate": "s-1"}

    def __post_init__(self):
        require(np.isfinite(self.rate) and self.rate >= 0.0, self, "rate", self.rate, ">= 0 s-1")

    def parameters(self):
        return {"gamma": self.rate}

    @ti.func
    def on_velocity(self, before, after, dt):
        a = 0.5 * self.gamma_[0] * dt
        return (after - a * before) / (1.0 + a)

    @classmethod
    def cases(cls):
        return [cls(rate=3.0), cls(rate=0.0)]
