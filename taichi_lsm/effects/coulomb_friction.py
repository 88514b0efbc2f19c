"""Coulomb friction with an elastic spring at each contact."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, HistoryValue, require
from .tangential_spring import in_space, limited, remember, slip_of, spring_of, square_of, stable_spring_step


@ti.data_oriented
@dataclass
class CoulombFriction(Effect):
    """F_t = -k_t xi, |F_t| <= mu F_n: Cundall & Strack (1979); the friction of Eq. (10).

    coefficient mu [-] >= 0; tangential_stiffness k_t [N m-1] > 0. The spring xi [m] belongs to the pair of grains, so
    sliding over a seam between patches keeps it. It turns with the contact normal and with the mean spin about it.
    The work of slip is booked as (F_old + F_new)/2 . slip, which closes the energy budget of the leapfrog steps.

    dynamic_coefficient mu_d [-], from 0 to mu: the limit of a contact that slides, which it does from when its spring
    exceeds mu F_n until the spring stays below mu_d F_n. Without it friction has one coefficient and no such memory.
    """

    coefficient: float
    tangential_stiffness: float
    dynamic_coefficient: float | None = None

    phase = "tangential"
    role = "friction"
    dissipates = True
    equation = "F_t = -k_t xi,  |F_t| <= mu F_n"
    units = {"coefficient": "1", "tangential_stiffness": "N m-1", "dynamic_coefficient": "1"}
    history = (HistoryValue("tangential_spring", "m", "elongation of the tangential spring", per_axis=True),)

    def __post_init__(self):
        mu, k_t = self.coefficient, self.tangential_stiffness
        require(np.isfinite(mu) and mu >= 0.0, self, "coefficient", mu, ">= 0")
        require(np.isfinite(k_t) and k_t > 0.0, self, "tangential_stiffness", k_t, "> 0 N/m")
        mu_d = self.dynamic_coefficient
        self.drops = mu_d is not None
        if self.drops:
            require(0.0 <= mu_d <= mu, self, "dynamic_coefficient", mu_d, f"from 0 to coefficient, {mu:g}, or None")
            self.history = (*type(self).history, HistoryValue("slides", "1", "1 in a contact that slides, else 0"))

    @property
    def variant(self):
        return "static and dynamic" if self.drops else ""

    def parameters(self):
        values = {"mu": self.coefficient, "k_t": self.tangential_stiffness}
        return values | ({"mu_d": self.dynamic_coefficient} if self.drops else {})

    def stable_dt(self, bodies):
        """As for the normal spring, with the leverage R^2 m/I of tangential motion."""
        return stable_spring_step(self.tangential_stiffness, bodies)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        mu, k_t = self.mu_[0], self.k_t_[0]
        limit = mu / k_t * contact.normal_force  # in this order the division is made once for all contacts
        xi_old = spring_of(contact, history)
        trial = xi_old + slip_of(contact)
        if ti.static(self.drops):
            limit = self.chosen_limit(limit, trial.dot(trial), contact, history)
        xi, slides = limited(trial, limit)
        contact.sliding |= slides
        contact.tangential_force -= in_space(contact, k_t * xi)
        remember(history, xi)
        return 0.5 * k_t * (xi_old + xi).dot(trial - xi)

    @ti.func
    def chosen_limit(self, static, size2, contact, history: ti.template()):
        """Limit of the spring [m] in this step, of which size2 [m2] is the square before it; notes if it slides."""
        last = ti.static(contact.normal.n if contact.normal.n == 3 else 1)
        dynamic = self.mu_d_[0] / self.k_t_[0] * contact.normal_force
        bound = ti.select(history[last] != 0.0, dynamic, static)
        slides = size2 > bound * bound
        history[last] = ti.select(slides and contact.touching == 1, 1.0, 0.0)
        return ti.select(slides, dynamic, static)

    @ti.func
    def contact_energy(self, contact, history):
        return 0.5 * self.k_t_[0] * square_of(contact, history)

    @classmethod
    def cases(cls):
        return [
            cls(coefficient=0.5, tangential_stiffness=2.0e2),
            cls(coefficient=0.0, tangential_stiffness=1.0e3),
            cls(coefficient=0.6, tangential_stiffness=2.0e2, dynamic_coefficient=0.3),
        ]
