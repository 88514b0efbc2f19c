"""Attraction of grains that touch or are close."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.runtime import ti
from .base import Bodies, Effect, finite, require


@ti.data_oriented
@dataclass
class Cohesion(Effect):
    """Attraction, F_n = -f while grains touch and -f (1 - gap/h) up to the gap h.

    Parameters
    ----------
    pull_off_force
        f [N] > 0: what parts two grains; constant while they touch.
    distance
        h [m] > 0: distance of the surfaces at which attraction begins.

    Notes
    -----
    The force is continuous and the gradient of the energy -f (d + h/2 (1 - gap/h)^2); nothing is dissipated or
    remembered. Friction does not feel the attraction: its limit is mu times the repulsive force, to which a grain at
    rest under cohesion adds f. The stable step is that of a spring of stiffness f/h.

    References
    ----------
    After Derjaguin, Muller & Toporov (1975), whose attraction is constant in the contact.
    """

    pull_off_force: float
    distance: float

    phase = "cohesion"
    role = "cohesion"
    equation = "F_n = -f max(0, 1 - gap/h)"
    units: ClassVar = {"pull_off_force": "N", "distance": "m"}

    def __post_init__(self) -> None:
        for name, unit in (("pull_off_force", "N"), ("distance", "m")):
            value = getattr(self, name)
            require(finite(value) and value > 0.0, self, name, value, f"> 0 {unit}")

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: f [N], h [m]."""
        return {"f": self.pull_off_force, "h": self.distance}

    def reach(self) -> float:
        """The distance h [m]."""
        return self.distance

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] of a spring of stiffness f/h, as in `LinearElastic`."""
        per_contact = self.pull_off_force / self.distance / bodies.least_mass * (1.0 + bodies.lever_factor)
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_n -= f max(0, 1 - gap/h); the gap is 0 while grains touch."""
        contact.normal_force -= self.f_[0] * ti.max(0.0, 1.0 - contact.gap / self.h_[0])
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        """-f (d + h/2 (1 - gap/h)^2) [J], zero for grains out of reach."""
        near = ti.max(0.0, 1.0 - contact.gap / self.h_[0])
        return -self.f_[0] * (contact.depth + 0.5 * self.h_[0] * near * near)

    @classmethod
    def cases(cls) -> list["Cohesion"]:
        """Instances that the contract tests try."""
        return [cls(pull_off_force=3.0, distance=0.02)]
