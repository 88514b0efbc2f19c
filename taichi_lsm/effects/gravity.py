"""Uniform gravity."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.runtime import ti
from .base import Effect, SceneFacts, finite, require


@ti.data_oriented
@dataclass
class Gravity(Effect):
    """Uniform gravity, F = m g on every mobile grain, with the potential energy -m g . x.

    Parameters
    ----------
    acceleration
        g [m s-2], world frame: one component per axis, such as (0, -9.81) in 2D.

    Notes
    -----
    Conservative: nothing is dissipated or remembered, and the step is not bounded. The energy is zero at the origin.
    """

    acceleration: tuple[float, ...]

    phase = "body"
    equation = "F = m g"
    units: ClassVar = {"acceleration": "m s-2"}

    def __post_init__(self) -> None:
        g = self.acceleration
        vector = isinstance(g, tuple | list | np.ndarray) and len(g) in (2, 3) and all(finite(a) for a in g)
        require(vector, self, "acceleration", g, "2 or 3 numbers")

    def parameters(self) -> dict[str, tuple[float, ...]]:
        """Values that kernels read: g [m s-2]."""
        return {"g": self.acceleration}

    def check(self, scene: SceneFacts) -> None:
        """Refuse another number of components than the scene has axes."""
        require(len(self.acceleration) == scene.dim, self, "acceleration", self.acceleration, f"{scene.dim} numbers")

    @ti.func
    def on_grain(self, inverse_mass, force: ti.template()):
        """F += m g."""
        for axis in ti.static(range(force.n)):
            force[axis] += self.g_[axis] / inverse_mass

    @ti.func
    def grain_energy(self, inverse_mass, position):
        """-m g . x [J]."""
        energy = 0.0 * position[0]
        for axis in ti.static(range(position.n)):
            energy -= self.g_[axis] * position[axis] / inverse_mass
        return energy

    @classmethod
    def cases(cls) -> list["Gravity"]:
        """Instances that the contract tests try."""
        return [cls(acceleration=(0.0, -9.81)), cls(acceleration=(0.0, 0.0, -9.81))]
