"""Impacts with closed forms, after Chung & Ooi (2011), with linear springs; spheres and ball-polyhedra in one scene.

A fixed sphere of 50 diameters stands for the wall: over the slip of one impact its surface is flat to 1e-4.
"""

import functools
import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers import scenes

WALL = 50.0  # diameter of the wall's sphere
MU, E, V = 0.3, 0.8, 1.0
STIFFNESS = 1e6
pytestmark = [
    pytest.mark.validate,  # grains of up to 240 faces compile for half a minute
    pytest.mark.skipif(scenes.PRECISION == "f32", reason="velocities to 1e-9 need f64"),
]

FACES = (12, 60, 240)
SHAPES = {"sphere": lsm.sphere, "1 face": lambda: lsm.shapes.ball_of_faces(1)}
SHAPES |= {f"{n} faces": functools.partial(lsm.shapes.ball_of_faces, n, 0.01) for n in FACES}
AIMS = ("face", "edge", "vertex")  # what of a polyhedron hits the wall; an edge's cone ends in the seams to its faces
CASES = {  # name: (velocity, angular velocity) of the grain that hits the wall from above
    "restitution": ((0.0, -V, 0.0), (0.0, 0.0, 0.0)),
    "oblique 68": (V * np.tan(np.radians(68)), -V),
    "oblique 75": (V * np.tan(np.radians(75)), -V),
    "angular_velocity": ((0.0, -V, 0.0), (0.0, 0.0, 12.0)),
}
STRAIGHT = [case for case in CASES if case != "angular_velocity"]  # an angular grain that rotates hits the wall twice
SLIDING = 3.5 * MU * (1 + E) * V  # change of the slip by a contact that slides to its end


def aimed(shape, what, rng):
    """Rotation that turns a random face, edge or vertex of the shape down; of an edge or vertex any normal it holds."""
    if what == "sphere":
        return Rotation.random(random_state=rng)
    first = {"face": 0, "edge": shape.face_count, "vertex": shape.face_count + shape.edge_count}[what]
    count = {"face": shape.face_count, "edge": shape.edge_count, "vertex": shape.vertex_count}[what]
    n = rng.normal(size=(2000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    feature = shape.feature_of(n)
    held = n[(feature >= first) & (feature < first + count)]
    turn, _ = Rotation.align_vectors([[0.0, -1.0, 0.0]], held[:1])
    return Rotation.from_rotvec([0.0, rng.uniform(0, 2 * np.pi), 0.0]) * turn


@pytest.fixture(scope="module")
def outcome(runtime):
    """Impacts of all shapes but the finest, which takes long to make."""
    return impacts([name for name in SHAPES if name != f"{FACES[-1]} faces"])


def impacts(names):
    """(velocity (3,), angular velocity (3,)) after the impact, by shape, case and what was aimed at."""
    shapes = [SHAPES[name]() for name in names]
    rng = np.random.default_rng(2)
    x, scale, which, v, omega, turn, glued, keys = [], [], [], [], [], [], [], []
    for s, name in enumerate(names):
        aims = AIMS if name.endswith("faces") else ("sphere",)
        for case, aim in itertools.product(CASES if len(aims) == 1 else STRAIGHT, aims):
            motion, angular_velocity = CASES[case]
            if case.startswith("oblique"):
                motion, angular_velocity = (motion, angular_velocity, 0.0), (0.0, 0.0, 0.0)
            q = aimed(shapes[s], aim, rng)
            down = q.apply([[0, -1, 0]], inverse=True)
            reach = float(shapes[s].support(down)[0]) if name.endswith("faces") else 0.5
            at = np.array([200.0 * len(keys), 0.0, 0.0])
            x += [at - np.array([0.0, 0.5 * WALL, 0.0]), at + np.array([0.0, reach + 1e-3, 0.0])]
            scale += [WALL, 1.0]
            which += [0, s]
            v += [(0.0, 0.0, 0.0), motion]
            omega += [(0.0, 0.0, 0.0), angular_velocity]
            turn += [(1.0, 0.0, 0.0, 0.0), q.as_quat(scalar_first=True)]
            glued += [0, -1]
            keys.append((name, case, aim) if name.endswith("faces") else (name, case))
    scene = scenes.scene(
        np.array(x),
        [lsm.LinearElastic(STIFFNESS), lsm.ViscousDamping(restitution=E), lsm.CoulombFriction(MU, 0.5 * STIFFNESS)],
        shapes=shapes,
        shape_index=np.array(which),
        diameter=np.array(scale),
        velocity=np.array(v),
        angular_velocity=np.array(omega),
        orientation=np.array(turn),
        platen_index=np.array(glued),
        platens=[lsm.Platen("wall", [lsm.Fixed()] * 3)],
        area=1.0,
        density=1.0,
        skin=0.2,
        dt=1e-5,
    )
    sim = scenes.simulate(scene)
    sim.run(600)
    assert sim.measure.sums()["contact_count"] == 0
    v, omega = sim.state.velocity.to_numpy()[1::2], sim.state.angular_velocity.to_numpy()[1::2]
    return {key: (v[i], omega[i]) for i, key in enumerate(keys)}


@pytest.mark.parametrize("shape", ["sphere", "1 face"])
def test_a_normal_impact_returns_with_the_coefficient_of_restitution(outcome, shape):
    v, omega = outcome[shape, "restitution"]
    assert v[1] == pytest.approx(E * V, rel=0.01)
    assert np.abs(omega).max() < 1e-9 and abs(v[0]) < 1e-9


@pytest.mark.parametrize("shape", ["sphere", "1 face"])
@pytest.mark.parametrize("case", ["oblique 68", "oblique 75"])
def test_an_oblique_impact_that_slides(outcome, shape, case):
    v, omega = outcome[shape, case]
    before = CASES[case][0]
    assert v[0] / before == pytest.approx(1 - MU * (1 + E) * V / before, rel=0.01)
    assert abs(omega[2]) == pytest.approx(2.5 * MU * (1 + E) * V / 0.5, rel=0.02)


@pytest.mark.parametrize("shape", ["sphere", "1 face"])
def test_a_rotating_sphere_on_a_wall(outcome, shape):
    v, omega = outcome[shape, "angular_velocity"]
    slip = 12.0 * 0.5
    assert (v[0] + 0.5 * omega[2]) / slip == pytest.approx(1 - SLIDING / slip, rel=0.03)
    assert v[0] == pytest.approx(-MU * (1 + E) * V, rel=0.01)


def test_the_polyhedron_of_one_face_is_the_sphere(outcome):
    for case in CASES:
        for mine, plain in zip(outcome["1 face", case], outcome["sphere", case]):
            assert mine == pytest.approx(plain, abs=1e-9)


def worst_error(outcome, faces, aim):
    """Greatest relative difference of the velocities after an impact from those of the sphere."""
    velocity = {case: (outcome[f"{faces} faces", case, aim][0], outcome["sphere", case][0]) for case in STRAIGHT}
    return max(np.linalg.norm(mine - plain) / np.linalg.norm(plain) for mine, plain in velocity.values())


@pytest.mark.parametrize("aim", AIMS)
def test_with_more_faces_impacts_come_nearer_to_those_of_the_sphere(outcome, aim):
    coarse, fine = (worst_error(outcome, faces, aim) for faces in FACES[:2])
    assert coarse > fine


@pytest.mark.validate
def test_with_more_faces_impacts_become_those_of_the_sphere(runtime):
    """What is left is the arm of the normal force, which falls with the width of a face: as faces**-0.5."""
    outcome = impacts(list(SHAPES))
    for aim in AIMS:
        error = [worst_error(outcome, faces, aim) for faces in FACES]
        assert error[0] > error[1] > error[2]
        assert error[2] < 0.05
