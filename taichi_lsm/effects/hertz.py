"""Hertz's repulsion of elastic spheres."""

from dataclasses import dataclass

import numpy as np

from ..core.runtime import ti
from .base import Effect, check_elastic_constants, require


@ti.data_oriented
@dataclass
class Hertz(Effect):
    """F_n = (4/3) E* sqrt(R) d^1.5, energy (8/15) E* sqrt(R) d^2.5: Hertz (1882), Johnson (1985), sec. 4.2.

    youngs_modulus E [Pa] > 0, poissons_ratio nu [-], -1 < nu <= 0.5, the same in both grains: E* = E/(2 (1 - nu^2));
    1/R = 1/R_k + 1/R_l of the radii of curvature where the grains touch. In 2D grains are spheres that move in one
    plane. Of arcs with unequal radii the force jumps where the contact crosses a seam, and the energy with it; chains
    of equal arcs conserve it. Not for grains with edges, which have no single radius there.
    """

    youngs_modulus: float
    poissons_ratio: float

    phase = "normal"
    role = "elasticity"
    needs = ("reduced_radius",)
    equation = "F_n = 4/3 E* sqrt(R) d^1.5"
    units = {"youngs_modulus": "Pa", "poissons_ratio": "1"}

    def __post_init__(self):
        check_elastic_constants(self)

    def parameters(self):
        return {"e": self.youngs_modulus / (2.0 * (1.0 - self.poissons_ratio**2))}

    def check(self, scene):
        others = [e.name for e in scene.effects if e.phase == "normal" and e is not self]
        require(not others, self, "youngs_modulus", self.youngs_modulus, f"the only elasticity, but there is {others}")

    def stiffness_per_radius(self):
        """dF/dd = 2 E* a, a = sqrt(R d)."""
        return 2.0 * self.parameters()["e"]

    def stable_dt(self, bodies):
        """As for a spring of the stiffness at a depth of a tenth of the grain; deeper it rises as the root."""
        per_contact = self.stiffness_per_radius() * bodies.contact_radius_per_mass * (1.0 + bodies.lever_factor)
        return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        slope = self.tangent_stiffness(contact)
        contact.normal_force += 2.0 / 3.0 * slope * contact.depth
        contact.stiffness += 5.0 / 6.0 * slope
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        return 4.0 / 15.0 * self.tangent_stiffness(contact) * contact.depth * contact.depth

    @ti.func
    def tangent_stiffness(self, contact):
        return 2.0 * self.e_[0] * ti.sqrt(contact.reduced_radius * contact.depth)

    @classmethod
    def cases(cls):
        return [cls(youngs_modulus=1.0e5, poissons_ratio=0.3), cls(youngs_modulus=7.0e10, poissons_ratio=0.0)]
