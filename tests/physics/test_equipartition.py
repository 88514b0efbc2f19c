"""An elastic gas of shaped grains shares its energy equally among all ways to move."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes


@pytest.mark.validate  # 70 000 steps
@pytest.mark.parametrize(("dim", "share"), [(2, 1 / 3), (3, 1 / 2)])
def test_energy_is_shared_equally_among_all_ways_to_move(runtime, dim, share):
    """E_rot/E_kin -> 1/3 in 2D and, for triaxial grains, 1/2 in 3D; standard error from blocks of one long run."""
    rng = np.random.default_rng(8)
    per_axis = 7 if dim == 2 else 4
    pitch = 1.35
    lattice = np.stack(np.meshgrid(*[np.arange(per_axis)] * dim), axis=-1).reshape(-1, dim)
    n = len(lattice)
    if dim == 2:
        shapes, orientations = lsm.shapes.random_angular_shapes(5, 1), {"angle": rng.uniform(0, 6, n)}
    else:
        shapes = [lsm.shapes.ellipsoid((1.0, 1.3, 1.6), 12, 0.1)]
        orientations = {"orientation": lsm.random_rotations(rng, n, 3)}
    velocity = rng.normal(size=(n, dim))
    velocity -= velocity.mean(axis=0)
    scene = scenes.scene(
        (lattice + 0.5) * pitch,
        [lsm.LinearElastic(2000.0)],
        shapes=shapes,
        shape_index=np.arange(n) % len(shapes),
        density=1.0,
        thickness=1.0,
        lengths=(per_axis * pitch,) * dim,
        periodic=(True,) * dim,
        velocity=velocity,
        dt=2e-3,
        skin=0.3,
        **orientations,
    )
    sim = scenes.simulate(scene)
    sim.run(10_000)
    samples = []
    for _ in range(240):
        sim.run(250)
        sums = sim.measure.sums()
        samples.append(sums["rotational_energy"] / (sums["rotational_energy"] + sums["translational_energy"]))
    blocks = np.mean(np.reshape(samples, (12, -1)), axis=1)
    error = blocks.std(ddof=1) / np.sqrt(len(blocks))
    assert error < 0.02
    assert abs(np.mean(samples) - share) < 3.0 * error
