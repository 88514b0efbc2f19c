"""Viscous damping along the normal, from a coefficient of restitution or a given rate."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, HistoryValue, require


def restitution_of(zeta):
    """Restitution e of a linear spring with dashpot whose total force is never attractive.

    zeta = c/(2 sqrt(k m)) > 0. The contact ends when k d + c d' = 0, Schwager & Poeschel (2007), Eq. (21).
    """
    if zeta == 0.0:
        return 1.0
    if zeta < 1.0:
        omega = np.sqrt(1.0 - zeta * zeta)
        angle = np.pi - np.arctan2(2.0 * zeta * omega, 1.0 - 2.0 * zeta * zeta)
        return float(np.exp(-zeta / omega * angle))
    if zeta == 1.0:
        return float(np.exp(-2.0))
    omega = np.sqrt(zeta * zeta - 1.0)
    return float(np.exp(-zeta / omega * np.log((zeta + omega) / (zeta - omega))))


def damping_ratio_of(restitution):
    """zeta = c/(2 sqrt(k m)) that gives this restitution; 0.01 <= restitution <= 1. By bisection."""
    if restitution == 1.0:
        return 0.0
    low, high = 0.0, 1.0e3
    middle = 0.5 * (low + high)
    while low < middle < high:
        low, high = (middle, high) if restitution_of(middle) > restitution else (low, middle)
        middle = 0.5 * (low + high)
    return middle


@ti.data_oriented
@dataclass
class ViscousDamping(Effect):
    """F_d = c d', with the total normal force never attractive: F_n = max(0, F_elastic + c d').

    Give exactly one of
    restitution e [-], 0.01 <= e <= 1: c = 2 zeta sqrt(k m), the same restitution for every pair of masses m;
    rate gamma [s-1] >= 0: c = gamma m, the form of many particle codes.
    k is the stiffness of the normal laws listed before; m the reduced mass.
    """

    restitution: float | None = None
    rate: float | None = None

    phase = "damping"
    dissipates = True
    equation = "F_n = max(0, F_el + c d'),  c = 2 zeta(e) sqrt(k m)"
    units = {"restitution": "1", "rate": "s-1"}
    history = (HistoryValue("damping_force", "N", "damping force of the last step, for its work"),)

    def __post_init__(self):
        given = (self.restitution is not None) + (self.rate is not None)
        self.by_restitution = self.restitution is not None
        require(given == 1, self, "restitution, rate", (self.restitution, self.rate), "given one and only one")
        if self.by_restitution:
            e = self.restitution
            require(np.isfinite(e) and 0.01 <= e <= 1.0, self, "restitution", e, "between 0.01 and 1")
        else:
            require(np.isfinite(self.rate) and self.rate >= 0.0, self, "rate", self.rate, ">= 0 s-1")

    @property
    def variant(self):
        return "" if self.by_restitution else "rate"

    def parameters(self):
        return {"c": 2.0 * damping_ratio_of(self.restitution) if self.by_restitution else self.rate}

    def check(self, scene):
        elastic = any(e.phase == "normal" for e in scene.effects)
        require(elastic, self, "restitution, rate", (self.restitution, self.rate), "listed beside a normal law")

    def stable_dt(self, bodies):
        """Explicit damping with velocities half a step old: dt <= 2 m/(C c), c at the lightest pair of grains."""
        m = 0.5 * bodies.least_mass
        c = self.parameters()["c"] * (np.sqrt(bodies.normal_stiffness * m) if self.by_restitution else m)
        return 2.0 * m / (bodies.coordination * c) if c > 0.0 else np.inf

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        c = self.c_[0]
        if ti.static(self.by_restitution):
            c *= ti.sqrt(contact.stiffness * contact.mass)
        else:
            c *= contact.mass
        force = c * contact.approach
        if contact.touching == 0:
            force = 0.0
        force = ti.max(force, -contact.normal_force)
        contact.normal_force += force
        dissipated = 0.5 * (history[0] + force) * contact.approach * contact.dt
        history[0] = force
        return dissipated

    @classmethod
    def cases(cls):
        return [cls(restitution=0.3), cls(restitution=0.9), cls(restitution=0.01), cls(rate=40.0)]
