"""Grains of any shape in free flight and in collisions: momenta and energy in 2D and 3D."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

pytestmark = pytest.mark.skipif(scenes.PRECISION == "f32", reason="conservation to f64 rounding")


def cluster(dim, shapes, seed=4, per_axis=3, speed=1.0):
    """Grains on a lattice in open space that fly towards the middle, rotating."""
    rng = np.random.default_rng(seed)
    x = np.stack(np.meshgrid(*[np.arange(per_axis)] * dim), axis=-1).reshape(-1, dim) - 0.5 * (per_axis - 1)
    x = 1.5 * x + rng.uniform(-0.05, 0.05, x.shape)
    n = len(x)
    orientations = {"angle": rng.uniform(0, 6, n)} if dim == 2 else {"orientation": lsm.random_rotations(rng, n, 3)}
    return scenes.scene(
        x,
        [lsm.LinearElastic(2000.0)],
        shapes=shapes,
        shape_index=np.arange(n) % len(shapes),
        density=1.0,
        velocity=-speed * x + 0.1 * rng.normal(size=x.shape),
        angular_velocity=rng.normal(size=(n, 1 if dim == 2 else 3)),
        thickness=1.0,
        dt=1e-3,
        **orientations,
    )


SHAPES = {
    "chains": (2, lambda: lsm.shapes.random_angular_shapes(4, 2)),
    "polyhedra": (
        3,
        lambda: [*lsm.shapes.random_angular_polyhedra(3, 2), lsm.sphere(), lsm.shapes.ellipsoid((1, 1.5, 2), 20)],
    ),
    "union": (2, lambda: [lsm.shapes.crossed_bars(), *lsm.shapes.random_angular_shapes(2, 2)]),
}


@pytest.mark.validate  # long to compile; tests/physics/test_conservation.py has chains among its clusters
@pytest.mark.parametrize("name", SHAPES)
def test_an_isolated_cluster_keeps_its_momenta_and_its_energy(runtime, name):
    dim, shapes = SHAPES[name]
    check_conservation(cluster(dim, shapes()))


def check_conservation(scene):
    """Run the scene through collisions and compare momenta and energy."""
    sim = scenes.simulate(scene)
    linear, linear_scale, angular, angular_scale = scenes.momenta(sim)
    before = sim.measure.sums()
    energy = before["translational_energy"] + before["rotational_energy"] + before["elastic_energy"]
    touching, worst = 0, 0.0
    for _ in range(20):
        sim.run(60)
        sums = sim.measure.sums()
        touching = max(touching, sums["contact_count"])
        now = sums["translational_energy"] + sums["rotational_energy"] + sums["elastic_energy"]
        worst = max(worst, abs(now / energy - 1.0))
    assert touching >= 3
    assert worst < 2e-3
    linear_end, _, angular_end, _ = scenes.momenta(sim)
    assert np.abs(linear_end - linear).max() < 1e-12 * linear_scale
    assert np.abs(angular_end - angular).max() < 1e-10 * angular_scale
