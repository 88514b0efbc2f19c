"""Restitution of impacts off the centre: of angular grains with a plane wall and with each other, in 2D and 3D."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers import scenes

COUNT = 24  # grains that fall on the wall, and pairs
E, SPEED, K = 0.5, 1.0, 1e9  # so hard that grains hardly turn in an impact
STEPS = 80  # of the longest impact
BOX = {  # a rod of 3 by 1, and a box of 3 by 2 by 1
    2: lambda: lsm.shapes.from_outline([(0, 0), (3, 0), (3, 1), (0, 1)], 0.1)[0],
    3: lambda: lsm.shapes.from_planes(np.vstack([np.eye(3), -np.eye(3)]), [1.5, 1.0, 0.5] * 2, 0.1),
}


def impacts(dim):
    """COUNT tilted grains fall on a plane wall; far above it as many pairs fly at each other off centre."""
    rng = np.random.default_rng(5)
    shape = BOX[dim]()
    reach = shape.bounding_radius
    place, velocity = np.zeros((2, 3 * COUNT, dim))
    place[:, 0] = 5.0 * np.tile(np.arange(COUNT), 3)
    place[:COUNT, 1], velocity[:COUNT, 1] = reach + 0.01, -SPEED
    lower, upper = slice(COUNT, 2 * COUNT), slice(2 * COUNT, None)
    place[lower, 1], place[upper, 1] = 20.0, 20.01 + 2.0 * reach
    place[upper, 0] += rng.uniform(-0.4, 0.4, COUNT)
    velocity[lower, 1], velocity[upper, 1] = 0.5 * SPEED, -0.5 * SPEED
    # Tilted so that a corner is the lowest point, and the impact off the centre.
    tilt = rng.uniform(0.4, 1.1, (len(place), 2))
    orientation = {"angle": tilt[:, 0]}
    if dim == 3:
        orientation = {"orientation": np.roll(Rotation.from_euler("xz", tilt).as_quat(), 1, axis=1)}
    mass = 1000.0 * (np.pi / 4 if dim == 2 else np.pi / 6)
    return scenes.scene(
        place,
        [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=E)],
        shapes=[shape],
        velocity=velocity,
        walls=[lsm.PlaneWall("floor", point=(0.0,) * dim, normal=(0.0, 1.0, 0.0)[:dim])],
        thickness=1.0 if dim == 2 else None,
        dt=np.pi * np.sqrt(mass / K) / STEPS,
        skin=0.1,
        **orientation,
    )


def momenta(sim):
    """(momentum (n, dim), angular momentum (n, 1 or 3)) of every grain over its mass."""
    mass, inertia = sim.scene.masses()
    omega = sim.state.angular_velocity.to_numpy()
    own = sim.state.angular_momentum.to_numpy() if sim.grains.has("angular_momentum") else inertia * omega
    return sim.state.velocity.to_numpy(), own / mass[:, None], omega


def through_first_impact(sim):
    """Momenta of every grain before its first impact and after it, when its velocity has changed and stays."""
    before = momenta(sim)
    last, after = before, [a.copy() for a in before]
    waits = np.ones(len(sim), bool)
    while waits.any():
        sim.run(STEPS)
        now = momenta(sim)
        parted = waits & np.any(now[0] != before[0], axis=1) & np.all(now[0] == last[0], axis=1)
        for kept, values in zip(after, now):
            kept[parted] = values[parted]
        last, waits = now, waits & ~parted
        assert sim.step < 800 * STEPS
    return before, after


def restitution(before, after):
    """Ratio of the speeds along the impulse at the contact, after and before; of the wall's grains, then of pairs.

    With the impulse j n on a grain and its angular impulse j a x n, the speed of its contact point along n is
    v.n + omega.(a x n).
    """
    impulse, angular_impulse = after[0] - before[0], after[1] - before[1]
    size = np.linalg.norm(impulse, axis=1)[:, None]
    n, lever = impulse / size, angular_impulse / size
    speed = [np.sum(n * v, axis=1) + np.sum(lever * omega, axis=1) for v, _, omega in (before, after)]
    wall = -speed[1][:COUNT] / speed[0][:COUNT]
    both = [s[COUNT : 2 * COUNT] + s[2 * COUNT :] for s in speed]
    return np.concatenate([wall, -both[1] / both[0]]), np.linalg.norm(lever, axis=1)


def check(dim):
    sim = scenes.simulate(impacts(dim))
    e, lever = restitution(*through_first_impact(sim))
    assert lever.max() > 0.3  # [m], of grains of 1 m
    assert np.abs(e - E).max() < 0.01 * E


@pytest.mark.validate  # long to compile
@pytest.mark.parametrize("runtime", [scenes.KEY_PRECISIONS[0], "f32"], indirect=True)
def test_rods_rebound_with_the_restitution_asked_for(runtime):
    check(2)


@pytest.mark.validate  # long to compile
def test_boxes_rebound_with_the_restitution_asked_for(runtime):
    check(3)
