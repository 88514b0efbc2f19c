"""Drag on every grain, to bring a packing to rest."""

from dataclasses import dataclass
from typing import ClassVar

from ..core.runtime import ti
from .base import Effect, finite, require


@ti.data_oriented
@dataclass
class GlobalDamping(Effect):
    """Drag on every mobile grain, F = -gamma m v and M = -gamma I omega: motion dies as exp(-gamma t).

    Parameters
    ----------
    rate
        gamma [s-1] >= 0.

    Notes
    -----
    It stands for no physical process and falsifies friction where inertia matters; use it to relax packings. The drag
    is taken at the mean velocity of the step, so that every rate is stable, and the energy that it takes from the
    motion is exactly what is added to the dissipated energy. Nothing is remembered; the step is not bounded.
    """

    rate: float

    phase = "motion"
    role = "global damping"
    dissipates = True
    equation = "F = -gamma m v,  M = -gamma I omega"
    units: ClassVar = {"rate": "s-1"}

    def __post_init__(self) -> None:
        require(finite(self.rate) and self.rate >= 0.0, self, "rate", self.rate, ">= 0 s-1")

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: gamma [s-1]."""
        return {"gamma": self.rate}

    @ti.func
    def on_velocity(self, before, after, dt):
        """Velocity v that solves v = after - gamma dt (before + v)/2: the drag at the mean velocity of the step."""
        a = 0.5 * self.gamma_[0] * dt
        return (after - a * before) / (1.0 + a)

    @classmethod
    def cases(cls) -> list["GlobalDamping"]:
        """Instances that the contract tests try."""
        return [cls(rate=3.0), cls(rate=0.0)]
