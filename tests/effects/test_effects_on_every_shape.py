"""Every effect of contacts on grains of every kind of shape: one potential, Newton's third law, no preferred frame.

Each scene holds pairs of grains that collide once or a few times, far from each other pair. The sets of effects cover
all effects of contacts; what each of them dissipates has a channel of its own.
"""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.effects import find_effects
from taichi_lsm.effects.base import ON_CONTACTS
from tests.helpers import scenes
from workflows.cli.effect_shapes import refusal, shapes_of

PAIRS = 24
K, E, NU = 2000.0, 2e4, 0.3
SPEED = 0.3  # [m s-1], of each grain
SAMPLES = 150  # times at which overlaps are seen
RIMMED = (3, "cones")  # between its cones there are no normals: contacts there begin deep, with energy from nowhere
DAMPING = lsm.ViscousDamping(restitution=0.6)
ROLLING = lsm.effects.RollingResistance(0.2, 5.0)
SETS = {
    "coulomb": [
        lsm.LinearElastic(K),
        DAMPING,
        lsm.CoulombFriction(0.4, 0.5 * K),
        lsm.effects.RollingDamping(0.5),
        lsm.effects.Cohesion(0.1, 0.01),
    ],
    "weakening": [
        lsm.LinearElastic(K),
        lsm.ViscousDamping(rate=3.0),
        lsm.effects.VelocityWeakeningFriction(0.6, 0.3, 0.1, 0.5 * K),
        ROLLING,
    ],
    "rate and state": [
        lsm.LinearElastic(K),
        lsm.effects.RateAndStateFriction(0.5, 0.02, 0.03, 1e-3, 0.1, 0.5 * K),
    ],
    "hertz": [lsm.effects.Hertz(E, NU), DAMPING, lsm.effects.Mindlin(0.4, E, NU), ROLLING],
    "local": [lsm.effects.Hertz(E, NU, radius="local"), lsm.effects.Mindlin(0.4, E, NU)],
}
KINDS = {  # of `shapes_of`, which takes a second
    2: ("discs", "arc chains", "cones", "clumps", "unions"),
    3: ("spheres", "ball-polyhedra", "cones", "clumps", "unions"),
}
EVEN = ("discs", "spheres", "clumps")  # of one radius where they touch
CASES = [(name, dim, kind) for name in SETS for dim in KINDS for kind in KINDS[dim] if name != "local" or kind in EVEN]


def test_the_sets_hold_all_effects_of_contacts_and_scenes_accept_them():
    """On all shapes; only a local radius is refused, on grains of unequal patches."""
    held = {type(effect) for effects in SETS.values() for effect in effects}
    package = {cls for cls in find_effects().values() if cls.__module__.startswith("taichi_lsm.")}
    assert held == {cls for cls in package if cls.phase in ON_CONTACTS}
    assert all(tuple(shapes_of(dim)) == kinds for dim, kinds in KINDS.items())
    every = [(name, dim, kind) for name in SETS for dim in KINDS for kind in KINDS[dim]]
    assert [(n, dim, kind) for n, dim, kind in every if not refusal(SETS[n][0], shapes_of(dim)[kind])] == CASES


def turned(dim, rng):
    """A random rotation of space (dim, dim), and the same as a state of orientation."""
    if dim == 2:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), angle
    q = lsm.random_rotations(rng, 1, 3)[0]
    w, v = q[0], q[1:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross, q


def product(p, q):
    """Product of the quaternions p (4,) or (n, 4) and q (n, 4)."""
    p = np.broadcast_to(p, q.shape)
    w = p[:, 0] * q[:, 0] - np.sum(p[:, 1:] * q[:, 1:], axis=1)
    v = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.concatenate([w[:, None], v], axis=1)


def collision(name, dim, kind, frame=None):
    """Scene of pairs that fly at each other, seen from another frame if one is given."""
    rng = np.random.default_rng(5)
    shape = shapes_of(dim)[kind]
    diameter = rng.uniform(0.7, 1.2, 2 * PAIRS)
    reach = shape.bounding_radius * diameter
    x, v = np.zeros((2 * PAIRS, dim)), np.zeros((2 * PAIRS, dim))
    x[:, 1] = 6.0 * np.repeat(np.arange(PAIRS), 2)
    x[1::2, 0] = reach[::2] + reach[1::2] + 0.02
    x[1::2, 1] += rng.uniform(-0.3, 0.3, PAIRS)
    v[::2, 0], v[1::2, 0] = SPEED, -SPEED
    omega = rng.normal(0.0, 0.5, (2 * PAIRS, 1 if dim == 2 else 3))
    angle, q = rng.uniform(0.0, 2.0 * np.pi, 2 * PAIRS), lsm.random_rotations(rng, 2 * PAIRS, 3)
    if (dim, kind) == RIMMED:  # caps face each other, a little tilted
        facing = np.repeat([(np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)], 2 * PAIRS, axis=0)
        q, omega = moved(facing, rng.normal(0.0, 0.15, (2 * PAIRS, 3))), 0.05 * omega
    if frame:
        matrix, turn = frame
        x, v = x @ matrix.T, v @ matrix.T
        angle, q = (angle + turn, q) if dim == 2 else (angle, product(turn, q))
        omega = omega if dim == 2 else omega @ matrix.T
    placed = {"angle": angle} if dim == 2 else {"orientation": q}
    more = {"velocity": v, "angular_velocity": omega, "thickness": 1.0, "density": 1.0, "skin": 0.1, "safety": 0.05}
    return scenes.scene(x, SETS[name], shapes=[shape], diameter=diameter, **placed, **more)


def at_rest(sim, position, orientation):
    """Elastic energy [J] of the grains at these places without motion and past."""
    columns = {"position": position, "velocity": 0.0 * position}
    columns["angular_velocity"] = 0.0 * sim.state.angular_velocity.to_numpy()
    scenes.reload(sim, **columns, **({} if orientation is None else {"orientation": orientation}))
    return sim.measure.sums()["elastic_energy"]


def moved(orientation, turn):
    """Orientations (n, 2) or (n, 4) after the small rotations `turn` (n, 1 or 3) [rad]."""
    if orientation is None:
        return None
    if turn.shape[1] == 1:
        c, s = orientation.T
        cos, sin = np.cos(turn[:, 0]), np.sin(turn[:, 0])
        return np.stack([c * cos - s * sin, s * cos + c * sin], axis=1)
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    return product(np.concatenate([np.cos(0.5 * angle), np.sin(0.5 * angle) * turn / angle], axis=1), orientation)


def check_force_is_the_slope_of_the_energy(sim, position, orientation):
    """Along random displacements and rotations of all grains at once."""
    rng = np.random.default_rng(1)
    at_rest(sim, position, orientation)
    found = sim.contacts()
    k, l = found.first_id.values, found.second_id.values
    f = (found.normal_force * found.normal + found.tangential_force).values
    arm_k = found.point.values - position[k]
    arm_l = arm_k - found.branch.values
    assert len(k) > PAIRS // 2 and np.linalg.norm(f, axis=1).min() > 0.0
    h = 1e-7
    for _ in range(3):
        move, turn = rng.normal(size=position.shape), rng.normal(size=sim.state.angular_velocity.to_numpy().shape)
        energies = [at_rest(sim, position + s * h * move, moved(orientation, s * h * turn)) for s in (1.0, -1.0)]
        work = np.sum(f * (move[l] - move[k]), axis=1)
        if orientation is not None:
            work += np.sum(turn[l] * torques(arm_l, f), axis=1) - np.sum(turn[k] * torques(arm_k, f), axis=1)
        size = np.abs(work).sum()
        assert (energies[1] - energies[0]) / (2.0 * h) == pytest.approx(work.sum(), abs=1e-7 * size)


def torques(arm, force):
    """Torques (n, 1 or 3) of forces (n, dim)."""
    if force.shape[1] == 3:
        return np.cross(arm, force)
    return (arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])[:, None]


def run_collisions(sim, time):
    """Let the pairs collide for `time` [s]; positions and orientations of each pair where it was seen deepest."""
    state, deepest = sim.state, np.zeros(PAIRS)
    names = ("position", "orientation") if sim.grains.has("orientation") else ("position",)
    held = {name: getattr(state, name).to_numpy() for name in names}
    for _ in range(SAMPLES):
        sim.run(round(time / SAMPLES / sim.dt))
        found, depth = sim.contacts(), np.zeros(PAIRS)
        np.maximum.at(depth, found.first_id.values // 2, found.overlap.values)  # a gap within reach is negative
        deeper = np.repeat(depth > deepest, 2)
        deepest = np.maximum(deepest, depth)
        for name in names:
            held[name][deeper] = getattr(state, name).to_numpy()[deeper]
    assert sim.measure.sums()["contact_count"] <= 2  # crosses may hook into each other
    return held["position"], held.get("orientation")


@pytest.mark.validate  # each scene compiles for seconds
@pytest.mark.skipif(scenes.PRECISION == "f32", reason="derivatives to 1e-7 need f64")
@pytest.mark.parametrize(("name", "dim", "kind"), CASES)
def test_contract_on_a_shape(runtime, name, dim, kind):
    scene = collision(name, dim, kind)
    sim = scenes.simulate(scene)
    before, (start, _) = scenes.momenta(sim), scenes.energy(sim)
    time = 1.0 if (dim, kind) == RIMMED else 3.0  # before it has turned to its rim
    held = run_collisions(sim, time)
    # Action is reaction: the momenta are those of the start.
    linear, size, angular, angular_size = scenes.momenta(sim)
    assert np.abs(linear - before[0]).max() < 1e-12 * size
    assert np.abs(angular - before[2]).max() < 1e-10 * angular_size
    # Every effect has taken energy, from no pair less than none, and all together what is lost.
    left, lost = scenes.energy(sim)
    pairs = sim.state.dissipated.to_numpy().reshape(PAIRS, 2, -1).sum(axis=1)
    assert pairs.min() > -1e-6 * start / PAIRS
    assert np.all(pairs.sum(axis=0) > 1e-4 * start)
    assert left + lost == pytest.approx(start, rel=5e-3)
    # From another frame the same is seen; rounding grows where two contacts of a pair begin at nearly the same time.
    matrix, turn = turned(dim, np.random.default_rng(2))
    v, omega = sim.state.velocity.to_numpy(), sim.state.angular_velocity.to_numpy()
    sim.reset(collision(name, dim, kind, (matrix, turn)))
    run_collisions(sim, time)
    assert sim.state.velocity.to_numpy() == pytest.approx(v @ matrix.T, abs=1e-5 * SPEED)
    turned_omega = omega if dim == 2 else omega @ matrix.T
    assert sim.state.angular_velocity.to_numpy() == pytest.approx(turned_omega, abs=1e-5)
    sim.reset(scene)
    check_force_is_the_slope_of_the_energy(sim, *held)
