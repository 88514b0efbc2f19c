"""Elastic bonds between grains that break for good, from which breakable aggregates are made."""

from dataclasses import dataclass

import numpy as np

from ..core.rotation import torque_of
from ..core.runtime import ti
from .base import Effect, require


@ti.func
def bond_axis(e_k, e_l):
    """(unit vector along the bond, norm of the sum): the mean of the axes that both grains carry."""
    s = e_k + e_l
    size = s.norm()
    return s / size, size


@ti.func
def bond_turn(turn):
    """(cos(phi/2), 2 sin(phi/2) times the axis of the turn) of a relative turn by phi; one component in 2D."""
    if ti.static(turn.n == 2):
        half = ti.sqrt(0.5 * (1.0 + turn[0]))
        return half, ti.Vector([turn[1] / half])
    else:
        sign = ti.select(turn[0] < 0.0, -1.0, 1.0)
        return sign * turn[0], 2.0 * sign * ti.Vector([turn[1], turn[2], turn[3]])


@ti.func
def bond_energy(u, turn, e_k, e_l, stiffness):
    """Energy [J] of a bond, half of k_n u_n^2 + k_s u_s^2 + k_b v_b^2 + k_t v_t^2, whose ends are u and `turn` apart.

    u [m]: end of l less end of k; turn: complex number (2D) or quaternion (3D) of l against k; e_k, e_l: unit axis of
    the bond as each grain carries it, from k to l; v = 2 sin(phi/2) along the axis of the turn; stiffness: k_n, k_s
    [N m-1], k_b, k_t [N m].
    """
    e, _ = bond_axis(e_k, e_l)
    _, v = bond_turn(turn)
    stretch = u.dot(e)
    twice = stiffness[1] * u.dot(u) + (stiffness[0] - stiffness[1]) * stretch * stretch + stiffness[2] * v.dot(v)
    if ti.static(u.n == 3):
        torsion = v.dot(e)
        twice += (stiffness[3] - stiffness[2]) * torsion * torsion
    return 0.5 * twice


@ti.func
def bond_reaction(u, turn, e_k, e_l, stiffness):
    """(force on l at its end [N], couple on k, couple on l [N m]): the exact gradient of `bond_energy`.

    The force on k, at its own end, is the opposite one. With both forces at their ends the torques balance exactly,
    at any strain: the couples hold what the turning of the axis costs.
    """
    e, size = bond_axis(e_k, e_l)
    half, v = bond_turn(turn)
    stretch = u.dot(e)
    force = -stiffness[1] * u - (stiffness[0] - stiffness[1]) * stretch * e
    along = (stiffness[0] - stiffness[1]) * stretch * u  # d energy / d axis
    h = stiffness[2] * v
    if ti.static(u.n == 3):
        torsion = (stiffness[3] - stiffness[2]) * v.dot(e)
        along += torsion * v
        h += torsion * e
    along = (along - along.dot(e) * e) / size
    couple_k = half * h - torque_of(e_k, along)
    couple_l = -half * h - torque_of(e_l, along)
    if ti.static(u.n == 3):
        turning = 0.5 * v.cross(h)
        couple_k -= turning
        couple_l -= turning
    return force, couple_k, couple_l


@ti.func
def bond_loads(u, turn, e_k, e_l, stiffness):
    """Tension, shear force [N], bending and twisting moment [N m] in the middle of the bond."""
    e, _ = bond_axis(e_k, e_l)
    _, v = bond_turn(turn)
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
    """Beams between bonded grains, `Scene.bonds`, that break at a Mohr-Coulomb limit; without stress at the start.

    youngs_modulus E [Pa]; poissons_ratio nu; cohesion c [Pa]; friction_angle phi [rad]: tensile strength c/tan(phi);
    radius_ratio: radius R of a bond over the mean radius of its grains. L is the distance of their centres. In 3D the
    section is a circle, A = pi R^2, I = pi R^4/4, J = 2 I; in 2D a rectangle of width 2 R and the thickness T of the
    scene, A = 2 R T, I = 2 R^3 T/3. k_n = E A/L, k_s = G A/L, k_b = E I/L, k_t = G J/L, G = E/(2 (1 + nu)).
    A bond breaks if F_n/F_n0 + M_b/M_b0 > 1 - F_s/F_s0 - M_t/M_t0, tension positive, with F_n0 = A c/tan(phi),
    F_s0 = A c, M_b0 = I/R c/tan(phi), M_t0 = J/R c: the stresses of a beam (Potyondy & Cundall 2004) taken in its
    middle. Forces follow from the present placement against that of the start, not from increments (as in Wang 2009),
    and are the exact gradient of the energy. Broken bonds never heal; what they held is booked as dissipated, less the
    elastic energy of the contact that then begins between grains that overlap.
    """

    youngs_modulus: float
    poissons_ratio: float
    cohesion: float
    friction_angle: float
    radius_ratio: float = 1.0

    phase = "bond"
    role = "bonds"
    dissipates = True
    equation = "F_n/F_n0 + M_b/M_b0 + F_s/F_s0 + M_t/M_t0 <= 1"
    units = {
        "youngs_modulus": "Pa",
        "poissons_ratio": "1",
        "cohesion": "Pa",
        "friction_angle": "rad",
        "radius_ratio": "1",
    }

    def __post_init__(self):
        for name, unit in (("youngs_modulus", "Pa"), ("cohesion", "Pa"), ("radius_ratio", "")):
            value = getattr(self, name)
            positive = value > 0.0 and (np.isfinite(value) or name == "cohesion")
            require(positive, self, name, value, f"> 0 {unit}".strip())
        require(
            -1.0 < self.poissons_ratio <= 0.5, self, "poissons_ratio", self.poissons_ratio, "above -1 and at most 0.5"
        )
        angle = self.friction_angle
        require(0.0 < angle < 0.5 * np.pi, self, "friction_angle", angle, "between 0 and pi/2 rad")

    def bond_sections(self, radius, depth):
        """(A [m2], I/R [m3], J/R [m3]) of bonds; radius (m,) [m] is the mean of the grains', depth [m] of the scene."""
        r = self.radius_ratio * radius
        if depth is None:
            return np.pi * r**2, np.pi * r**3 / 4.0, np.pi * r**3 / 2.0
        return 2.0 * r * depth, 2.0 * r**2 * depth / 3.0, np.zeros_like(r)

    def bond_stiffness(self, radius, length, depth=None):
        """k_n, k_s [N m-1], k_b, k_t [N m] as (m, 4) of bonds of these radii and lengths [m]; depth [m]: None in 3D."""
        area, bending, torsion = self.bond_sections(radius, depth)
        r, shear = self.radius_ratio * radius, self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
        k = [self.youngs_modulus * area, shear * area, self.youngs_modulus * bending * r, shear * torsion * r]
        return np.stack(k, axis=1) / length[:, None]

    def bond_strength(self, radius, depth=None):
        """F_n0, F_s0 [N], M_b0, M_t0 [N m] as (m, 4); see `bond_stiffness`."""
        area, bending, torsion = self.bond_sections(radius, depth)
        tensile = self.cohesion / np.tan(self.friction_angle)
        twisting = torsion * self.cohesion if depth is None else np.full_like(area, np.inf)
        return np.stack([area * tensile, area * self.cohesion, bending * tensile, twisting], axis=1)

    def stable_dt(self, bodies):
        """2/omega, with the bound on omega^2 that `Bodies.bond_rate` is."""
        return 2.0 / np.sqrt(bodies.bond_rate) if bodies.bond_rate > 0.0 else np.inf

    @ti.func
    def on_bond(self, u, turn, e_k, e_l, stiffness):
        return bond_reaction(u, turn, e_k, e_l, stiffness)

    @ti.func
    def bond_energy(self, u, turn, e_k, e_l, stiffness):
        return bond_energy(u, turn, e_k, e_l, stiffness)

    @ti.func
    def bond_use(self, u, turn, e_k, e_l, stiffness, strength):
        return (bond_loads(u, turn, e_k, e_l, stiffness) / strength).sum()

    @classmethod
    def cases(cls):
        return [
            cls(youngs_modulus=1.0e7, poissons_ratio=0.25, cohesion=1.0e5, friction_angle=0.6),
            cls(youngs_modulus=1.0e6, poissons_ratio=0.0, cohesion=np.inf, friction_angle=0.8, radius_ratio=0.5),
        ]
