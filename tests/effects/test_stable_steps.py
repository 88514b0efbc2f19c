"""Every law keeps its word: at 0.9 of its own stable step a pair of grains swings, and never more widely.

One contact between two grains of a million-fold range of masses, as the law sees it: the normal laws swing about the
depth of a load, the tangential ones about rest under a constant normal force, couples likewise. Leapfrog, as in runs.
"""

import numpy as np
import pytest

from taichi_lsm.effects import Bodies
from tests.effects.test_every_effect import COUNT, DEPTH, LAWS, bench_of, random_contacts
from tests.helpers.scenes import PRECISION

pytestmark = [
    pytest.mark.usefixtures("runtime"),
    pytest.mark.skipif(PRECISION == "f32", reason="small swings about a load need f64"),
]

RADIUS, SPIN_FACTOR, LOAD, STEPS = 0.5, 2.5, 40.0, 400
NORMAL = [name for name, effect in LAWS.items() if effect.phase == "normal"]
SIDEWAYS = [name for name, effect in LAWS.items() if effect.phase == "tangential" and not effect.adds_moment]
TURNING = [name for name, effect in LAWS.items() if effect.adds_moment]


def setting(name):
    """(the law's first case, its bench in 3D, contacts, masses (COUNT,) [kg])."""
    effect, bench = LAWS[name].cases()[0], bench_of(LAWS[name], 0, 3)
    rng = np.random.default_rng(1)
    mass = 10 ** rng.uniform(-3, 3, COUNT)
    inputs = random_contacts(rng, 3) | {
        "normal_angular_velocity": 0.0,
        "mass": 0.5 * mass,
        "depth": DEPTH,
        "approach": 0.0,
    }
    inputs |= {"slip": 0.0, "relative_angular_velocity": 0.0, "reduced_radius": 0.5 * RADIUS, "stiffness": 0.0}
    return effect, bench, inputs, mass


def stable_steps(effect, mass):
    """The law's own bound for a pair of grains of each mass, with one contact each."""
    curved = np.sqrt(0.5 * RADIUS * 2.0 * DEPTH)  # no contact of these tests is deeper than 2 DEPTH
    known = [
        Bodies(3, m, m * RADIUS**2 / SPIN_FACTOR, SPIN_FACTOR, 0.0, 1, 0.0, contact_radius_per_mass=curved / m)
        for m in mass
    ]
    return np.array([effect.stable_dt(bodies) for bodies in known])


def oscillation(force, step, inverse_effective_mass, velocity):
    """Greatest |x| of x'' = ease force(x, velocity) by leapfrog, in the first and in the second half of STEPS."""
    x, widest = np.zeros_like(velocity), []
    for _ in range(STEPS):
        velocity = velocity + inverse_effective_mass[:, None] * force(x, velocity) * step[:, None]
        x = x + velocity * step[:, None]
        widest.append(np.abs(x).max(axis=1))
    widest = np.array(widest)
    return widest[: STEPS // 2].max(axis=0), widest[STEPS // 2 :].max(axis=0)


@pytest.mark.parametrize("name", NORMAL)
def test_normal_laws_swing_about_a_load(name):
    effect, bench, inputs, mass = setting(name)
    load = bench(**inputs | {"normal_force": 0.0})["normal_force"]

    def force(x, velocity):
        out = bench(**inputs | {"depth": DEPTH + x[:, 0], "approach": velocity[:, 0], "normal_force": 0.0})
        return (load - out["normal_force"])[:, None]

    with np.errstate(invalid="ignore", over="ignore"):  # beyond its bound the swing leaves all that is finite
        for part, holds in ((0.9, True), (2.5, False)):
            step = part * stable_steps(effect, mass)
            early, late = oscillation(force, step, 2.0 / mass, (1e-3 * DEPTH / step)[:, None])
            assert np.all(late < 1.01 * early) == holds


@pytest.mark.parametrize("name", SIDEWAYS + TURNING)
def test_tangential_laws_swing_about_rest(name):
    effect, bench, inputs, mass = setting(name)
    inputs |= {"normal_force": LOAD}
    turning = name in TURNING
    along = np.cross(inputs["normal"], np.roll(inputs["normal"], 1, axis=1) + (0.3, 0.0, 0.0))
    along /= np.linalg.norm(along, axis=1)[:, None]
    inverse_effective_mass = 2.0 / (mass * RADIUS**2 / SPIN_FACTOR) if turning else 2.0 / mass * (1.0 + SPIN_FACTOR)
    step = 0.9 * stable_steps(effect, mass)
    memory = {"history": None}

    def force(x, velocity):
        moving = {"relative_angular_velocity" if turning else "slip": velocity * along, "dt": step}
        out = bench(history=memory["history"], **inputs | moving)
        memory["history"] = out["history"]
        return np.sum(out["contact_moment" if turning else "tangential_force"] * along, axis=1)[:, None]

    early, late = oscillation(force, step, inverse_effective_mass, (1e-4 * DEPTH / step)[:, None])
    assert np.all(early > 0) and np.all(late < 1.01 * early)
