"""Linear elastic repulsion of the lattice solid model."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.runtime import ti
from .base import Bodies, Effect, finite, require


@ti.data_oriented
@dataclass
class LinearElastic(Effect):
    """Linear repulsion, F_n = k d, with the energy k d^2/2.

    Parameters
    ----------
    stiffness
        k [N m-1] > 0.

    Notes
    -----
    The force is the exact gradient of its energy whatever the shape of the grains, and no energy is dissipated. Nothing
    is remembered. The stable step is 2/omega with omega^2 = 2 C k/m (1 + a^2 m/I): C contacts on the lightest grain and
    on its partner, a the lever of the surface normal.

    References
    ----------
    Abe & Mora (2003), Eq. (24); the force of Mora & Place (1994).
    """

    stiffness: float

    phase = "normal"
    role = "elasticity"
    equation = "F_n = k d"
    units: ClassVar = {"stiffness": "N m-1"}

    def __post_init__(self) -> None:
        require(finite(self.stiffness) and self.stiffness > 0.0, self, "stiffness", self.stiffness, "> 0 N/m")

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: k [N m-1]."""
        return {"k": self.stiffness}

    def normal_stiffness(self) -> float:
        """The stiffness k [N m-1]."""
        return self.stiffness

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] of C contacts on the lightest grain and on its partner; see the class."""
        per_contact = self.stiffness / bodies.least_mass * (1.0 + bodies.lever_factor)
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_n += k d; nothing is dissipated."""
        contact.normal_force += self.k_[0] * contact.depth
        contact.stiffness += self.k_[0]
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        """Energy k d^2/2 [J]."""
        return 0.5 * self.k_[0] * contact.depth * contact.depth

    @ti.func
    def onset_impulse(self, contact, speed, acceleration, fraction, dt):
        """-k (u dt^2 zeta(-1, a) + alpha dt^3 zeta(-2, a)/2) [N s] of the speed u, acceleration alpha, fraction a.

        The zeta functions are Bernoulli polynomials: zeta(-1, a) = -B_2(a)/2, zeta(-2, a) = -B_3(a)/3.
        """
        b_2 = fraction * fraction - fraction + 1.0 / 6.0
        b_3 = fraction * (fraction * (fraction - 1.5) + 0.5)
        return self.k_[0] * dt * dt * (0.5 * speed * b_2 + acceleration * dt * b_3 / 6.0)

    @classmethod
    def cases(cls) -> list["LinearElastic"]:
        """Instances that the contract tests try."""
        return [cls(stiffness=1.0e3), cls(stiffness=2.0e7)]
