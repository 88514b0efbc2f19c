"""Friction that depends on the rate of slip and on the state of the contact."""

from dataclasses import dataclass
from typing import ClassVar

from ..core.elementary import at_most
from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, finite, require
from .implicit_slip import slip_of_step
from .tangential_spring import in_space, remember, slip_of, spring_of, square_of, stable_spring_step

TINY = 1e-30  # [m], a spring or a limit that is none, in single precision too
INSTANT = 1e-20  # [s], in place of a step of no length


@ti.data_oriented
@dataclass
class RateAndStateFriction(Effect):
    """Rate-and-state friction, F_t = F_n a asinh(V/(2 V_0) exp((mu_0 + b ln(V_0 theta/D_c))/a)), behind a spring k_t.

    Parameters
    ----------
    reference_coefficient
        mu_0 [1] >= 0: friction in the steady state of V_0.
    direct_effect
        a [1] > 0.
    evolution_effect
        b [1] >= 0.
    slip_distance
        D_c [m] > 0.
    reference_velocity
        V_0 [m s-1] > 0.
    tangential_stiffness
        k_t [N m-1] > 0.
    evolution
        "ageing": theta' = 1 - V theta/D_c, or "slip": theta' = -(V theta/D_c) ln(V theta/D_c).

    Notes
    -----
    V is the rate at which the spring of the contact gives way, and there is no stick: a contact at rest creeps. In
    each step k_t (xi_trial - V dt) = F_n mu(V, theta(V)) is solved for V, theta at the end of the step from its exact
    evolution at constant V, by a fixed number of iterations with a bound on their error (`implicit_slip.py`). A spring
    softer than b F_n/D_c may slip unstably by itself, within a step or a few. A contact counts as sliding at V >= V_0.

    The spring stores k_t xi^2/2; the work of slip is dissipated. Remembered: the spring xi, and the state as
    ln(V_0 theta/D_c). A new contact has theta = D_c/V_0: it is in the steady state of V_0. The stable step is that of
    the spring, with the leverage R^2 m/I of tangential motion; rate and state are implicit and do not bound it.

    References
    ----------
    Dieterich (1979), Ruina (1983); regularised at rest by Rice, Lapusta & Ranjith (2001); in the lattice solid model
    Abe, Dieterich, Mora & Place (2002).
    """

    reference_coefficient: float
    direct_effect: float
    evolution_effect: float
    slip_distance: float
    reference_velocity: float
    tangential_stiffness: float
    evolution: str = "ageing"

    phase = "tangential"
    role = "friction"
    dissipates = True
    equation = "F_t = F_n a asinh(V/(2 V_0) exp((mu_0 + b ln(V_0 theta/D_c))/a))"
    units: ClassVar = {
        "reference_coefficient": "1",
        "direct_effect": "1",
        "evolution_effect": "1",
        "slip_distance": "m",
        "reference_velocity": "m s-1",
        "tangential_stiffness": "N m-1",
        "evolution": "ageing | slip",
    }
    history = (
        HistoryValue("tangential_spring", "m", "elongation of the tangential spring", per_axis=True),
        HistoryValue("state", "1", "ln(V_0 theta/D_c), zero in the steady state of V_0"),
    )

    def __post_init__(self) -> None:
        for name, unit in (
            ("direct_effect", ""),
            ("slip_distance", " m"),
            ("reference_velocity", " m/s"),
            ("tangential_stiffness", " N/m"),
        ):
            value = getattr(self, name)
            require(finite(value) and value > 0.0, self, name, value, f"> 0{unit}")
        for name in ("reference_coefficient", "evolution_effect"):
            value = getattr(self, name)
            require(finite(value) and value >= 0.0, self, name, value, ">= 0")
        require(self.evolution in ("ageing", "slip"), self, "evolution", self.evolution, "'ageing' or 'slip'")

    @property
    def variant(self) -> str:
        """The evolution of the state."""
        return self.evolution

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: mu_0, a, b [1], D_c [m], V_0 [m s-1], k_t [N m-1]."""
        return {
            "mu_0": self.reference_coefficient,
            "a": self.direct_effect,
            "b": self.evolution_effect,
            "D_c": self.slip_distance,
            "V_0": self.reference_velocity,
            "k_t": self.tangential_stiffness,
        }

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] of the tangential spring, see `stable_spring_step`."""
        return stable_spring_step(self.tangential_stiffness, bodies)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_t -= k_t xi, xi shortened by the slip V dt that solves the equation; returns the work of that slip."""
        k_t = self.k_t_[0]
        limit = self.a_[0] / k_t * contact.normal_force
        xi_old = spring_of(contact, history)
        trial = xi_old + slip_of(contact)
        last = ti.static(xi_old.n)  # the state follows the components of the spring
        size, dt = ti.max(ti.sqrt(trial.dot(trial)), TINY), ti.max(contact.dt, INSTANT)
        a, unit = self.a_[0], ti.max(limit, TINY)
        rate, r = self.V_0_[0] * dt / unit, self.V_0_[0] * dt / self.D_c_[0]
        ageing = ti.static(self.evolution == "ageing")
        q, s = size / unit, history[last]
        w, z, s_new = slip_of_step(ageing, q, rate, r, s, self.mu_0_[0] / a, self.b_[0] / a)
        xi = ti.select(limit > 0.0, at_most(z / q, 1.0), 0.0) * trial
        contact.sliding = ti.select(w >= rate, 1, 0)
        contact.tangential_force -= in_space(contact, k_t * xi)
        remember(history, xi)
        history[last] = ti.select(contact.touching == 1, s_new, 0.0)
        # The slider has moved by trial - xi, under the mean of the old and the new force.
        return 0.5 * k_t * (xi_old + xi).dot(trial - xi)

    @ti.func
    def contact_energy(self, contact, history):
        """Energy k_t xi^2/2 [J]."""
        return 0.5 * self.k_t_[0] * square_of(contact, history)

    @classmethod
    def cases(cls) -> list["RateAndStateFriction"]:
        """Instances that the contract tests try."""
        return [cls(0.6, 0.03, 0.02, 1e-2, 1e-3, 2.0e2), cls(0.4, 0.01, 0.015, 0.1, 1.0, 1.0e3, "slip")]
