"""Elastic bonds between grains that break for good, from which breakable aggregates are made."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from ..core.rotation import torque_of
from ..core.runtime import ti
from .base import Bodies, Effect, finite, require

LEAST_MODULUS = 0.1  # of Weibull: below, strengths scatter over more decades than numbers have


@ti.func
def bond_axis(e_k, e_l):
    """(unit vector along the bond, norm of the sum) of the axes that both grains carry: their mean direction."""
    s = e_k + e_l
    size = s.norm()
    return s / size, size


@ti.func
def half_rotation(rotation):
    """(cos(phi/2), v = 2 sin(phi/2) times the axis) of a relative rotation by phi; v has one component in 2D."""
    if ti.static(rotation.n == 2):
        half = ti.sqrt(0.5 * (1.0 + rotation[0]))
        return half, ti.Vector([rotation[1] / half])
    else:  # q and -q are the same rotation: the one by less than half a turn counts
        sign = ti.select(rotation[0] < 0.0, -1.0, 1.0)
        return sign * rotation[0], 2.0 * sign * ti.Vector([rotation[1], rotation[2], rotation[3]])


@ti.func
def bond_energy(u, rotation, e_k, e_l, stiffness):
    """Energy [J] of a bond, (k_n u_n^2 + k_s u_s^2 + k_b v_b^2 + k_t v_t^2)/2.

    u [m]: end of l less end of k, world frame, u_n along the bond and u_s across; rotation: complex number (2D) or
    quaternion (3D) of l against k since the start, by the angle phi; e_k, e_l: unit axis of the bond as each grain
    carries it, from k to l; v = 2 sin(phi/2) along the axis of the rotation, v_t along the bond (torsion) and v_b
    across (bending); stiffness: k_n, k_s [N m-1], k_b, k_t [N m].
    """
    e, _ = bond_axis(e_k, e_l)
    _, v = half_rotation(rotation)
    stretch = u.dot(e)
    twice = stiffness[1] * u.dot(u) + (stiffness[0] - stiffness[1]) * stretch * stretch + stiffness[2] * v.dot(v)
    if ti.static(u.n == 3):
        torsion = v.dot(e)
        twice += (stiffness[3] - stiffness[2]) * torsion * torsion
    return 0.5 * twice


@ti.func
def bond_reaction(u, rotation, e_k, e_l, stiffness):
    """(force on l at its end [N], moment on k, moment on l [N m]): the exact gradient of `bond_energy`.

    The force on k, at its own end, is the opposite one. With both forces at their ends the torques balance exactly,
    at any strain: the moments hold what the rotation of the bond's axis costs.
    """
    e, size = bond_axis(e_k, e_l)
    half, v = half_rotation(rotation)
    stretch = u.dot(e)
    force = -stiffness[1] * u - (stiffness[0] - stiffness[1]) * stretch * e
    along = (stiffness[0] - stiffness[1]) * stretch * u  # d energy / d axis
    h = stiffness[2] * v  # d energy / d v
    if ti.static(u.n == 3):
        torsion = (stiffness[3] - stiffness[2]) * v.dot(e)
        along += torsion * v
        h += torsion * e
    along = (along - along.dot(e) * e) / size  # the axis is a unit vector: only changes across it count
    moment_k = half * h - torque_of(e_k, along)
    moment_l = -half * h - torque_of(e_l, along)
    if ti.static(u.n == 3):
        common = 0.5 * v.cross(h)
        moment_k -= common
        moment_l -= common
    return force, moment_k, moment_l


@ti.func
def bond_loads(u, rotation, e_k, e_l, stiffness):
    """Tension, shear force [N], bending moment and torque [N m] in the middle of the bond."""
    e, _ = bond_axis(e_k, e_l)
    _, v = half_rotation(rotation)
    stretch, torsion = u.dot(e), 0.0 * u[0]
    bend = v.norm()
    if ti.static(u.n == 3):
        torsion = v.dot(e)
        bend = (v - torsion * e).norm()
    shear = (u - stretch * e).norm()
    return ti.Vector(
        [stiffness[0] * stretch, stiffness[1] * shear, stiffness[2] * bend, stiffness[3] * ti.abs(torsion)]
    )


@ti.data_oriented
@dataclass
class ElasticBrittleBond(Effect):
    """Beams between bonded grains that break at a Mohr-Coulomb limit, F_n/F_n0 + M_b/M_b0 + F_s/F_s0 + M_t/M_t0 = 1.

    Parameters
    ----------
    youngs_modulus
        E [Pa] > 0.
    poissons_ratio
        nu [1], -1 < nu <= 0.5.
    cohesion
        c [Pa] > 0; inf for bonds that never break.
    friction_angle
        phi [rad], 0 < phi < pi/2: the tensile strength is c/tan(phi).
    radius_ratio
        Radius R of a bond over the mean radius of its grains [1] > 0, unless `Scene.bond_area` gives its section.
    weibull_modulus
        m [1] >= 0.1 of the scatter of strengths from bond to bond; inf: all of one section are equally strong.
    weibull_seed
        Random seed of that scatter, a whole number >= 0.

    Notes
    -----
    The bonds are those of `Scene.bonds`, free of stress at the start; L is the distance of the centres. In 3D the
    section is a circle, A = pi R^2, I = pi R^4/4, J = 2 I; in 2D a rectangle of width 2 R and the thickness T of the
    scene, A = 2 R T, I = 2 R^3 T/3. k_n = E A/L, k_s = G A/L, k_b = E I/L, k_t = G J/L, G = E/(2 (1 + nu)).

    A bond breaks if F_n/F_n0 + M_b/M_b0 > 1 - F_s/F_s0 - M_t/M_t0, tension positive, with F_n0 = A c/tan(phi),
    F_s0 = A c, M_b0 = I/R c/tan(phi), M_t0 = J/R c: the stresses of a beam (Potyondy & Cundall 2004) taken in its
    middle. Broken bonds never heal.

    With scatter all four strengths of a bond are multiplied by one random factor s of mean 1 with the distribution of
    Weibull (1951), P(s) = 1 - exp(-(s/s_0)^m), s_0 = 1/Gamma(1 + 1/m). Its coefficient of variation is about 1.2/m for
    large m. The factors follow the bonds in their stored order.

    Forces follow from the present placement against that of the start, not from increments (as in Wang 2009), and are
    the exact gradient of the energy, see `bond_energy`. What a bond holds as it breaks is added to the dissipated
    energy, less the elastic energy of the contact that then begins between grains that overlap, which is no more
    (`FreedContacts`). The stable step is 2/omega with the bound on omega^2 that `Bodies.bond_rate` is.

    References
    ----------
    Potyondy & Cundall (2004); Wang (2009); Weibull (1951), J. Appl. Mech. 18, 293-297.
    """

    youngs_modulus: float
    poissons_ratio: float
    cohesion: float
    friction_angle: float
    radius_ratio: float = 1.0
    weibull_modulus: float = math.inf
    weibull_seed: int = 0

    phase = "bond"
    role = "bonds"
    dissipates = True
    equation = "F_n/F_n0 + M_b/M_b0 + F_s/F_s0 + M_t/M_t0 <= 1"
    units: ClassVar = {
        "youngs_modulus": "Pa",
        "poissons_ratio": "1",
        "cohesion": "Pa",
        "friction_angle": "rad",
        "radius_ratio": "1",
        "weibull_modulus": "1",
        "weibull_seed": "1",
    }

    def __post_init__(self) -> None:
        for name, unit in (("youngs_modulus", "Pa"), ("cohesion", "Pa"), ("radius_ratio", "")):
            value = getattr(self, name)
            positive = (finite(value) or (name == "cohesion" and value == np.inf)) and value > 0.0
            require(positive, self, name, value, f"> 0 {unit}".strip())
        ratio, angle = self.poissons_ratio, self.friction_angle
        require(finite(ratio) and -1.0 < ratio <= 0.5, self, "poissons_ratio", ratio, "above -1 and at most 0.5")
        modulus, seed = self.weibull_modulus, self.weibull_seed
        scatters = modulus == np.inf or (finite(modulus) and modulus >= LEAST_MODULUS)
        require(scatters, self, "weibull_modulus", modulus, f">= {LEAST_MODULUS:g}")
        whole = isinstance(seed, int | np.integer) and not isinstance(seed, bool) and seed >= 0
        require(whole, self, "weibull_seed", seed, "a whole number >= 0")
        require(finite(angle) and 0.0 < angle < 0.5 * np.pi, self, "friction_angle", angle, "between 0 and pi/2 rad")

    def bond_radius(self, radius: npt.NDArray, area: npt.NDArray | None, depth: float | None) -> npt.NDArray:
        """Radii R (m,) [m] of m bonds: of sections of this area (m,) [m2], by `radius_ratio` without them.

        radius (m,) [m]: mean of the two grains' radii; depth [m]: thickness of the scene in 2D, None in 3D.
        """
        if area is None:
            return self.radius_ratio * radius
        return np.sqrt(area / np.pi) if depth is None else area / (2.0 * depth)

    def bond_sections(self, r: npt.NDArray, depth: float | None) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray]:
        """Sections of bonds of the radii r (m,) [m] as (A [m2], I/R [m3], J/R [m3]), each (m,); depth as above."""
        if depth is None:
            return np.pi * r**2, np.pi * r**3 / 4.0, np.pi * r**3 / 2.0
        return 2.0 * r * depth, 2.0 * r**2 * depth / 3.0, np.zeros_like(r)

    def bond_stiffness(self, r: npt.NDArray, length: npt.NDArray, depth: float | None = None) -> npt.NDArray:
        """Stiffness k_n, k_s [N m-1], k_b, k_t [N m] of m bonds, as (m, 4).

        r (m,) [m]: radii of the bonds; length (m,) [m]: distance of the centres of their grains; depth [m]: thickness
        of the scene in 2D, None in 3D.
        """
        area, bending, torsion = self.bond_sections(r, depth)
        shear = self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
        k = [self.youngs_modulus * area, shear * area, self.youngs_modulus * bending * r, shear * torsion * r]
        return np.stack(k, axis=1) / length[:, None]

    def bond_strength(self, r: npt.NDArray, depth: float | None = None) -> npt.NDArray:
        """Strength F_n0, F_s0 [N], M_b0, M_t0 [N m] of m bonds, as (m, 4); arguments as of `bond_stiffness`."""
        area, bending, torsion = self.bond_sections(r, depth)
        tensile = self.cohesion / np.tan(self.friction_angle)
        torque = torsion * self.cohesion if depth is None else np.full_like(area, np.inf)  # 2D bonds have no torsion
        strength = np.stack([area * tensile, area * self.cohesion, bending * tensile, torque], axis=1)
        return strength if self.weibull_modulus == np.inf else strength * self.strength_factors(len(r))[:, None]

    def strength_factors(self, count: int) -> npt.NDArray:
        """Factors (count,) of mean 1 by which the strengths of bonds scatter, in their stored order."""
        m = self.weibull_modulus
        return np.random.default_rng(self.weibull_seed).weibull(m, count) / math.gamma(1.0 + 1.0 / m)

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s], with the bound on omega^2 that `Bodies.bond_rate` is."""
        return 2.0 / np.sqrt(bodies.bond_rate) if bodies.bond_rate > 0.0 else np.inf

    @ti.func
    def on_bond(self, u, rotation, e_k, e_l, stiffness):
        """(force on l [N], moment on k, moment on l [N m]); see `bond_reaction`."""
        return bond_reaction(u, rotation, e_k, e_l, stiffness)

    @ti.func
    def bond_energy(self, u, rotation, e_k, e_l, stiffness):
        """Energy [J]; see the function `bond_energy`."""
        return bond_energy(u, rotation, e_k, e_l, stiffness)

    @ti.func
    def bond_use(self, u, rotation, e_k, e_l, stiffness, strength):
        """Sum of the loads in the middle of the bond, each over its strength [1]."""
        return (bond_loads(u, rotation, e_k, e_l, stiffness) / strength).sum()

    @classmethod
    def cases(cls) -> list["ElasticBrittleBond"]:
        """Instances that the contract tests try."""
        return [
            cls(youngs_modulus=1.0e7, poissons_ratio=0.25, cohesion=1.0e5, friction_angle=0.6),
            cls(youngs_modulus=1.0e6, poissons_ratio=0.0, cohesion=np.inf, friction_angle=0.8, radius_ratio=0.5),
            cls(youngs_modulus=1.0e7, poissons_ratio=0.25, cohesion=1.0e5, friction_angle=0.6, weibull_modulus=4.0),
        ]
