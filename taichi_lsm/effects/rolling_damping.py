"""Damping of the relative rotation of two grains: the dashpot of their contact, spread over its footprint."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, SceneFacts, finite, require
from .restitution import damping_ratio_of
from .tangential_spring import limited, remember

# Lever of the pressure of half of a footprint about its middle, over a: a parabola in 2D, a paraboloid in 3D.
LEVER = {2: 3.0 / 8.0, 3: 16.0 / (15.0 * np.pi)}


@ti.data_oriented
@dataclass
class RollingDamping(Effect):
    """Damping of rolling and pivoting, M = -c <(omega x r)^2>/omega over the footprint, |M| <= 3/8 a F_n.

    Two grains that touch overlap over a width 2 a, a = sqrt(2 R d), R the reduced radius of their curvatures. With the
    dashpot c of `ViscousDamping` spread evenly over it, a rotation omega of one surface against the other meets

        M = -c a^2/3 omega                       in 2D, over a strip,
        M = -c a^2/4 (omega + (omega.n) n)       in 3D, over a disc: rolling, and twice as much against pivoting.

    Parameters
    ----------
    restitution
        e [1], 0.01 <= e <= 1, as of `ViscousDamping`: c = 2 zeta(e) sqrt(k m); 1 damps nothing.

    Notes
    -----
    Discs hardly feel it: their footprints are small. Grains with sides that are nearly flat come to rest by it, which
    they do not by the dashpot along the normal, for the normal velocity of a contact that rolls is zero. It slows them
    down in proportion to their angular velocity, and holds nothing at rest: see docs/flat-sides.md, which also says
    what makes a side flat.

    The overlap is taken as that of two circles or balls; of an edge R is its radius, that of its tube. The pressure
    never attracts, so that no more than that of the leading half remains: |M| <= 3/8 a F_n in 2D, 16/(15 pi) a F_n in
    3D. No energy is stored. Remembered: the moment of the last step, for the work of the dashpot with the mean of both.
    The stable step is that of the dashpots at the widest footprint, half of the bounding radius.

    References
    ----------
    As the rolling friction of viscous spheres, Brilliantov & Poeschel (1998), with a foundation of springs and dashpots
    for the elastic half-space.
    """

    restitution: float

    phase = "tangential"
    role = "rolling damping"
    needs = ("footprint", "relative_angular_velocity")
    adds_moment = True
    dissipates = True
    equation = "M = -c a^2/3 omega,  a = sqrt(2 R d),  |M| <= 3/8 a F_n,  c = 2 zeta(e) sqrt(k m)"
    units: ClassVar = {"restitution": "1"}
    history = (HistoryValue("rolling_moment", "N m", "moment of the last step, for its work", per_axis=True),)

    def __post_init__(self) -> None:
        e = self.restitution
        require(finite(e) and 0.01 <= e <= 1.0, self, "restitution", e, "between 0.01 and 1")

    def parameters(self) -> dict[str, float]:
        """Value that kernels read: c = 2 zeta [1]."""
        return {"c": 2.0 * damping_ratio_of(self.restitution)}

    def check(self, scene: SceneFacts) -> None:
        """Refuse it without an effect that repels."""
        elastic = any(e.phase == "normal" for e in scene.effects)
        require(elastic, self, "restitution", self.restitution, "listed beside an elastic effect")

    def stable_dt(self, bodies: Bodies) -> float:
        """2/(2 C c a^2/(q I)) [s] of footprints half as wide as the lightest grain: q = 3 in 2D, 2 in 3D."""
        m = bodies.least_mass
        c = self.parameters()["c"] * np.sqrt(0.5 * bodies.normal_stiffness * m)
        share = 0.25 * bodies.rotation_factor / (3.0 if bodies.dim == 2 else 2.0)  # a^2 m/(q I)
        return m / (bodies.coordination * c * share) if c > 0.0 else np.inf

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """M -= c <r^2> omega within its limit; returns its work with the mean of this moment and the last."""
        n, a, omega = contact.normal, contact.footprint, contact.relative_angular_velocity
        c = self.c_[0] * ti.sqrt(contact.stiffness * contact.mass)
        rate = (1.0 / 3.0) * omega
        if ti.static(n.n == 3):
            rate = 0.25 * (omega + omega.dot(n) * n)
        lever = ti.static(LEVER[n.n])
        moment, _ = limited(-c * a * a * rate, lever * a * contact.normal_force)
        lost = 0.0 * a
        for axis in ti.static(range(omega.n)):
            lost -= 0.5 * (history[axis] + moment[axis]) * omega[axis] * contact.dt
        contact.contact_moment += moment
        remember(history, moment)
        return lost

    @classmethod
    def cases(cls) -> list["RollingDamping"]:
        """Instances that the contract tests try."""
        return [cls(restitution=0.3), cls(restitution=0.9)]
