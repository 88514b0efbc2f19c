"""Uniform gravity."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, require


@ti.data_oriented
@dataclass
class Gravity(Effect):
    """F = m g on every mobile grain; its potential energy is -m g . x.

    acceleration g [m s-2]: one component per axis, e.g. (0, -9.81) in 2D.
    """

    acceleration: tuple[float, ...]

    phase = "body"
    equation = "F = m g"
    units = {"acceleration": "m s-2"}

    def __post_init__(self):
        g = np.asarray(self.acceleration, float)
        require(
            g.shape in ((2,), (3,)) and np.isfinite(g).all(),
            self,
            "acceleration",
            self.acceleration,
            "2 or 3 numbers",
        )

    def parameters(self):
        return {"g": self.acceleration}

    def check(self, scene):
        require(len(self.acceleration) == scene.dim, self, "acceleration", self.acceleration, f"{scene.dim} numbers")

    @ti.func
    def on_grain(self, inverse_mass, force: ti.template()):
        for axis in ti.static(range(force.n)):
            force[axis] += self.g_[axis] / inverse_mass

    @ti.func
    def grain_energy(self, inverse_mass, position):
        energy = 0.0 * position[0]
        for axis in ti.static(range(position.n)):
            energy -= self.g_[axis] * position[axis] / inverse_mass
        return energy

    @classmethod
    def cases(cls):
        return [cls(acceleration=(0.0, -9.81))]
