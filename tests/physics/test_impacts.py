"""Impacts with closed forms, after Chung & Ooi (2011), with linear springs; spheres and ball-polyhedra in one scene.

A fixed sphere of 50 diameters stands for the wall: over the slip of one impact its surface is flat to 1e-4.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests import scenes

WALL = 50.0  # diameter of the wall's sphere
MU, E, V = 0.3, 0.8, 1.0
STIFFNESS = 1e6
pytestmark = pytest.mark.skipif(scenes.PRECISION == "f32", reason="velocities to 1e-9 need f64")

SHAPES = {"sphere": lsm.sphere, "1 face": lambda: lsm.ball_of_faces(1), "60 faces": lambda: lsm.ball_of_faces(60, 0.01)}
CASES = {  # name: (velocity, spin) of the grain that hits the wall from above
    "restitution": ((0.0, -V, 0.0), (0.0, 0.0, 0.0)),
    "oblique 68": (V * np.tan(np.radians(68)), -V),
    "oblique 75": (V * np.tan(np.radians(75)), -V),
    "spin": ((0.0, -V, 0.0), (0.0, 0.0, 12.0)),
}
SLIDING = 3.5 * MU * (1 + E) * V  # change of the slip by a contact that slides to its end


@pytest.fixture(scope="module")
def outcome(runtime):
    """(velocity (3,), spin (3,)) after the impact, by shape and case."""
    shapes = [make() for make in SHAPES.values()]
    rng = np.random.default_rng(2)
    x, scale, which, v, omega, turn, glued, keys = [], [], [], [], [], [], [], []
    for s, name in enumerate(SHAPES):
        for case, (motion, spin) in CASES.items():
            if case.startswith("oblique"):
                motion, spin = (motion, spin, 0.0), (0.0, 0.0, 0.0)
            q = Rotation.random(random_state=rng)
            reach = 0.5 if name != "60 faces" else float(shapes[s].support(q.apply([[0, -1, 0]], inverse=True))[0])
            at = np.array([200.0 * len(keys), 0.0, 0.0])
            x += [at - (0.0, 0.5 * WALL, 0.0), at + (0.0, reach + 1e-3, 0.0)]
            scale += [WALL, 1.0]
            which += [0, s]
            v += [(0.0, 0.0, 0.0), motion]
            omega += [(0.0, 0.0, 0.0), spin]
            turn += [(1.0, 0.0, 0.0, 0.0), q.as_quat(scalar_first=True)]
            glued += [0, -1]
            keys.append((name, case))
    scene = scenes.scene(
        np.array(x),
        [lsm.LinearElastic(STIFFNESS), lsm.ViscousDamping(restitution=E), lsm.CoulombFriction(MU, 0.5 * STIFFNESS)],
        shapes=shapes,
        shape=np.array(which),
        scale=np.array(scale),
        velocity=np.array(v),
        spin=np.array(omega),
        orientation=np.array(turn),
        platen=np.array(glued),
        platens=[lsm.Platen("wall", [lsm.Fixed()] * 3)],
        area=1.0,
        density=1.0,
        skin=0.2,
        dt=1e-5,
    )
    sim = scenes.simulate(scene)
    sim.run(600)
    assert sim.measure.sums()["contact_count"] == 0
    v, omega = sim.state.velocity.to_numpy()[1::2], sim.state.spin.to_numpy()[1::2]
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
def test_a_spinning_sphere_on_a_wall(outcome, shape):
    v, omega = outcome[shape, "spin"]
    slip = 12.0 * 0.5
    assert (v[0] + 0.5 * omega[2]) / slip == pytest.approx(1 - SLIDING / slip, rel=0.03)
    assert v[0] == pytest.approx(-MU * (1 + E) * V, rel=0.01)


def test_the_polyhedron_of_one_face_is_the_sphere(outcome):
    for case in CASES:
        for mine, plain in zip(outcome["1 face", case], outcome["sphere", case]):
            assert mine == pytest.approx(plain, abs=1e-9)


def test_sixty_faces_are_nearly_a_sphere(outcome):
    for case in ("restitution", "oblique 68", "oblique 75"):
        v, plain = outcome["60 faces", case][0], outcome["sphere", case][0]
        assert np.abs(v - plain).max() < 0.15 * np.linalg.norm(plain)
