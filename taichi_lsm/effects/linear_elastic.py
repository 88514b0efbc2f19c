"""Linear elastic repulsion of the lattice solid model."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, require


@ti.data_oriented
@dataclass
class LinearElastic(Effect):
    """F_n = k d, energy k d^2/2: Eq. (24) of Abe & Mora (2003), force of Mora & Place (1994).

    stiffness k [N m-1] > 0. The law is the exact gradient of its energy whatever the shape of the grains.
    """

    stiffness: float

    phase = "normal"
    role = "elasticity"
    equation = "F_n = k d"
    units = {"stiffness": "N m-1"}

    def __post_init__(self):
        require(np.isfinite(self.stiffness) and self.stiffness > 0, self, "stiffness", self.stiffness, "> 0 N/m")

    def parameters(self):
        return {"k": self.stiffness}

    def normal_stiffness(self):
        return self.stiffness

    def stable_dt(self, bodies):
        """2/omega with omega^2 = 2 C k/m (1 + a^2 m/I): C contacts on the lightest grain and on its partner."""
        per_contact = self.stiffness / bodies.least_mass * (1.0 + bodies.lever_factor)
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        contact.normal_force += self.k_[0] * contact.depth
        contact.stiffness += self.k_[0]
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        return 0.5 * self.k_[0] * contact.depth * contact.depth

    @ti.func
    def tangent_stiffness(self, contact):
        return self.k_[0]

    @ti.func
    def onset_impulse(self, speed, acceleration, fraction, dt):
        """-k [u dt^2 zeta(-1, a) + alpha dt^3 zeta(-2, a)/2]: zeta(-1, a) = -B_2(a)/2, zeta(-2, a) = -B_3(a)/3."""
        b_2 = fraction * fraction - fraction + 1.0 / 6.0
        b_3 = fraction * (fraction * (fraction - 1.5) + 0.5)
        return self.k_[0] * dt * dt * (0.5 * speed * b_2 + acceleration * dt * b_3 / 6.0)

    @classmethod
    def cases(cls):
        return [cls(stiffness=1.0e3), cls(stiffness=2.0e7)]
