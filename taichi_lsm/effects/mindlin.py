"""Friction of Hertz contacts with partial slip and its hysteresis, after Mindlin and Deresiewicz."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.elementary import at_least, at_most, cube_root
from ..core.runtime import ti
from .base import Bodies, Effect, HistoryValue, SceneFacts, check_elastic_constants, finite, require
from .tangential_spring import transported

TINY = 1.0e-30  # keeps quotients finite where a force or a length is zero
FULL = 1.0 - 1.0e-6  # of the limit: from here on a contact counts as sliding


@ti.func
def length_of(v):
    """Length of a tangential vector, of one component in 2D."""
    if ti.static(v.n == 1):
        return ti.abs(v[0])
    else:
        return ti.sqrt(v.dot(v))


@ti.func
def cut(v, most):
    """(vector v, no longer than `most`; its length)."""
    length = length_of(v)
    return v * at_most(most / at_least(length, TINY), 1.0), at_most(length, most)


@ti.func
def loaded(y):
    """Force over its limit in a displacement y, over the one at which all of the contact slips: 1 - (1 - |y|)^1.5.

    Written so that nothing cancels: with s = sqrt(1 - |y|) it is |y| (1 + s + s^2)/(1 + s); beyond |y| = 1 it is 1.
    """
    length = length_of(y)
    stuck = ti.sqrt(at_least(1.0 - length, 0.0))
    return y * ((1.0 + stuck + stuck * stuck) / ((1.0 + stuck) * at_least(length, 1.0)))


@ti.func
def displaced(f, length):
    """The inverse of `loaded`: with p = (1 - |f|)^(1/3), the stuck part of the radius, |f| (1 + p)/(1 + p + p^2).

    length: |f|.
    """
    p = cube_root(at_least(1.0 - length, 0.0))
    return f * ((1.0 + p) / (1.0 + p + p * p))


@ti.data_oriented
@dataclass
class Mindlin(Effect):
    """Friction with partial slip, dF_t = k_t (1 - |F_t - F_0|/(c mu F_n))^(1/3) du, |F_t| <= mu F_n.

    Parameters
    ----------
    coefficient
        mu [1] >= 0.
    youngs_modulus
        E [Pa] > 0, that of `Hertz`, which the scene must list.
    poissons_ratio
        nu [1], -1 < nu <= 0.5, that of `Hertz`.

    Notes
    -----
    k_t = 8 G* a, a = sqrt(R d), G* = E/(4 (1 + nu) (2 - nu)), with R and the walls of `Hertz`. Slip begins at the rim
    of the contact and softens it: F_0 = 0 and c = 1 at first, then the force at the last turning point and c = 2. The
    two outer turning points are remembered; a loop within the inner loop goes back the way it came and has no
    hysteresis.

    Exact for any slip along one line at constant F_n, with one loop inside another, and in full sliding. Otherwise an
    approximation: in 3D the curve is followed radially from F_0; if F_n grows the new contact area carries no force
    yet, if it falls the force falls with k_t, so that no cycle yields energy. An elastic oblique impact that sticks
    in part leaves a surface velocity up to 0.22 mu v_n (of 1.8 mu v_n at most) short of the exact recoil.

    The energy stored is taken as F_t^2/(2 k_t). What partial slip locks in besides is added to the dissipated energy
    and comes back in unloading, where that energy may fall for a while. Remembered: the force, both turning points and
    the root of the compliance. The stable step is that of Hertz with k_t and the leverage R^2 m/I of tangential motion.

    References
    ----------
    Mindlin & Deresiewicz (1953).
    """

    coefficient: float
    youngs_modulus: float
    poissons_ratio: float

    phase = "tangential"
    role = "friction"
    needs = ("reduced_radius",)
    dissipates = True
    equation = "dF_t = k_t (1 - |F_t - F_0|/(c mu F_n))^(1/3) du,  |F_t| <= mu F_n"
    units: ClassVar = {"coefficient": "1", "youngs_modulus": "Pa", "poissons_ratio": "1"}
    history = (
        HistoryValue("mindlin_force", "N", "tangential force of the last step", per_axis=True),
        HistoryValue("first_turning_point", "N", "force at which loading ended, zero before", per_axis=True),
        HistoryValue("second_turning_point", "N", "force at which unloading ended, zero before", per_axis=True),
        HistoryValue("root_compliance", "m0.5 N-0.5", "root of the tangential compliance of the last step"),
    )

    def __post_init__(self) -> None:
        mu = self.coefficient
        require(finite(mu) and mu >= 0.0, self, "coefficient", mu, ">= 0")
        check_elastic_constants(self)

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: mu [1], g = 8 G* [Pa]."""
        return {"mu": self.coefficient, "g": self.stiffness_per_contact_radius()}

    def stiffness_per_contact_radius(self) -> float:
        """8 G* [Pa]."""
        nu = self.poissons_ratio
        return 2.0 * self.youngs_modulus / ((1.0 + nu) * (2.0 - nu))

    def check(self, scene: SceneFacts) -> None:
        """Refuse a scene without Hertz, or with one of other elastic constants."""
        mine = (self.youngs_modulus, self.poissons_ratio)
        found = [(e.youngs_modulus, e.poissons_ratio) for e in scene.effects if e.name == "hertz"]
        there = f"those of Hertz in the scene, {found[0]}" if found else "those of Hertz, which the scene must list too"
        require(found == [mine], self, "youngs_modulus, poissons_ratio", mine, there)

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] with k_t at a depth of a tenth of the grain, as in `Hertz`."""
        per_contact = (
            self.stiffness_per_contact_radius() * bodies.contact_radius_per_mass * (1.0 + bodies.rotation_factor)
        )
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_t is moved along the curve of the present loop by the slip of the step; returns work less stored energy."""
        n = contact.normal
        axes = ti.static(1 if n.n == 2 else 3)
        k = self.g_[0] * ti.sqrt(contact.reduced_radius * contact.depth)
        limit = self.mu_[0] * at_least(contact.normal_force, 0.0)
        f_old, first, second = self.remembered(history, 0), self.remembered(history, 1), self.remembered(history, 2)
        stored = self.contact_energy(contact, history)
        step = f_old
        if ti.static(axes == 1):  # along t = n turned by 90 degrees vectors turn with the contact by themselves
            step[0] = (n[0] * contact.slip[1] - n[1] * contact.slip[0]) * contact.dt
        else:
            step = contact.slip * contact.dt
            f_old = transported(f_old, n, contact)
            first, second = transported(first, n, contact), transported(second, n, contact)
        # Where the contact area has shrunk, the force falls with k_t; growth leaves it, and the limit cuts all three.
        compliance = history[3 * axes] * history[3 * axes]
        fall = ti.select(compliance > 0.0, at_most(k * compliance, 1.0), 1.0)
        f, f_length = cut(fall * f_old, limit)
        first, first_length = cut(fall * first, limit)
        second, second_length = cut(fall * second, limit)
        # 0: first loading, 1: on the way back from the first turning point, 2: from the second towards the first
        on_0 = first_length <= 0.0
        on_2 = (first_length > 0.0) & (second_length > 0.0)
        # A slip against the present direction of loading is a new turning point; the third and later ones are not kept.
        turns = (step.dot(f - ti.select(on_2, second, first)) < 0.0) & (on_2 == 0)
        second = ti.select(turns & (on_0 == 0), f, second)
        first, first_length = ti.select(turns & on_0, f, first), ti.select(turns & on_0, f_length, first_length)
        on_2, on_0 = on_2 | (turns & (on_0 == 0)), on_0 & (turns == 0)
        # Along the curve of the level: displacement y of the force from its origin, both over those of full slip.
        origin = ti.select(on_2, second, first)
        per_limit = 1.0 / at_least(limit, TINY)
        size, per_size = ti.select(on_0, limit, 2.0 * limit), ti.select(on_0, per_limit, 0.5 * per_limit)
        from_origin = (f - origin) * per_size
        y_old = displaced(from_origin, length_of(from_origin))
        y = y_old + step * (k * per_size / 1.5)
        # Back beyond the second turning point the loop is closed: the rest of the step is on level 1.
        closes = on_2 & (y.dot(y_old) < 0.0)
        between = (second - first) * per_size
        y = ti.select(closes, y + displaced(between, length_of(between)), y)
        origin, second = ti.select(closes, first, origin), ti.select(closes, 0.0 * second, second)
        f = origin + size * loaded(y)
        # Beyond the first turning point the outer loop is closed: the rest of the step is first loading again.
        leaves = (on_0 == 0) & (length_of(f) >= first_length)
        at_first, at_length = cut(f, first_length)
        from_origin = (at_first - origin) * per_size
        rest = 2.0 * (y - displaced(from_origin, length_of(from_origin)))
        outer = displaced(at_first * per_limit, at_length * per_limit) + rest
        f = ti.select(leaves, limit * loaded(outer), f)
        first, second = ti.select(leaves, 0.0 * first, first), ti.select(leaves, 0.0 * second, second)
        f_length = length_of(f)
        contact.sliding |= ti.cast(f_length >= FULL * limit, ti.i32)
        if ti.static(axes == 1):
            contact.tangential_force -= f[0] * ti.Vector([-n[1], n[0]])
        else:
            contact.tangential_force -= f
        for axis in ti.static(range(axes)):
            history[axis], history[axes + axis], history[2 * axes + axis] = f[axis], first[axis], second[axis]
        history[3 * axes] = ti.select(k > 0.0, 1.0 / ti.sqrt(at_least(k, TINY)), 0.0)
        return 0.5 * (f_old + f).dot(step) + stored - self.contact_energy(contact, history)

    @ti.func
    def remembered(self, history, which: ti.template()):
        """Tangential vector number `which` of the history."""
        axes = ti.static(history.n // 3)
        return ti.Vector([history[which * axes + axis] for axis in range(axes)])

    @ti.func
    def contact_energy(self, contact, history):
        """Energy F_t^2/(2 k_t) [J]."""
        axes = ti.static(1 if contact.normal.n == 2 else 3)
        f = self.remembered(history, 0)
        return 0.5 * f.dot(f) * history[3 * axes] * history[3 * axes]

    @classmethod
    def cases(cls) -> list["Mindlin"]:
        """Instances that the contract tests try."""
        return [
            cls(coefficient=0.5, youngs_modulus=1.0e3, poissons_ratio=0.3),
            cls(coefficient=0.0, youngs_modulus=1.0e4, poissons_ratio=0.0),
        ]
