"""Attraction of grains that touch or are close."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, require


@ti.data_oriented
@dataclass
class Cohesion(Effect):
    """F = -f while grains touch, -f (1 - gap/h) up to the gap h: the gradient of an energy, continuous everywhere.

    pull_off_force f [N] > 0: what parts two grains, after Derjaguin, Muller & Toporov (1975) constant in the contact;
    distance h [m] > 0: of the surfaces at which attraction begins. Friction does not feel the attraction: its limit
    is mu times the repulsive force, to which a grain at rest under cohesion adds f.
    """

    pull_off_force: float
    distance: float

    phase = "cohesion"
    role = "cohesion"
    equation = "F_n = -f max(0, 1 - gap/h)"
    units = {"pull_off_force": "N", "distance": "m"}

    def __post_init__(self):
        for name, unit in (("pull_off_force", "N"), ("distance", "m")):
            value = getattr(self, name)
            require(np.isfinite(value) and value > 0.0, self, name, value, f"> 0 {unit}")

    def parameters(self):
        return {"f": self.pull_off_force, "h": self.distance}

    def reach(self):
        return self.distance

    def stable_dt(self, bodies):
        """As for a spring of stiffness f/h."""
        per_contact = self.pull_off_force / self.distance / bodies.least_mass * (1.0 + bodies.lever_factor)
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        contact.normal_force -= self.f_[0] * ti.max(0.0, 1.0 - contact.gap / self.h_[0])
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        """Zero for grains out of reach."""
        near = ti.max(0.0, 1.0 - contact.gap / self.h_[0])
        return -self.f_[0] * (contact.depth + 0.5 * self.h_[0] * near * near)

    @classmethod
    def cases(cls):
        return [cls(pull_off_force=3.0, distance=0.02)]
