"""A motion without slip leaves the springs of friction alone: rotation of a cluster as one body, rolling on a wall."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers import scenes

ANGLE = 1e-3  # of a step [rad]
K_T = 1e3
STRETCH = 0.03  # of the springs at the start [m], of grains of 1 m
DENSE = {  # shapes and pitch of a lattice on which they touch
    "discs": (2, lambda: [lsm.disc()], 0.97),
    "spheres": (3, lambda: [lsm.sphere()], 0.97),
    "chains": (2, lambda: lsm.shapes.random_angular_shapes(4, 2, corner_radius=0.2), 0.98),
    "polyhedra": (3, lambda: lsm.shapes.random_angular_polyhedra(2, 2, corner_radius=0.2), 0.92),
    "clumps": (3, lambda: [lsm.shapes.clump([(-0.2, 0, 0), (0.2, 0.1, 0)], [0.4, 0.35])], 0.9),
}
OTHERS = ("spheres", "chains", "polyhedra", "clumps")
LONG_TO_COMPILE = [pytest.param(name, marks=pytest.mark.validate) for name in OTHERS]


def cluster(name):
    """Grains on a lattice of three sites along each axis, at random angles, that nearly all touch their neighbours."""
    dim, shapes, pitch = DENSE[name]
    rng = np.random.default_rng(1)
    site = np.stack(np.meshgrid(*[np.arange(3)] * dim), axis=-1).reshape(-1, dim) - 1.0
    n, shapes = len(site), shapes()
    orientation = {"angle": rng.uniform(0, 6, n)} if dim == 2 else {"orientation": lsm.random_rotations(rng, n, 3)}
    return scenes.scene(
        pitch * site + rng.uniform(-0.02, 0.02, site.shape),
        [lsm.LinearElastic(1e3), lsm.CoulombFriction(1e6, K_T)],
        shapes=shapes,
        shape_index=np.arange(n) % len(shapes),
        integrator=lsm.VelocityVerlet,
        skin=0.5,
        dt=1e-3,
        **orientation if name not in ("discs", "spheres") else {},
    )


def place(sim, **columns):
    """Give the grains this state at the end of a step and evaluate their contacts; no force moves them."""
    for name, values in columns.items():
        getattr(sim.state, name).from_numpy(np.ascontiguousarray(values))
    sim.step_loop.finish_step()


def turned(q, rotation):
    """Orientations (n, 2 or 4) of grains that turn with a cluster."""
    if q.shape[1] == 2:
        return q @ rotation.as_matrix()[:2, :2].T
    return np.roll((rotation * Rotation.from_quat(np.roll(q, -1, axis=1))).as_quat(), 1, axis=1)


def turn(sim, axis, steps):
    """Turn the cluster as one body about an axis through the origin; velocities are those of the middle of a step."""
    dim, n = sim.scene.dim, len(sim)
    start, last = sim.state.position.to_numpy(), sim.state.position.to_numpy()
    q = sim.state.orientation.to_numpy() if sim.grains.has("orientation") else None
    omega = np.tile((axis * ANGLE / sim.dt)[2 if dim == 2 else 0 :], (n, 1))
    for step in range(1, steps + 1):
        rotation = Rotation.from_rotvec(step * ANGLE * axis)
        position = start @ rotation.as_matrix()[:dim, :dim].T
        more = {} if q is None else {"orientation": turned(q, rotation)}
        place(sim, position=position, velocity=(position - last) / sim.dt, angular_velocity=omega, **more)
        last = position
    return rotation.as_matrix()[:dim, :dim]


def check_rotation(name, bound):
    """Stretch the springs by a random motion, turn the cluster, and compare the force of every contact in its frame."""
    sim = scenes.simulate(cluster(name))
    n, dim = sim.state.position.to_numpy().shape
    rng = np.random.default_rng(2)
    still = np.zeros((n, 1 if dim == 2 else 3))
    place(sim, velocity=rng.uniform(-STRETCH, STRETCH, (n, dim)) / sim.dt, angular_velocity=still)
    used = sim.pairs.row_start.to_numpy().max()
    before, stored = sim.pairs.pair_force.to_numpy()[:used], sim.measure.sums()["energy_coulomb_friction"]
    springs = np.linalg.norm(sim.pairs.history.to_numpy()[:used], axis=1)
    assert np.count_nonzero(springs) >= n and springs.max() > STRETCH
    axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else np.array([1.0, 2.0, -1.5]) / np.sqrt(7.25)
    matrix = turn(sim, axis, 50)
    after = sim.pairs.pair_force.to_numpy()[:used] @ matrix
    assert np.abs(after - before).max() < bound * K_T * springs.max()
    assert sim.measure.sums()["energy_coulomb_friction"] == pytest.approx(stored, rel=bound)


@pytest.mark.parametrize("name", ["discs", *LONG_TO_COMPILE])
def test_springs_turn_with_a_cluster(runtime, name):
    check_rotation(name, scenes.tolerance(1e-6))


@pytest.mark.validate
@pytest.mark.parametrize("runtime", ["f32"], indirect=True)
def test_springs_turn_with_a_cluster_of_spheres_in_single_precision(runtime):
    check_rotation("spheres", 1e-4)


def test_a_corner_that_rolls_on_a_wall_does_not_slip(runtime):
    """An angular grain rocks by 0.2 rad on one of its corners, whose centre moves by the arc that is rolled off."""
    shape = lsm.shapes.random_angular_shapes(1, 2, corner_radius=0.1)[0]
    centre, radius, axis, _ = shape.patches()
    corner = np.argmin(radius)
    depth = 0.01
    scene = scenes.scene(
        [(0.0, 0.0)],
        [lsm.LinearElastic(1e3), lsm.CoulombFriction(1e6, K_T)],
        shapes=[shape],
        walls=[lsm.PlaneWall("floor", point=(0.0, -5.0), normal=(0.0, 1.0))],
        integrator=lsm.VelocityVerlet,
        dt=1e-3,
    )
    sim = scenes.simulate(scene)
    down = -0.5 * np.pi - np.arctan2(axis[corner, 1], axis[corner, 0])
    last, last_angle, slip = None, 0.0, []
    for angle in 0.1 * np.sin(np.linspace(0.0, 2.0 * np.pi, 630)):
        q = np.array([np.cos(down + angle), np.sin(down + angle)])
        c = centre[corner]
        from_grain = np.array([q[0] * c[0] - q[1] * c[1], q[1] * c[0] + q[0] * c[1]])
        middle = np.array([-(radius[corner] - 0.5 * depth) * angle, -5.0 + radius[corner] - depth])
        position = middle - from_grain
        velocity = 0.0 * position if last is None else (position - last) / sim.dt
        omega = (angle - last_angle) / sim.dt
        place(sim, position=[position], velocity=[velocity], angular_velocity=[[omega]], orientation=[q])
        last, last_angle = position, angle
        slip.append(sim.walls.row_history.to_numpy()[0, 0])
    assert sim.walls.row_status.to_numpy()[0] == 1
    assert np.abs(slip).max() < scenes.tolerance(1e-8, 1e-5)
