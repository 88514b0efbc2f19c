"""Viscous damping along the normal, from a coefficient of restitution or a given rate."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, SceneFacts, finite, require
from .restitution import damping_ratio_of


@ti.data_oriented
@dataclass
class ViscousDamping(Effect):
    """Dashpot along the normal, F_n = max(0, F_elastic + c d'): the total normal force is never attractive.

    Give exactly one of the two parameters.

    Parameters
    ----------
    restitution
        e [1], 0.01 <= e <= 1: c = 2 zeta(e) sqrt(k m), the same restitution for every pair of masses.
    rate
        gamma [s-1] >= 0: c = gamma m, the form of many particle codes.

    Notes
    -----
    k is the stiffness of the effects that repel, m the effective mass along the normal, rotation included. No energy is
    stored; the work of the dashpot with the mean force of this step and the last is dissipated. Remembered: the force
    of the last step. The stable step is 2 m/(C c), for the dashpot acts with velocities half a step old; C contacts, c
    and m at the lightest pair of grains and the longest lever. Leapfrog with these velocities has the damping ratio
    zeta (1 + c dt/(4 m)): by restitution, c is divided by as much, so that the error is of second order in dt.

    References
    ----------
    Schwager & Poeschel (2007).
    """

    restitution: float | None = None
    rate: float | None = None

    phase = "damping"
    dissipates = True
    equation = "F_n = max(0, F_el + c d'),  c = 2 zeta(e) sqrt(k m)"
    units: ClassVar = {"restitution": "1", "rate": "s-1"}
    history = (HistoryValue("damping_force", "N", "damping force of the last step, for its work"),)

    def __post_init__(self) -> None:
        given = (self.restitution is not None) + (self.rate is not None)
        self.by_restitution = self.restitution is not None
        require(given == 1, self, "restitution, rate", (self.restitution, self.rate), "given one and only one")
        if self.by_restitution:
            e = self.restitution
            require(finite(e) and 0.01 <= e <= 1.0, self, "restitution", e, "between 0.01 and 1")
        else:
            require(finite(self.rate) and self.rate >= 0.0, self, "rate", self.rate, ">= 0 s-1")

    @property
    def variant(self) -> str:
        """Which of the two parameters is given."""
        return "" if self.by_restitution else "rate"

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: c: 2 zeta [1] by restitution, gamma [s-1] by rate."""
        return {"c": 2.0 * damping_ratio_of(self.restitution) if self.by_restitution else self.rate}

    def check(self, scene: SceneFacts) -> None:
        """Refuse damping without an effect that repels."""
        elastic = any(e.phase == "normal" for e in scene.effects)
        require(elastic, self, "restitution, rate", (self.restitution, self.rate), "listed beside an elastic effect")

    def stable_dt(self, bodies: Bodies) -> float:
        """2 m/(C c) [s], c and m at the lightest pair of grains and the longest lever."""
        m = 0.5 * bodies.least_mass / (1.0 + bodies.lever_factor)
        c = self.parameters()["c"] * (np.sqrt(bodies.normal_stiffness * m) if self.by_restitution else m)
        return 2.0 * m / (bodies.coordination * c) if c > 0.0 else np.inf

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_n += c d', no further than to F_n = 0; returns the work of the dashpot."""
        c = self.c_[0]  # becomes the dashpot's constant [kg s-1]: 2 zeta sqrt(k m) or gamma m
        if ti.static(self.by_restitution):
            c *= ti.sqrt(contact.stiffness * contact.mass)
            c *= contact.mass / (contact.mass + 0.25 * c * contact.dt)
        else:
            c *= contact.mass
        force = c * contact.approach
        if contact.touching == 0:
            force = 0.0
        force = ti.max(force, -contact.normal_force)  # the total is never attractive
        contact.normal_force += force
        # Work of the mean of the last and the present force: the trapezoidal rule, as Verlet moves the grains.
        dissipated = 0.5 * (history[0] + force) * contact.approach * contact.dt
        history[0] = force
        return dissipated

    @classmethod
    def cases(cls) -> list["ViscousDamping"]:
        """Instances that the contract tests try."""
        return [cls(restitution=0.3), cls(restitution=0.9), cls(restitution=0.01), cls(rate=40.0)]
