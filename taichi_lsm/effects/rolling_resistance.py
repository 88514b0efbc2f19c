"""A couple against rolling, from an elastic spring with a limit."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, HistoryValue, require
from .tangential_spring import limited, remember, spring_of, square_of


@ti.data_oriented
@dataclass
class RollingResistance(Effect):
    """M = -k_r theta, |M| <= mu_r R F_n, with 1/R = 1/R_k + 1/R_l: the elastic-plastic model of Ai et al. (2011).

    WARNING: this is no substitute for shape. It lets round grains resist rolling, but gives them neither dilation nor
    interlocking, and its coefficient is not measured on real grains. Scenes do not have it unless they list it.
    coefficient mu_r [-] >= 0; stiffness k_r [N m rad-1] > 0. The angle theta [rad] is that of rolling, about axes in
    the contact plane; turns about the normal meet no resistance.
    """

    coefficient: float
    stiffness: float

    phase = "tangential"
    role = "rolling resistance"
    needs = ("reduced_radius", "relative_angular_velocity")
    adds_moment = True
    dissipates = True
    equation = "M = -k_r theta,  |M| <= mu_r R F_n"
    units = {"coefficient": "1", "stiffness": "N m rad-1"}
    history = (HistoryValue("rolling_angle", "rad", "elastic angle of rolling", per_axis=True),)

    def __post_init__(self):
        mu, k = self.coefficient, self.stiffness
        require(np.isfinite(mu) and mu >= 0.0, self, "coefficient", mu, ">= 0")
        require(np.isfinite(k) and k > 0.0, self, "stiffness", k, "> 0 N m/rad")

    def parameters(self):
        return {"mu": self.coefficient, "k": self.stiffness}

    def stable_dt(self, bodies):
        """As for the normal spring, with the least moment of inertia."""
        return 2.0 / np.sqrt(2.0 * bodies.coordination * self.stiffness / bodies.least_inertia)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        k, n = self.k_[0], contact.normal
        old, rolling = spring_of(contact, history), contact.relative_angular_velocity
        if ti.static(n.n == 3):
            rolling -= rolling.dot(n) * n
        trial = old + rolling * contact.dt
        angle, _ = limited(trial, self.mu_[0] / k * contact.reduced_radius * contact.normal_force)
        contact.contact_moment -= k * angle
        remember(history, angle)
        return 0.5 * k * (old + angle).dot(trial - angle)

    @ti.func
    def contact_energy(self, contact, history):
        return 0.5 * self.k_[0] * square_of(contact, history)

    @classmethod
    def cases(cls):
        return [cls(coefficient=0.1, stiffness=20.0), cls(coefficient=0.0, stiffness=5.0)]
