"""Contact of ball-polyhedra against brute force over directions, and its force against the gradient of the depth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from taichi_lsm.contact.polyhedron_table import PolyhedronTable
from taichi_lsm.core.runtime import ti
from tests.helpers import scenes

PAIRS = 80
STIFFNESS = 1e5


@ti.data_oriented
class Probe:
    """Depth, normal, arms and features of every listed pair, as the forces see them."""

    def __init__(self, sim):
        self.forces, self.pairs = sim.forces, sim.pairs
        self.found = ti.Vector.field(14, ti.f64, sim.pairs.capacity)

    @ti.kernel
    def measure(self):
        g, pairs = self.forces.grains, self.pairs
        for k in range(g.count[None]):
            for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                l = pairs.second_slot[s]
                depth, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, self.forces.geometry.shortest(k, l), 1)
                row = self.found[s]
                row[0], row[1], row[11], row[12] = g.id[k], depth, pairs.feature[s][0], pairs.feature[s][1]
                for axis in ti.static(range(3)):
                    row[2 + axis], row[5 + axis], row[8 + axis] = n[axis], arm_k[axis], arm_l[axis]
                self.found[s] = row

    def rows(self):
        """depth (p,), normal, arm_k, arm_l (p, 3), features (p, 2) of the pairs (0, 1), (2, 3), ... in this order."""
        self.measure()
        rows = self.found.to_numpy()[: self.pairs.row_start.to_numpy().max()]
        rows = rows[np.argsort(rows[:, 0])]
        assert np.array_equal(rows[:, 0], 2 * np.arange(PAIRS))
        return rows[:, 1], rows[:, 2:5], rows[:, 5:8], rows[:, 8:11], rows[:, 11:13]


def spread(count):
    """Nearly even unit vectors (count, 3)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)


DIRECTIONS = spread(1500)
DISC = np.stack([np.sqrt(np.arange(60) / 60) * f(2.39996 * np.arange(60)) for f in (np.cos, np.sin)], axis=1)


def separation(shapes, scale, turn, c, n):
    """s(n) = h_A(n) + h_B(-n) for unit vectors n (m, 3); grains at 0 and c."""
    if shapes[0].patch_count == 1:
        h_a = scale[0] * shapes[0].radius[0] * np.ones(len(n))
    else:
        h_a = scale[0] * shapes[0].support(turn[0].apply(n, inverse=True))
    return h_a + scale[1] * shapes[1].support(turn[1].apply(-n, inverse=True)) - n @ c


def least(shapes, scale, turn, c):
    """(depth, n): the best of many directions, refined in shrinking discs."""
    n = DIRECTIONS[np.argmin(separation(shapes, scale, turn, c, DIRECTIONS))]
    width = 0.1
    for _ in range(22):
        across = np.linalg.svd(n[None])[2][1:]
        near = n + width * DISC @ across
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        value = separation(shapes, scale, turn, c, near)
        n = near[np.argmin(value)]
        width *= 0.35 if np.argmin(value) < 20 else 0.9
    return value.min(), n


@pytest.fixture(scope="module")
def table():
    return [lsm.sphere(), *lsm.random_angular_polyhedra(6, 3), lsm.ball_of_faces(20), lsm.ball_of_faces(60)]


@pytest.fixture(scope="module")
def pairs(runtime, table):
    """Far-apart pairs at random orientations, overlapping by 1e-6 to 0.03 along a random line."""
    rng = np.random.default_rng(5)
    shape = rng.integers(1, len(table), (PAIRS, 2))
    shape[-10:, 0] = 0
    scale = rng.uniform(0.8, 1.25, (PAIRS, 2))
    turn = [[Rotation.random(random_state=rng), Rotation.random(random_state=rng)] for _ in range(PAIRS)]
    towards = DIRECTIONS[rng.integers(0, len(DIRECTIONS), PAIRS)]
    c = np.zeros((PAIRS, 3))
    for p in range(PAIRS):
        wanted = 10 ** rng.uniform(-6, np.log10(0.03))
        reach = scale[p].sum()
        for _ in range(8):
            gap, n = least((table[shape[p, 0]], table[shape[p, 1]]), scale[p], turn[p], reach * towards[p])
            reach += (gap - wanted) / (n @ towards[p])
            if abs(gap - wanted) < 0.01 * wanted:
                break
        c[p] = reach * towards[p]
    centre = 6.0 * np.stack(np.unravel_index(np.arange(PAIRS), (8, 4, 4)), axis=1)
    quaternion = np.array([[q.as_quat(scalar_first=True) for q in two] for two in turn]).reshape(-1, 4)
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
    return sim, Probe(sim), shape, scale, turn, c


def test_depth_and_normal_are_those_of_the_least_separation(pairs, table):
    sim, probe, shape, scale, turn, c = pairs
    depth, n, _, _, features = probe.rows()
    for p in range(PAIRS):
        expected, direction = least((table[shape[p, 0]], table[shape[p, 1]]), scale[p], turn[p], c[p])
        assert depth[p] == pytest.approx(expected, abs=scenes.tolerance(1e-9, 1e-4)), (p, features[p])
        assert np.linalg.norm(n[p] - direction) < scenes.tolerance(1e-3, 1e-2), (p, features[p])


def test_faces_edges_and_vertices_meet_in_all_combinations(pairs, table):
    *_, features = pairs[1].rows()
    met = set()
    for (i, j), (a, b) in zip(features.astype(int), pairs[2]):
        kinds = []
        for f, s in ((i, table[a]), (j, table[b])):
            faces = 1 if s.patch_count == 1 else s.face_count
            edges = 0 if s.patch_count == 1 else s.edge_count
            kinds.append("face" if f < faces else "edge" if f < faces + edges else "vertex")
        met.add("-".join(sorted(kinds)))
    assert {"edge-edge", "edge-face", "face-face", "face-vertex", "edge-vertex"} <= met


@pytest.mark.skipif(scenes.PRECISION == "f32", reason="differences need f64")
def test_force_and_torques_are_the_gradient_of_the_depth(pairs):
    sim, probe, *_ = pairs
    position, turn = sim.state.position.to_numpy(), sim.state.orientation.to_numpy()
    _, n, arm_k, arm_l, features = probe.rows()
    h, same = 1e-5, np.ones(PAIRS, bool)
    expected = {"move l": -n, "turn k": np.cross(arm_k, n), "turn l": -np.cross(arm_l, n)}
    for name, slope in expected.items():
        for axis in range(3):
            ends = []
            for side in (1, -1):
                x, q = position.copy(), turn.copy()
                step = side * h * np.eye(3)[axis]
                if name == "move l":
                    x[1::2] += step
                else:
                    which = slice(name == "turn l", None, 2)
                    rotation = Rotation.from_rotvec(step) * Rotation.from_quat(turn[which], scalar_first=True)
                    q[which] = rotation.as_quat(scalar_first=True)
                sim.state.position.from_numpy(x)
                sim.state.orientation.from_numpy(q)
                depth, _, _, _, now = probe.rows()
                same &= (now == features).all(axis=1)
                ends.append(depth)
            error = np.abs((ends[0] - ends[1]) / (2 * h) - slope[:, axis])
            assert error[same].max() < 1e-8, (name, axis)
    sim.state.position.from_numpy(position)
    sim.state.orientation.from_numpy(turn)
    assert same.mean() > 0.95


def test_a_sphere_needs_no_bounds(runtime):
    table = PolyhedronTable([lsm.sphere(), lsm.ball_of_faces(20)])
    assert table.features[0] == 1 and table.first_bound[0] == table.first_bound[1] == 0
    assert table.features[1] > 20
