"""Coulomb friction with an elastic spring at each contact."""

from dataclasses import dataclass
from typing import ClassVar

from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, finite, require
from .tangential_spring import in_space, limited, remember, slip_of, spring_of, square_of, stable_spring_step


@ti.data_oriented
@dataclass
class CoulombFriction(Effect):
    """Friction with an elastic spring, F_t = -k_t xi, |F_t| <= mu F_n.

    Parameters
    ----------
    coefficient
        mu [1] >= 0.
    tangential_stiffness
        k_t [N m-1] > 0.
    dynamic_coefficient
        mu_d [1], from 0 to mu: the limit of a contact that slides, from when its spring exceeds mu F_n until the spring
        stays below mu_d F_n. None: friction has one coefficient and no such memory.

    Notes
    -----
    The spring xi [m] belongs to the pair of grains, so that sliding over a seam between patches keeps it. It turns with
    the contact normal and with the mean angular velocity about it. It stores k_t xi^2/2. The work of slip,
    (F_old + F_new)/2 . slip, is added to the dissipated energy, which closes the energy budget of the leapfrog steps.

    Remembered: the spring, and with a dynamic coefficient whether the contact slides. The stable step is that of a
    spring k_t, with the leverage R^2 m/I of tangential motion.

    References
    ----------
    Cundall & Strack (1979); the friction of Eq. (10) of Abe & Mora (2003).
    """

    coefficient: float
    tangential_stiffness: float
    dynamic_coefficient: float | None = None

    phase = "tangential"
    role = "friction"
    dissipates = True
    equation = "F_t = -k_t xi,  |F_t| <= mu F_n"
    units: ClassVar = {"coefficient": "1", "tangential_stiffness": "N m-1", "dynamic_coefficient": "1"}
    history = (HistoryValue("tangential_spring", "m", "elongation of the tangential spring", per_axis=True),)

    def __post_init__(self) -> None:
        mu, k_t = self.coefficient, self.tangential_stiffness
        require(finite(mu) and mu >= 0.0, self, "coefficient", mu, ">= 0")
        require(finite(k_t) and k_t > 0.0, self, "tangential_stiffness", k_t, "> 0 N/m")
        mu_d = self.dynamic_coefficient
        self.drops = mu_d is not None
        if self.drops:
            require(
                finite(mu_d) and 0.0 <= mu_d <= mu,
                self,
                "dynamic_coefficient",
                mu_d,
                f"from 0 to coefficient, {mu:g}, or None",
            )
            self.history = (*type(self).history, HistoryValue("slides", "1", "1 in a contact that slides, else 0"))

    @property
    def variant(self) -> str:
        """Whether the limit of a sliding contact is another one."""
        return "static and dynamic" if self.drops else ""

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: mu [1], k_t [N m-1], mu_d [1]."""
        values = {"mu": self.coefficient, "k_t": self.tangential_stiffness}
        return values | ({"mu_d": self.dynamic_coefficient} if self.drops else {})

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] of the tangential spring, see `stable_spring_step`."""
        return stable_spring_step(self.tangential_stiffness, bodies)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_t -= k_t xi, xi the spring after the slip of the step, cut to its limit; returns the work cut off."""
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
        # The slider has moved by trial - xi, under the mean of the old and the new force.
        return 0.5 * k_t * (xi_old + xi).dot(trial - xi)

    @ti.func
    def chosen_limit(self, static, size2, contact, history: ti.template()):
        """Limit of the spring [m] in this step; notes in the history whether the contact slides.

        static [m]: limit mu F_n/k_t of a contact that sticks; size2 [m2]: square of the spring before it is cut.
        """
        last = ti.static(contact.normal.n if contact.normal.n == 3 else 1)
        dynamic = self.mu_d_[0] / self.k_t_[0] * contact.normal_force
        bound = ti.select(history[last] != 0.0, dynamic, static)
        slides = size2 > bound * bound
        history[last] = ti.select(slides and contact.touching == 1, 1.0, 0.0)
        return ti.select(slides, dynamic, static)

    @ti.func
    def contact_energy(self, contact, history):
        """Energy k_t xi^2/2 [J]."""
        return 0.5 * self.k_t_[0] * square_of(contact, history)

    @classmethod
    def cases(cls) -> list["CoulombFriction"]:
        """Instances that the contract tests try."""
        return [
            cls(coefficient=0.5, tangential_stiffness=2.0e2),
            cls(coefficient=0.0, tangential_stiffness=1.0e3),
            cls(coefficient=0.6, tangential_stiffness=2.0e2, dynamic_coefficient=0.3),
        ]
