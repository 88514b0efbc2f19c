"""Contact parameters of the declared scenes, and the sets of effects whose costs `benchmarks.effects` compares.

Units are those of `scenes`: mean diameter d = 1, density rho = 1.
"""

import numpy as np

import taichi_lsm as lsm

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
    "global_damping": ([*FRICTIONAL, lsm.effects.GlobalDamping(1e-3)], "coulomb_friction"),
    "cohesion": ([*FRICTIONAL, lsm.effects.Cohesion(1e-3 * NORMAL_STIFFNESS, 0.02)], "coulomb_friction"),
    "rolling_resistance": (
        [*FRICTIONAL, lsm.effects.RollingResistance(0.1, 0.01 * NORMAL_STIFFNESS)],
        "coulomb_friction",
    ),
    "rolling_damping": ([*FRICTIONAL, lsm.effects.RollingDamping(0.5)], "coulomb_friction"),
    "velocity_weakening_friction": (
        [*DAMPED, lsm.effects.VelocityWeakeningFriction(FRICTION, 0.3, 1.0, TANGENTIAL_STIFFNESS)],
        "viscous_damping",
    ),
    "rate_and_state_friction": (
        [*DAMPED, lsm.effects.RateAndStateFriction(FRICTION, 0.01, 0.015, 1e-3, 1.0, TANGENTIAL_STIFFNESS)],
        "viscous_damping",
    ),
    "elastic_brittle_bond": (
        # All touching grains are bonded, and bonds take the place of contacts.
        [*FRICTIONAL, lsm.effects.ElasticBrittleBond(NORMAL_STIFFNESS, POISSON_RATIO, np.inf, 0.8)],
        "coulomb_friction",
    ),
    "hertz": ([lsm.effects.Hertz(YOUNG_MODULUS, POISSON_RATIO)], None),
    "mindlin": (
        [lsm.effects.Hertz(YOUNG_MODULUS, POISSON_RATIO), lsm.effects.Mindlin(FRICTION, YOUNG_MODULUS, POISSON_RATIO)],
        "hertz",
    ),
}
