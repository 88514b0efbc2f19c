"""Every effect keeps its word: at 0.9 of its own stable step a pair of grains oscillates, and never grows.

One contact between two grains of a million-fold range of masses, as the effect sees it: normal forces oscillate about
the depth of a load, tangential ones about rest under a constant normal force, contact moments likewise. Leapfrog, as
in runs.
"""

import numpy as np
import pytest

from taichi_lsm.effects import Bodies
from taichi_lsm.effects.base import LENGTHS
from tests.effects.test_every_effect import DEPTH, EFFECTS, SPRING, random_contacts
from tests.helpers.effect_bench import COUNT, bench_of
from tests.helpers.scenes import PRECISION

pytestmark = [
    pytest.mark.usefixtures("runtime"),
    pytest.mark.skipif(PRECISION == "f32", reason="small oscillations about a load need f64"),
]

RADIUS, ROTATION_FACTOR, LOAD, STEPS = 0.5, 2.5, 40.0, 400
NORMAL = [name for name, effect in EFFECTS.items() if effect.phase == "normal"]
SIDEWAYS = [name for name, effect in EFFECTS.items() if effect.phase == "tangential" and not effect.adds_moment]
ROLLING = [name for name, effect in EFFECTS.items() if effect.adds_moment]


def setting(name):
    """(the effect's first case, its bench in 3D, contacts, masses (COUNT,) [kg])."""
    effect, bench = EFFECTS[name].cases()[0], bench_of(EFFECTS[name], 0, 3)
    rng = np.random.default_rng(1)
    mass = 10 ** rng.uniform(-3, 3, COUNT)
    inputs = random_contacts(rng, 3) | {
        "normal_angular_velocity": 0.0,
        "mass": 0.5 * mass,
        "depth": DEPTH,
        "approach": 0.0,
    }
    inputs |= {"slip": 0.0, "relative_angular_velocity": 0.0}
    inputs |= dict.fromkeys(LENGTHS, 0.5 * RADIUS)  # and that is the widest footprint
    return effect, bench, inputs, mass


def stable_steps(effect, mass):
    """The effect's own bound for a pair of grains of each mass, with one contact each."""
    curved = np.sqrt(0.5 * RADIUS * 2.0 * DEPTH)  # no contact of these tests is deeper than 2 DEPTH
    known = [
        Bodies(
            3, m, m * RADIUS**2 / ROTATION_FACTOR, ROTATION_FACTOR, 0.0, 1, SPRING, contact_radius_per_mass=curved / m
        )
        for m in mass
    ]
    return np.array([effect.stable_dt(bodies) for bodies in known])


def oscillation(force, step, inverse_effective_mass, velocity):
    """Greatest |x| of x'' = force(x, velocity) inverse_effective_mass, in either half of STEPS steps of leapfrog."""
    x, widest = np.zeros_like(velocity), []
    for _ in range(STEPS):
        velocity = velocity + inverse_effective_mass[:, None] * force(x, velocity) * step[:, None]
        x = x + velocity * step[:, None]
        widest.append(np.abs(x).max(axis=1))
    widest = np.array(widest)
    return widest[: STEPS // 2].max(axis=0), widest[STEPS // 2 :].max(axis=0)


@pytest.mark.parametrize("name", NORMAL)
def test_normal_forces_oscillate_about_a_load(name):
    effect, bench, inputs, mass = setting(name)
    load = bench(**inputs | {"normal_force": 0.0})["normal_force"]

    def force(x, velocity):
        out = bench(**inputs | {"depth": DEPTH + x[:, 0], "approach": velocity[:, 0], "normal_force": 0.0})
        return (load - out["normal_force"])[:, None]

    with np.errstate(invalid="ignore", over="ignore"):  # beyond its bound the oscillation leaves all that is finite
        for share, holds in ((0.9, True), (2.5, False)):
            step = share * stable_steps(effect, mass)
            early, late = oscillation(force, step, 2.0 / mass, (1e-3 * DEPTH / step)[:, None])
            assert np.all(late < 1.01 * early) == holds


@pytest.mark.parametrize("name", [*SIDEWAYS, *ROLLING])
def test_tangential_forces_and_moments_oscillate_about_rest(name):
    effect, bench, inputs, mass = setting(name)
    inputs |= {"normal_force": LOAD}
    rolls = name in ROLLING
    along = np.cross(inputs["normal"], np.roll(inputs["normal"], 1, axis=1) + np.array([0.3, 0.0, 0.0]))
    along /= np.linalg.norm(along, axis=1)[:, None]
    inverse_effective_mass = (
        2.0 / (mass * RADIUS**2 / ROTATION_FACTOR) if rolls else 2.0 / mass * (1.0 + ROTATION_FACTOR)
    )
    step = 0.9 * stable_steps(effect, mass)
    memory = {"history": None}

    def force(x, velocity):
        moving = {"relative_angular_velocity" if rolls else "slip": velocity * along, "dt": step}
        out = bench(history=memory["history"], **inputs | moving)
        memory["history"] = out["history"]
        return np.sum(out["contact_moment" if rolls else "tangential_force"] * along, axis=1)[:, None]

    early, late = oscillation(force, step, inverse_effective_mass, (1e-4 * DEPTH / step)[:, None])
    assert np.all(early > 0) and np.all(late < 1.01 * early)
