"""The table of contacts of polyhedra, whose search remembers its result, and of grains of several parts."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

K = 1e6


@pytest.mark.validate
def test_reading_the_contacts_of_polyhedra_leaves_the_run_as_it_is(runtime):
    """The next search starts from the features and the normal that the last one found: to the last bit."""
    rng = np.random.default_rng(1)
    place = 1.1 * np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    scene = scenes.scene(
        place,
        [lsm.LinearElastic(K), lsm.CoulombFriction(0.5, 0.5 * K)],
        shapes=[lsm.shapes.ball_of_faces(20)],
        lengths=(3.3,) * 3,
        periodic=(True,) * 3,
        velocity=0.6 * rng.standard_normal(place.shape),
        skin=0.05,
    )
    sim, ends, rows = scenes.simulate(scene), [], 0
    for reads in (False, True):
        sim.reset(scene)
        for _ in range(60):
            sim.run(10)
            if reads:
                rows += sim.contacts().sizes["contact"]
        ends.append([getattr(sim.state, name).to_numpy() for name in ("position", "orientation", "force", "torque")])
    assert rows > 50
    assert all(np.array_equal(a, b) for a, b in zip(*ends))


@pytest.mark.validate
def test_parts_of_crosses_that_touch_are_named(runtime):
    """Bar 0 of a cross lies along x and bar 1 along y; the last cross is turned by a right angle."""
    cross, apart, closer = lsm.shapes.crossed_bars(), 1.2, 0.01
    position = [(0.0, 0.0), (apart, 0.0), (5.0, 0.0), (5.0, apart - closer), (10.0, 0.0), (10.0 + apart, 0.0)]
    angle = [0.0, 0.0, 0.0, 0.0, 0.0, 0.5 * np.pi]
    sim = scenes.simulate(scenes.scene(position, [lsm.LinearElastic(K)], shapes=[cross], angle=angle, skin=0.05))
    table = sim.contacts()
    assert table.first_id.values.tolist() == [0, 2, 4] and table.second_id.values.tolist() == [1, 3, 5]
    assert table.first_part.values.tolist() == [0, 1, 0] and table.second_part.values.tolist() == [0, 1, 1]
    overlap = table.overlap.values
    assert overlap[1] > overlap[0] > 0.0 and overlap[2] == pytest.approx(overlap[0], rel=scenes.tolerance(1e-9, 1e-3))
