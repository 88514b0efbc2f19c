"""Contact parameters of the declared scenes, and the sets of effects whose costs `benchmarks.effects` compares.

Units are those of `scenes`: mean diameter d = 1, density rho = 1.
"""

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.effects.cohesion import Cohesion
from taichi_lsm.effects.elastic_brittle_bond import ElasticBrittleBond
from taichi_lsm.effects.global_damping import GlobalDamping
from taichi_lsm.effects.hertz import Hertz
from taichi_lsm.effects.mindlin import Mindlin
from taichi_lsm.effects.rate_and_state_friction import RateAndStateFriction
from taichi_lsm.effects.rolling_resistance import RollingResistance
from taichi_lsm.effects.velocity_weakening_friction import VelocityWeakeningFriction

NORMAL_STIFFNESS = 1e4
TANGENTIAL_RATIO = 2.0 / 7.0
TANGENTIAL_STIFFNESS = TANGENTIAL_RATIO * NORMAL_STIFFNESS
FRICTION = 0.5
DAMPING_RATE = 40.0
YOUNG_MODULUS, POISSON_RATIO = 1e5, 0.25  # Hertz: as stiff as NORMAL_STIFFNESS at a depth of about a hundredth of d


def linear_frictional() -> list:
    """Linear elasticity, viscous damping and Coulomb friction, as LAMMPS's `gran/hooke/history`."""
    return [
        lsm.LinearElastic(NORMAL_STIFFNESS),
        lsm.ViscousDamping(rate=DAMPING_RATE),
        lsm.CoulombFriction(FRICTION, TANGENTIAL_STIFFNESS),
    ]


FRICTIONAL = linear_frictional()
DAMPED = FRICTIONAL[:2]
ELASTIC = FRICTIONAL[:1]
# Name of a set: (its effects, name of the set without the effect whose cost is asked for).
EFFECT_SETS: dict[str, tuple[list, str | None]] = {
    "linear_elastic": (ELASTIC, None),
    "viscous_damping": (DAMPED, "linear_elastic"),
    "coulomb_friction": (FRICTIONAL, "viscous_damping"),
    "gravity": ([*FRICTIONAL, lsm.Gravity((0.0, -1e-4, 0.0))], "coulomb_friction"),
    "global_damping": ([*FRICTIONAL, GlobalDamping(1e-3)], "coulomb_friction"),
    "cohesion": ([*FRICTIONAL, Cohesion(1e-3 * NORMAL_STIFFNESS, 0.02)], "coulomb_friction"),
    "rolling_resistance": ([*FRICTIONAL, RollingResistance(0.1, 0.01 * NORMAL_STIFFNESS)], "coulomb_friction"),
    "velocity_weakening_friction": (
        [*DAMPED, VelocityWeakeningFriction(FRICTION, 0.3, 1.0, TANGENTIAL_STIFFNESS)],
        "viscous_damping",
    ),
    "rate_and_state_friction": (
        [*DAMPED, RateAndStateFriction(FRICTION, 0.01, 0.015, 1e-3, 1.0, TANGENTIAL_STIFFNESS)],
        "viscous_damping",
    ),
    "elastic_brittle_bond": (
        # All touching grains are bonded, and bonds take the place of contacts.
        [*FRICTIONAL, ElasticBrittleBond(NORMAL_STIFFNESS, POISSON_RATIO, np.inf, 0.8)],
        "coulomb_friction",
    ),
    "hertz": ([Hertz(YOUNG_MODULUS, POISSON_RATIO)], None),
    "mindlin": (
        [Hertz(YOUNG_MODULUS, POISSON_RATIO), Mindlin(FRICTION, YOUNG_MODULUS, POISSON_RATIO)],
        "hertz",
    ),
}
