"""Plane walls and grains of other shapes than discs: the deepest point, rest on flat sides, spheres."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.runtime import ti
from taichi_lsm.effects.cohesion import Cohesion
from taichi_lsm.effects.global_damping import GlobalDamping
from taichi_lsm.effects.restitution import damping_ratio_of
from taichi_lsm.effects.rolling_damping import RollingDamping
from tests.helpers import scenes

G = 9.81
K = 1e7


@ti.data_oriented
class Probe:
    """What one wall finds of every grain."""

    def __init__(self, sim):
        self.forces, self.walls, self.dim = sim.forces, sim.walls, sim.grains.dim
        self.depth = ti.field(ti.f64, len(sim))
        self.arm = ti.Vector.field(self.dim, ti.f64, len(sim))

    @ti.kernel
    def measure(self):
        for k in range(self.forces.grains.count[None]):
            contact, depth, arm, feature = self.walls.contact(self.forces, k, 0, 0.0)
            self.depth[self.forces.grains.id[k]] = depth
            self.arm[self.forces.grains.id[k]] = arm


def effects_of(k, *more):
    return [lsm.LinearElastic(k), lsm.CoulombFriction(0.3, 0.5 * k), *more]


@pytest.fixture(scope="module")
def angular(runtime):
    """A disc, a disc of 30 arcs and six angular grains over a floor, far apart."""
    flat = lsm.shapes.random_angular_shapes(3, 5, side_half_width=np.radians(0.3))
    shapes = [lsm.disc(), lsm.shapes.regular_disc_of_arcs(30), *lsm.shapes.random_angular_shapes(3, 4), *flat]
    x = np.stack([3.0 * np.arange(8), np.full(8, 0.8)], axis=1)
    effects = effects_of(K, lsm.ViscousDamping(restitution=0.5), RollingDamping(1.0), lsm.Gravity((0.0, -G)))
    floor = lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0))
    more = {"shapes": shapes, "shape_index": np.arange(8), "walls": [floor], "angle": np.linspace(0.0, 5.0, 8)}
    return scenes.simulate(scenes.scene(x, effects, dt=5e-5, **more))


def support(shape, orientation, n):
    """Greatest n . x of a chain's arcs that hold the body direction of n."""
    c, s = orientation
    u = np.array([c * n[0] + s * n[1], c * n[1] - s * n[0]])
    return np.max((shape.outline(200_000)) @ u)


def test_the_deepest_point_of_a_chain_is_that_of_its_outline(angular):
    sim = angular
    probe = Probe(sim)
    probe.measure()
    x, orientation = sim.scene.position, sim.scene.orientation_state()
    for k, shape in enumerate(sim.scene.shapes):
        depth = support(shape, orientation[k], (0.0, -1.0)) - x[k, 1]
        assert probe.depth[k] == pytest.approx(depth, abs=1e-7)
        assert probe.arm[k][1] == pytest.approx(-x[k, 1] - 0.5 * depth, abs=1e-7)


@pytest.mark.validate
def test_a_disc_of_arcs_does_what_a_disc_does(angular):
    scene = angular.scene
    angular_velocity = np.linspace(3.0, 3.0, 8)[:, None]
    v = np.tile([1.5, -2.0], (8, 1))
    scenes.reload(
        angular,
        position=scene.position,
        velocity=v,
        angular_velocity=angular_velocity,
        orientation=scene.orientation_state(),
    )
    apart = 0.0
    for _ in range(10):
        angular.run(2000)
        v, angular_velocity = angular.state.velocity.to_numpy(), angular.state.angular_velocity.to_numpy()
        x = angular.state.position.to_numpy() - scene.position
        apart = max(
            apart,
            np.abs(x[0] - x[1]).max(),
            np.abs(v[0] - v[1]).max(),
            np.abs(angular_velocity[0] - angular_velocity[1]).max(),
        )
    assert np.abs(x[0]).min() > 0.1 and apart < 1e-7


def test_angular_grains_come_to_rest_on_a_flat_side(angular):
    """The wall's force then passes through the centre, on an arc that is a side."""
    scene = angular.scene
    scenes.effect(angular, "rolling_damping").c_[0] = 2.0 * damping_ratio_of(0.1)  # else they rock for ever
    still = np.zeros((8, 1))
    scenes.reload(
        angular,
        position=scene.position,
        velocity=0.0 * scene.position,
        angular_velocity=still,
        orientation=scene.orientation_state(),
    )
    angular.run(150_000)
    assert np.abs(angular.state.velocity.to_numpy()).max() < 1e-3
    assert np.abs(angular.state.angular_velocity.to_numpy()[2:]).max() < 1e-3
    probe = Probe(angular)
    probe.measure()
    weight = G / angular.state.inverse_mass.to_numpy()
    orientation = angular.state.orientation.to_numpy()
    for k in range(2, 8):
        shape = scene.shapes[k]
        assert probe.depth[k] == pytest.approx(weight[k] / K, rel=1e-2)
        assert abs(probe.arm[k][0]) < 1e-3
        down = np.array([-orientation[k, 1], -orientation[k, 0]])  # of the world, seen from the body
        across = shape.seam[:, 0] * down[1] - shape.seam[:, 1] * down[0]  # of each seam and this direction
        holds = (across >= 0) & (np.roll(across, -1) < 0)
        assert shape.radius[np.flatnonzero(holds)[0]] > 1.0  # sides are arcs of large radius, corners of 0.05


@pytest.fixture(scope="module")
def spheres(runtime):
    """Two spheres, one over a floor, one under a ceiling to which it sticks."""
    effects = effects_of(
        100 * K, lsm.ViscousDamping(restitution=0.5), Cohesion(1e-6, 0.02), lsm.Gravity((0.0, 0.0, -G))
    )
    floor = lsm.PlaneWall("floor", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    ceiling = lsm.PlaneWall("ceiling", (0.0, 0.0, 10.0), (0.0, 0.0, -1.0))
    x = np.array([(0.0, 0.0, 0.5), (5.0, 0.0, 9.49)])
    return scenes.simulate(scenes.scene(x, effects, walls=[floor, ceiling], dt=2e-5))


def test_a_sliding_sphere_ends_rolling_at_five_sevenths_of_its_speed(spheres):
    scenes.effect(spheres, "cohesion").f_[0] = 1e-6
    mass = 1.0 / spheres.state.inverse_mass.to_numpy()[0]
    v0 = np.array([1.2, -1.6, 0.0])
    x = np.array([(0.0, 0.0, 0.5 - 0.01 * mass * G / K), (5.0, 0.0, 9.2)])
    scenes.reload(spheres, position=x, velocity=np.array([v0, 0 * v0]), angular_velocity=np.zeros((2, 3)))
    spheres.run(int(1.3 * 2 * 2.0 / (7 * 0.3 * G) / spheres.dt))
    v, angular_velocity = spheres.state.velocity.to_numpy()[0], spheres.state.angular_velocity.to_numpy()[0]
    assert v[:2] == pytest.approx(5 / 7 * v0[:2], rel=5e-3)
    assert angular_velocity == pytest.approx([-v[1] / 0.5, v[0] / 0.5, 0.0], rel=5e-3, abs=1e-9)


def test_a_sphere_hangs_from_the_ceiling_by_cohesion(spheres):
    """f (1 - gap/h) = m g: it is caught within the reach, without touching."""
    mass = 1.0 / spheres.state.inverse_mass.to_numpy()[0]
    pull = 2.0 * mass * G
    scenes.effect(spheres, "cohesion").f_[0] = pull
    depth = (pull - mass * G) / (100 * K)
    x = np.array([(0.0, 0.0, 3.0), (5.0, 0.0, 9.5 + depth)])
    scenes.reload(spheres, position=x, velocity=np.zeros((2, 3)), angular_velocity=np.zeros((2, 3)))
    spheres.run(5000)
    sums = spheres.measure.sums()
    assert sums["contact_count"] == 1
    assert spheres.walls.snapshot()["force"][1] == pytest.approx([0.0, 0.0, -mass * G], rel=1e-9, abs=1e-9)
    assert spheres.state.position.to_numpy()[1, 2] == pytest.approx(9.5 + depth, abs=1e-12)
    # not touching: repelled by nothing, pulled by f (1 - gap/h) < f
    scenes.reload(spheres, position=x - [0.0, 0.0, 0.005], velocity=np.zeros((2, 3)), angular_velocity=np.zeros((2, 3)))
    gap = 0.005 - depth
    sums = spheres.measure.sums()
    assert sums["contact_count"] == 0
    assert spheres.walls.snapshot()["force"][1][2] == pytest.approx(-pull * (1 - gap / 0.02), rel=1e-9)
    assert sums["energy_cohesion"] == pytest.approx(-pull * 0.5 * 0.02 * (1 - gap / 0.02) ** 2, rel=1e-5)


def polyhedra(runtime):
    """Polyhedra over a floor, far apart, turned at random."""
    shapes = [lsm.sphere(), *lsm.shapes.random_angular_polyhedra(5, 2)]
    rng = np.random.default_rng(0)
    orientation = rng.normal(size=(6, 4))
    x = np.stack([3.0 * np.arange(6), np.zeros(6), np.full(6, 0.85)], axis=1)
    floor = lsm.PlaneWall("floor", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    effects = effects_of(K, lsm.ViscousDamping(restitution=0.3), GlobalDamping(2.0), lsm.Gravity((0.0, 0.0, -G)))
    more = {"orientation": orientation / np.linalg.norm(orientation, axis=1)[:, None], "walls": [floor]}
    return scenes.scene(x, effects, shapes=shapes, shape_index=np.arange(6), dt=5e-5, **more)


def body_down(orientation):
    """The direction (0, 0, -1) of the world, seen from bodies turned like this (n, 4)."""
    w, x, y, z = orientation.T
    return -np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)


@pytest.mark.validate
def test_polyhedra_touch_with_their_deepest_point_and_rest_on_a_face(runtime):
    sim = scenes.simulate(polyhedra(runtime))
    probe = Probe(sim)
    probe.measure()
    down, x = body_down(sim.scene.orientation_state()), sim.scene.position
    for k in range(1, 6):
        height = sim.scene.shapes[k].support(down[k : k + 1])[0]
        assert probe.depth[k] == pytest.approx(height - x[k, 2], abs=1e-10)
    before = sum(scenes.energy(sim))
    sim.run(200_000)
    probe.measure()
    weight = G / sim.state.inverse_mass.to_numpy()
    down = body_down(sim.state.orientation.to_numpy())
    for k in range(1, 6):
        shape = sim.scene.shapes[k]
        assert probe.depth[k] == pytest.approx(weight[k] / K, rel=1e-2)
        assert np.linalg.norm(probe.arm.to_numpy()[k, :2]) < 2e-3
        assert shape.ring_radius[shape.feature_of(down[k : k + 1])[0]] == 0.0
        assert shape.feature_radius[shape.feature_of(down[k : k + 1])[0]] > 1.0
    assert sum(scenes.energy(sim)) == pytest.approx(before, rel=2e-3)
