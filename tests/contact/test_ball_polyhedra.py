"""Contact of ball-polyhedra against brute force over directions, and its force against the gradient of the depth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from taichi_lsm.contact.polyhedron_table import PolyhedronTable
from tests.helpers import scenes
from tests.helpers.contact_probe import ContactProbe

PAIRS = 32
STIFFNESS = 1e5


def spread(count):
    """Nearly even unit vectors (count, 3)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)


DIRECTIONS = spread(1500)
DISC = np.stack([np.sqrt(np.arange(60) / 60) * f(2.39996 * np.arange(60)) for f in (np.cos, np.sin)], axis=1)


def separation(shapes, scale, rotation, c, n):
    """s(n) = h_A(n) + h_B(-n) for unit vectors n (m, 3); grains at 0 and c."""
    if shapes[0].patch_count == 1:
        h_a = scale[0] * shapes[0].radius[0] * np.ones(len(n))
    else:
        h_a = scale[0] * shapes[0].support(rotation[0].apply(n, inverse=True))
    return h_a + scale[1] * shapes[1].support(rotation[1].apply(-n, inverse=True)) - n @ c


def least(shapes, scale, rotation, c, passes=22):
    """(depth, n): the best of many directions, refined in shrinking discs."""
    n = DIRECTIONS[np.argmin(separation(shapes, scale, rotation, c, DIRECTIONS))]
    width = 0.1
    for _ in range(passes):
        across = np.linalg.svd(n[None])[2][1:]
        near = n + width * DISC @ across
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        value = separation(shapes, scale, rotation, c, near)
        n = near[np.argmin(value)]
        width *= 0.35 if np.argmin(value) < 20 else 0.9
    return value.min(), n


@pytest.fixture(scope="module")
def table():
    return [
        lsm.sphere(),
        *lsm.shapes.random_angular_polyhedra(6, 3),
        lsm.shapes.ball_of_faces(20),
        lsm.shapes.ball_of_faces(60),
    ]


@pytest.fixture(scope="module")
def pairs(runtime, table):
    """Far-apart pairs at random orientations, overlapping by 1e-6 to 0.03 along a random line."""
    rng = np.random.default_rng(5)
    shape = rng.integers(1, len(table), (PAIRS, 2))
    shape[-10:, 0] = 0
    scale = rng.uniform(0.8, 1.25, (PAIRS, 2))
    rotation = [[Rotation.random(random_state=rng), Rotation.random(random_state=rng)] for _ in range(PAIRS)]
    towards = DIRECTIONS[rng.integers(0, len(DIRECTIONS), PAIRS)]
    c = np.zeros((PAIRS, 3))
    for p in range(PAIRS):
        wanted = 10 ** rng.uniform(-6, np.log10(0.03))
        reach = scale[p].sum()
        for _ in range(8):
            gap, n = least(
                (table[shape[p, 0]], table[shape[p, 1]]), scale[p], rotation[p], reach * towards[p], passes=8
            )
            reach += (gap - wanted) / (n @ towards[p])
            if abs(gap - wanted) < 0.1 * wanted:  # they need an overlap of about this size
                break
        c[p] = reach * towards[p]
    centre = 6.0 * np.stack(np.unravel_index(np.arange(PAIRS), (8, 4, 4)), axis=1)
    quaternion = np.array([[q.as_quat(scalar_first=True) for q in two] for two in rotation]).reshape(-1, 4)
    sim = scenes.simulate(
        scenes.scene(
            np.stack([centre, centre + c], axis=1).reshape(-1, 3),
            [lsm.LinearElastic(STIFFNESS)],
            shapes=table,
            shape_index=shape.ravel(),
            diameter=scale.ravel(),
            orientation=quaternion,
        )
    )
    return sim, ContactProbe(sim), shape, scale, rotation, c


def test_depth_and_normal_are_those_of_the_least_separation(pairs, table):
    sim, probe, shape, scale, rotation, c = pairs
    depth, n, _, _, features = probe.rows()
    assert len(depth) == PAIRS
    for p in range(PAIRS):
        expected, direction = least((table[shape[p, 0]], table[shape[p, 1]]), scale[p], rotation[p], c[p])
        assert depth[p] == pytest.approx(expected, abs=scenes.tolerance(1e-9, 1e-4)), (p, features[p])
        assert np.linalg.norm(n[p] - direction) < scenes.tolerance(1e-3, 1e-2), (p, features[p])


def test_faces_edges_and_vertices_meet_in_all_combinations(pairs, table):
    *_, features = pairs[1].rows()
    found = set()
    for (i, j), (a, b) in zip(features.astype(int), pairs[2]):
        kinds = []
        for f, s in ((i, table[a]), (j, table[b])):
            faces = 1 if s.patch_count == 1 else s.face_count
            edges = 0 if s.patch_count == 1 else s.edge_count
            kinds.append("face" if f < faces else "edge" if f < faces + edges else "vertex")
        found.add("-".join(sorted(kinds)))
    assert {"edge-edge", "edge-face", "face-face", "face-vertex", "edge-vertex"} <= found


@pytest.mark.skipif(scenes.PRECISION == "f32", reason="differences need f64")
def test_force_and_torques_are_the_gradient_of_the_depth(pairs):
    sim, probe, *_ = pairs
    position, rotation = sim.state.position.to_numpy(), sim.state.orientation.to_numpy()
    _, n, arm_k, arm_l, features = probe.rows()
    h, same = 1e-5, np.ones(PAIRS, bool)
    expected = {"move l": -n, "turn k": np.cross(arm_k, n), "turn l": -np.cross(arm_l, n)}
    for name, slope in expected.items():
        for axis in range(3):
            ends = []
            for side in (1, -1):
                x, q = position.copy(), rotation.copy()
                step = side * h * np.eye(3)[axis]
                if name == "move l":
                    x[1::2] += step
                else:
                    which = slice(name == "turn l", None, 2)
                    moved = Rotation.from_rotvec(step) * Rotation.from_quat(rotation[which], scalar_first=True)
                    q[which] = moved.as_quat(scalar_first=True)
                sim.state.position.from_numpy(x)
                sim.state.orientation.from_numpy(q)
                depth, _, _, _, now = probe.rows()
                same &= (now == features).all(axis=1)
                ends.append(depth)
            error = np.abs((ends[0] - ends[1]) / (2 * h) - slope[:, axis])
            assert error[same].max() < 1e-8, (name, axis)
    sim.state.position.from_numpy(position)
    sim.state.orientation.from_numpy(rotation)
    assert same.mean() > 0.95


def test_a_sphere_needs_no_bounds(runtime):
    table = PolyhedronTable([lsm.sphere(), lsm.shapes.ball_of_faces(20)])
    assert table.features[0] == 1 and table.first_bound[0] == table.first_bound[1] == 0
    assert table.features[1] > 20
