"""Hertz's repulsion, on grains of any shape."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..core.hurwitz_zeta import hurwitz_zeta
from ..core.runtime import ti
from .base import Bodies, Effect, SceneFacts, check_elastic_constants, require

zeta = ti.func(hurwitz_zeta)


@ti.data_oriented
@dataclass
class Hertz(Effect):
    """Repulsion of elastic bodies, F_n = (4/3) E* sqrt(R) d^1.5, with the energy (8/15) E* sqrt(R) d^2.5.

    Parameters
    ----------
    youngs_modulus
        E [Pa] > 0, the same in both grains; E* = E/(2 (1 - nu^2)).
    poissons_ratio
        nu [1], -1 < nu <= 0.5.
    radius
        "equivalent": 1/R = 1/R_k + 1/R_l of the radii of the spheres of equal volume, in 2D of the discs of equal area.
        "local": of the radii of curvature where the grains touch, for grains or parts of one radius.

    Notes
    -----
    With equivalent radii a pair of grains has one potential of its depth, whatever their shapes and however these are
    divided into patches and parts: the force is its exact gradient, and the energy is kept. Local radii would make it
    jump where a contact crosses a seam between patches of unequal radii, and edges have no single one: scenes refuse
    them there. For discs and spheres both are the same; for clumps the local radius is that of the ball, as Hertz has
    it, and their stiffness then depends on how many balls they consist of. In 2D grains are spheres that move in one
    plane.

    A plane wall has the modulus of the grains, or none if it is rigid (`PlaneWall`); R is then that of the grain.

    No energy is dissipated and nothing is remembered. The stable step is that of a spring with the stiffness at a depth
    of a tenth of the grain; deeper the stiffness rises as the root of the depth.

    References
    ----------
    Hertz (1882); Johnson (1985), Contact Mechanics, sec. 4.2.
    """

    youngs_modulus: float
    poissons_ratio: float
    radius: str = "equivalent"

    phase = "normal"
    role = "elasticity"
    needs = ("reduced_radius",)
    equation = "F_n = 4/3 E* sqrt(R) d^1.5"
    units: ClassVar = {"youngs_modulus": "Pa", "poissons_ratio": "1", "radius": "equivalent | local"}

    def __post_init__(self) -> None:
        check_elastic_constants(self)
        require(self.radius in ("equivalent", "local"), self, "radius", self.radius, "'equivalent' or 'local'")

    @property
    def local_radius(self) -> bool:
        """Whether R is that of the curvatures where the grains touch."""
        return self.radius == "local"

    def parameters(self) -> dict[str, float]:
        """Values that kernels read: e = E* [Pa]."""
        return {"e": self.youngs_modulus / (2.0 * (1.0 - self.poissons_ratio**2))}

    def check(self, scene: SceneFacts) -> None:
        """Refuse a second effect that repels."""
        others = [e.name for e in scene.effects if e.phase == "normal" and e is not self]
        require(not others, self, "youngs_modulus", self.youngs_modulus, f"the only elasticity, but there is {others}")

    def stiffness_per_radius(self) -> float:
        """2 E* [N m-2]: dF/dd = 2 E* a, a = sqrt(R d) the radius of the contact."""
        return 2.0 * self.parameters()["e"]

    def stable_dt(self, bodies: Bodies) -> float:
        """2/omega [s] of a spring with the stiffness at a depth of a tenth of the grain."""
        per_contact = self.stiffness_per_radius() * bodies.contact_radius_per_mass * (1.0 + bodies.lever_factor)
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        """F_n += 2/3 slope d; the linear spring that oscillates alike has 5/6 of the slope."""
        slope = self.tangent_stiffness(contact)
        contact.normal_force += 2.0 / 3.0 * slope * contact.depth
        contact.stiffness += 5.0 / 6.0 * slope  # (p + 1)/(2 p) of the slope, p = 1.5
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        """Energy (8/15) E* sqrt(R) d^2.5 [J]."""
        return 4.0 / 15.0 * self.tangent_stiffness(contact) * contact.depth * contact.depth

    @ti.func
    def onset_impulse(self, contact, speed, acceleration, fraction, dt):
        """-c (u zeta(-3/2, a) + 3/4 alpha dt zeta(-5/2, a)) dt^(5/2) sqrt(u) [N s], c = (4/3) E* sqrt(R).

        Of the force c (u t + alpha t^2/2)^1.5 = c u^1.5 (t^1.5 + 3/4 alpha/u t^2.5 + ...) of the speed u, acceleration
        alpha, fraction a.
        """
        factor = 4.0 / 3.0 * self.e_[0] * ti.sqrt(contact.reduced_radius * speed * dt) * dt * dt
        return -factor * (speed * zeta(1.5, fraction) + 0.75 * acceleration * dt * zeta(2.5, fraction))

    @ti.func
    def tangent_stiffness(self, contact):
        """Slope dF_n/dd = 2 E* sqrt(R d) [N m-1]."""
        return 2.0 * self.e_[0] * ti.sqrt(contact.reduced_radius * contact.depth)

    @classmethod
    def cases(cls) -> list["Hertz"]:
        """Instances that the contract tests try."""
        return [
            cls(youngs_modulus=1.0e5, poissons_ratio=0.3),
            cls(youngs_modulus=7.0e10, poissons_ratio=0.0),
            cls(youngs_modulus=1.0e5, poissons_ratio=0.3, radius="local"),
        ]
