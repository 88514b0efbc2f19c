"""Around the surface of every convex library shape a contact has the same stiffness, and friction crosses its seams."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

pytestmark = pytest.mark.skipif(scenes.PRECISION == "f32", reason="depths of 1e-4 to one in a million need f64")
STIFFNESS = 1e5
DEPTH = 1e-4
LIBRARY = {
    2: lambda: [
        lsm.disc(),
        *lsm.shapes.random_angular_shapes(3, 1),
        *lsm.shapes.random_polygons(2, 1, angularity=0.5),
        lsm.shapes.regular_polygon(5),
        lsm.shapes.regular_disc_of_arcs(30),
        lsm.shapes.ellipse(2.0),
        lsm.shapes.superellipse(1.5, 4.0),
        lsm.shapes.voronoi_packing(16, 4.0, 1, 0.08, 0.02)[0][3],
    ],
    3: lambda: [
        lsm.sphere(),
        *lsm.shapes.random_angular_polyhedra(2, 1),
        *lsm.shapes.random_polyhedra(1, 1),
        lsm.shapes.regular_polyhedron(12),
        lsm.shapes.ball_of_faces(60, 0.01),
        lsm.shapes.ellipsoid((1.0, 1.5, 2.0), 30),
        lsm.shapes.superellipsoid((1.0, 1.0, 1.0), 6.0, 30),
        lsm.shapes.laguerre_packing(8, 2.0, 1, 0.06, 0.02)[0][3],
    ],
}
PROBES = 60  # of each shape


def outward(dim, rng):
    n = rng.normal(size=(PROBES, dim))
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def surface(shape, n):
    """Points (m, dim) of the surface with outward normals n, in 2D from the patches only."""
    if hasattr(shape, "support_points"):
        return shape.support_points(n)
    centre, radius, axis, half_angle = shape.patches()
    off = np.arccos(np.clip(n @ axis.T, -1, 1)) - half_angle
    own = np.argmin(off, axis=1)
    return centre[own] + radius[own, None] * n


@pytest.mark.validate  # compiles for long
@pytest.mark.parametrize("dim", [2, 3])
def test_the_stiffness_is_the_same_all_round(runtime, dim):
    shapes, rng = LIBRARY[dim](), np.random.default_rng(6)
    place, kind, pressed = [], [], []
    for s, shape in enumerate(shapes):
        n = outward(dim, rng)
        at = np.zeros((PROBES, dim))
        at[:, 0], at[:, 1] = 8.0 * np.arange(PROBES), 8.0 * s
        both = np.stack([at, at + surface(shape, n) + (0.5 - DEPTH) * n], axis=1)
        place.append(both.reshape(-1, dim))
        kind.append(np.tile([s, 0], PROBES))
        pressed.append(np.repeat(n, 2, axis=0))
    scene = scenes.scene(
        np.concatenate(place), [lsm.LinearElastic(STIFFNESS)], shapes=shapes, shape_index=np.concatenate(kind), dt=1e-6
    )
    sim = scenes.simulate(scene)
    sim.run(1)  # the depth changes by a billionth
    first, count = sim.pairs.row_start.to_numpy(), len(scene.position)
    k = np.searchsorted(first[: count + 1], np.arange(first.max()), side="right") - 1
    target = sim.grains.id.to_numpy()[k]
    force = sim.pairs.pair_force.to_numpy()[: len(k)] / (STIFFNESS * DEPTH)
    assert len(k) == count // 2
    assert np.abs(force - np.concatenate(pressed)[target | 1]).max() < 1e-6


def rolling(dim):
    """A grain with many seams that slides and rolls on a fixed one of radius 25."""
    shape = lsm.shapes.superellipse(1.3, 2.5, 30) if dim == 2 else lsm.shapes.ball_of_faces(60, 0.05)
    down = np.eye(dim)[1] * -1.0
    reach = float((surface(shape, down[None]) @ down)[0])
    orientations = {} if dim == 2 else {"orientation": np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))}
    angular_velocity = np.zeros((2, 1 if dim == 2 else 3))
    angular_velocity[1, -1] = -4.0
    return scenes.scene(
        np.stack([25.0 * down, -down * reach]),
        [
            lsm.LinearElastic(STIFFNESS),
            lsm.ViscousDamping(restitution=0.3),
            lsm.CoulombFriction(0.4, 0.5 * STIFFNESS),
            lsm.Gravity(tuple(10.0 * down)),
        ],
        shapes=[lsm.disc() if dim == 2 else lsm.sphere(), shape],
        shape_index=np.array([0, 1]),
        diameter=np.array([50.0, 1.0]),
        velocity=np.stack([0 * down, 1.5 * np.eye(dim)[0]]),
        angular_velocity=angular_velocity,
        density=100.0,
        thickness=1.0,
        platen_index=np.array([0, -1]),
        platens=[lsm.Platen("floor", [lsm.Fixed()] * dim)],
        area=1.0,
        dt=1e-5,
        **orientations,
    )


@pytest.mark.validate  # compiles for long
@pytest.mark.parametrize("dim", [2, 3])
def test_friction_crosses_seams_without_a_jump_and_its_work_is_accounted_for(runtime, dim):
    sim = scenes.simulate(rolling(dim))
    sim.run(6000)  # settled
    stored, lost = scenes.energy(sim)
    force, features = [], set()
    for _ in range(10_000):
        sim.run(2)
        force.append(sim.pairs.pair_force.to_numpy()[0])
        features.add(tuple(sim.pairs.feature.to_numpy()[0]))
    force = np.array(force)
    change = np.abs(np.diff(force, axis=0)).max()
    assert len(features) >= 3
    assert change < 1e-3 * np.abs(force).max()
    stored_end, lost_end = scenes.energy(sim)
    assert stored_end + lost_end == pytest.approx(stored + lost, abs=1e-4 * (lost_end - lost))
