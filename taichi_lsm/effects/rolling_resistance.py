"""A contact moment against rolling, from an elastic spring with a limit."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, finite, require
from .tangential_spring import limited, remember, spring_of, square_of


@ti.data_oriented
@dataclass
class RollingResistance(Effect):
    """Resistance to rolling, M = -k_r theta, |M| <= mu_r R F_n, with 1/R = 1/R_k + 1/R_l of the equivalent radii.

    Parameters
    ----------
    coefficient
        mu_r [1] >= 0.
    stiffness
        k_r [N m rad-1] > 0.

    Warnings
    --------
    This is no substitute for shape. It lets round grains resist rolling, but gives them neither dilation nor
    interlocking, and its coefficient is not measured on real grains. Scenes do not have it unless they list it. On
    angular grains, which resist rolling by their shape, it adds to that.

    Notes
    -----
    The angle theta [rad] is that of rolling, about axes in the contact plane; rotation about the normal meets no
    resistance. It stores k_r theta^2/2; the work of the angle beyond the limit is dissipated. Remembered: the angle.
    The stable step is that of a rotational spring k_r with the least moment of inertia.

    References
    ----------
    The elastic-plastic model of Ai et al. (2011).
    """

    coefficient: float
    stiffness: float

    phase = "tangential"
    role = "rolling resistance"
    needs = ("rolling_radius", "relative_angular_velocity")
    adds_moment = True
    dissipates = True
    equation = "M = -k_r theta,  |M| <= mu_r R F_n"
    units: ClassVar = {"coefficient": "1", "stiffness": "N m rad-1"}
    history = (HistoryValue("rolling_angle", "rad", "elastic angle of rolling", per_axis=True),)

    def __post_init__(self) -> None:
        mu, k = self.coefficient, self.stiffness
        require(finite(mu) and mu >= 0.0, self, "coefficient", mu, ">= 0")
        require(finite(k) and k > 0.0, self, "stiffness", k, "> 0 N m/rad")

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: mu = mu_r [1], k = k_r [N m rad-1]."""
        return {"mu": self.coefficient, "k": self.stiffness}

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] with omega^2 = 2 C k_r/I: C contacts, I the least moment of inertia."""
        return 2.0 / np.sqrt(2.0 * bodies.coordination * self.stiffness / bodies.least_inertia)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """M -= k_r theta, theta the angle after the rolling of the step, cut to its limit; returns the work cut off."""
        k, n = self.k_[0], contact.normal
        old, rolling = spring_of(contact, history), contact.relative_angular_velocity
        if ti.static(n.n == 3):  # only rotation about axes in the contact plane is rolling
            rolling -= rolling.dot(n) * n
        trial = old + rolling * contact.dt
        angle, _ = limited(trial, self.mu_[0] / k * contact.rolling_radius * contact.normal_force)
        contact.contact_moment -= k * angle
        remember(history, angle)
        # Rolling beyond the limit is trial - angle, under the mean of the old and the new moment.
        return 0.5 * k * (old + angle).dot(trial - angle)

    @ti.func
    def contact_energy(self, contact, history):
        """Energy k_r theta^2/2 [J]."""
        return 0.5 * self.k_[0] * square_of(contact, history)

    @classmethod
    def cases(cls) -> list["RollingResistance"]:
        """Instances that the contract tests try."""
        return [cls(coefficient=0.1, stiffness=20.0), cls(coefficient=0.0, stiffness=5.0)]
