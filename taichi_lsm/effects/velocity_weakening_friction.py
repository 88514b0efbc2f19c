"""Friction that weakens with the velocity of slip."""

from dataclasses import dataclass
from typing import ClassVar

from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, finite, require
from .tangential_spring import in_space, limited, remember, slip_of, spring_of, square_of, stable_spring_step


@ti.data_oriented
@dataclass
class VelocityWeakeningFriction(Effect):
    """Friction that weakens with slip velocity, |F_t| <= mu(V) F_n, mu(V) = mu_d + (mu_s - mu_d)/(1 + V/V_c).

    Parameters
    ----------
    static_coefficient
        mu_s [1] >= mu_d.
    dynamic_coefficient
        mu_d [1] >= 0.
    critical_velocity
        V_c [m s-1] > 0: where mu is half way down from mu_s to mu_d.
    tangential_stiffness
        k_t [N m-1] > 0 of the spring xi, F_t = -k_t xi.

    Notes
    -----
    V [m s-1] is the speed at which the surfaces of the two grains pass each other, as in Mora & Place (1994); the
    inertia of the grains bounds its changes. The rate at which the spring gives way is no substitute: a spring without
    mass on a surface that weakens with this rate has no steady slip, however stiff it is.

    Energy, dissipation, history (the spring) and stable step are those of `CoulombFriction`.

    References
    ----------
    With mu_d = 0 the friction law of Carlson & Langer (1989), alpha = 1/(2 V_c), which the lattice solid model uses
    (Mora & Place 1994).
    """

    static_coefficient: float
    dynamic_coefficient: float
    critical_velocity: float
    tangential_stiffness: float

    phase = "tangential"
    role = "friction"
    dissipates = True
    equation = "F_t = -k_t xi,  |F_t| <= mu(V) F_n,  mu(V) = mu_d + (mu_s - mu_d)/(1 + V/V_c)"
    units: ClassVar = {
        "static_coefficient": "1",
        "dynamic_coefficient": "1",
        "critical_velocity": "m s-1",
        "tangential_stiffness": "N m-1",
    }
    history = (HistoryValue("tangential_spring", "m", "elongation of the tangential spring", per_axis=True),)

    def __post_init__(self) -> None:
        mu_s, mu_d = self.static_coefficient, self.dynamic_coefficient
        require(finite(mu_s) and mu_s >= 0.0, self, "static_coefficient", mu_s, ">= 0")
        require(
            finite(mu_d) and 0.0 <= mu_d <= mu_s,
            self,
            "dynamic_coefficient",
            mu_d,
            f"from 0 to static_coefficient, {mu_s:g}",
        )
        for name, unit in (("critical_velocity", "m/s"), ("tangential_stiffness", "N/m")):
            value = getattr(self, name)
            require(finite(value) and value > 0.0, self, name, value, f"> 0 {unit}")

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: mu_s, mu_d [1], V_c [m s-1], k_t [N m-1]."""
        return {
            "mu_s": self.static_coefficient,
            "mu_d": self.dynamic_coefficient,
            "V_c": self.critical_velocity,
            "k_t": self.tangential_stiffness,
        }

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] of the tangential spring, see `stable_spring_step`."""
        return stable_spring_step(self.tangential_stiffness, bodies)

    @ti.func
    def coefficient(self, speed):
        """mu(V) [1] at the speed V [m s-1]."""
        return self.mu_d_[0] + (self.mu_s_[0] - self.mu_d_[0]) * self.V_c_[0] / (self.V_c_[0] + speed)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_t -= k_t xi, xi the spring after the slip of the step, cut to its limit; returns the work cut off."""
        k_t = self.k_t_[0]
        limit = self.coefficient(ti.sqrt(contact.slip.dot(contact.slip))) / k_t * contact.normal_force
        xi_old = spring_of(contact, history)
        trial = xi_old + slip_of(contact)
        xi, slides = limited(trial, limit)
        contact.sliding |= slides
        contact.tangential_force -= in_space(contact, k_t * xi)
        remember(history, xi)
        # The slider has moved by trial - xi, under the mean of the old and the new force.
        return 0.5 * k_t * (xi_old + xi).dot(trial - xi)

    @ti.func
    def contact_energy(self, contact, history):
        """Energy k_t xi^2/2 [J]."""
        return 0.5 * self.k_t_[0] * square_of(contact, history)

    @classmethod
    def cases(cls) -> list["VelocityWeakeningFriction"]:
        """Instances that the contract tests try."""
        return [
            cls(static_coefficient=0.7, dynamic_coefficient=0.2, critical_velocity=0.05, tangential_stiffness=2.0e2),
            cls(static_coefficient=0.5, dynamic_coefficient=0.5, critical_velocity=1.0, tangential_stiffness=1.0e3),
        ]
