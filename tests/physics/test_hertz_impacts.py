"""Impacts of Chung & Ooi (2011) with polyhedra of 60 faces, on a face, an edge and a vertex, against theory within 1 %.

Theory is Hertz's with the radius of the sphere of equal volume, and that of rigid bodies for what the impulses do: the
surface normal passes near the centre of such a grain, not through it. Spheres are in `test_chung_ooi.py`.
"""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.physics.test_chung_ooi import ALLOY, ALUMINA, ALUMINIUM, GLASS, LIMESTONE, MAGNESIUM, STEPS

pytestmark = [
    pytest.mark.validate,
    pytest.mark.usefixtures("runtime"),
    pytest.mark.skipif(scenes.PRECISION == "f32", reason="overlaps of 1e-5 of the coordinates need f64"),
]
SHAPE = lsm.shapes.ball_of_faces(60, 0.05)
N = np.array([1.0, 0.0, 0.0])  # from the first grain of a pair to the second, or into the wall


def rotation_between(a, b):
    """Unit quaternion that turns the unit vector a into b."""
    q = np.concatenate([[1.0 + a @ b], np.cross(a, b)])
    return q / np.linalg.norm(q)


def matrix_of(q):
    """Rotation matrix of a unit quaternion."""
    w, v = q[0], q[1:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def middles():
    """Body normals in the middle of a face, an edge and a vertex: those whose cones of normals are widest."""
    corners, found = SHAPE.corner_normals(), []
    faces, edges = SHAPE.face_count, SHAPE.face_count + SHAPE.edge_count
    for own in (corners[:faces], corners[faces:edges], corners[edges:]):
        pairs = [(n, n.mean(axis=0) / np.linalg.norm(n.mean(axis=0))) for n in own if len(n) > 2]
        found.append(max(pairs, key=lambda pair: -(pair[0] @ pair[1]).max())[1])
    return np.array(found)


MIDDLES = middles()


def test_the_normals_are_those_of_a_face_an_edge_and_a_vertex():
    ends = np.cumsum([SHAPE.face_count, SHAPE.edge_count, SHAPE.vertex_count])
    assert np.searchsorted(ends, SHAPE.feature_of(MIDDLES), side="right").tolist() == [0, 1, 2]


class Impact:
    """A face, an edge and a vertex that hit a face of another grain, or a rigid wall, at the same velocities.

    velocity (3,) [m s-1], angular_velocity (3,) [rad s-1]: of the first grain; the second has the opposite velocity, or
    rests if it is a wall.
    """

    def __init__(self, material, radius, velocity, angular_velocity=(0.0, 0.0, 0.0), wall=False):
        self.material, self.wall, self.bodies = material, wall, 1 if wall else 2
        d, count = 2.0 * radius, self.bodies * len(MIDDLES)
        q = np.array([rotation_between(n, N) for n in MIDDLES])
        arm = d * np.array([matrix_of(a) @ p for a, p in zip(q, SHAPE.support_points(MIDDLES), strict=True)])
        self.arms, velocities = [arm], [np.tile(velocity, (len(MIDDLES), 1))]
        rotation = [np.tile(angular_velocity, (len(MIDDLES), 1))]
        self.closing = velocity[0] * self.bodies
        places = np.zeros((len(MIDDLES), 3))
        places[:, 1] = 3.0 * d * np.arange(len(MIDDLES))
        orientations, positions = [q], [places]
        if not wall:
            other = rotation_between(MIDDLES[0], -N)
            self.arms.append(np.tile(d * matrix_of(other) @ SHAPE.support_points(MIDDLES[:1])[0], (len(MIDDLES), 1)))
            orientations.append(np.tile(other, (len(MIDDLES), 1)))
            positions.append(places + arm - self.arms[1])
            velocities.append(-velocities[0])
            rotation.append(0.0 * rotation[0])
        self.orientations = orientations
        mass = material.density * np.pi / 6.0 * d**3
        self.inverse = [self.inverse_inertia(o, material.density * d**5) for o in orientations]
        self.mobility = sum(
            np.eye(3) / mass - crossed(a) @ i @ crossed(a) for a, i in zip(self.arms, self.inverse, strict=True)
        )
        e_star = material.modulus / (1.0 - material.ratio**2) / self.bodies
        reduced = 1.0 / (N @ self.mobility @ N)
        root = np.sqrt(radius / self.bodies)
        self.overlap = (15.0 / 16.0 * reduced * self.closing**2 / (e_star * root)) ** 0.4
        self.force = 4.0 / 3.0 * e_star * root * self.overlap**1.5
        self.duration = 2.9432 * self.overlap / self.closing
        gap = 0.02 * self.overlap
        positions[0] = positions[0] - gap[:, None] * N
        if wall:  # one for all: the grains stand back from it
            positions[0] = positions[0] - arm[:, :1] * N
        walls = [lsm.PlaneWall("wall", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), rigid=True)] if wall else []
        self.scene = scenes.scene(
            np.stack(positions, axis=1).reshape(-1, 3),
            material.effects(),
            shapes=[SHAPE],
            diameter=d,
            density=material.density,
            orientation=np.stack(orientations, axis=1).reshape(-1, 4),
            velocity=np.stack(velocities, axis=1).reshape(-1, 3),
            angular_velocity=np.stack(rotation, axis=1).reshape(-1, 3),
            skin=0.2 * d,
            walls=walls,
            dt=self.duration.min() / STEPS,
        )
        self.count, self.before = count, self.surface_velocity(velocities, rotation)
        self.simulate()

    def inverse_inertia(self, orientations, unit):
        """World frame (3, 3, 3) of the impacts, `unit` that of the shape's moments."""
        turns = np.array([matrix_of(q) for q in orientations])
        return turns @ (np.eye(3) / (unit * SHAPE.inertia)) @ turns.transpose(0, 2, 1)

    def surface_velocity(self, velocity, rotation):
        """Of the first body against the second where they touch [m s-1]."""
        each = [v + np.cross(w, a) for v, w, a in zip(velocity, rotation, self.arms, strict=True)]
        return each[0] - (0.0 if self.wall else each[1])

    def simulate(self):
        """Run until all grains have parted; keeps peaks, durations and the surface velocity after."""
        if self.wall not in _sims:
            _sims[self.wall] = scenes.simulate(self.scene)
        sim = _sims[self.wall]
        sim.reset(self.scene)
        self.peak_overlap, self.peak_force, steps = np.zeros(3), np.zeros(3), np.zeros(3)
        for _ in range(4 * STEPS):
            sim.run(1)
            found = sim.contacts()
            k = found.first_id.values // self.bodies
            steps[k] += 1
            np.maximum.at(self.peak_overlap, k, found.overlap.values)
            np.maximum.at(self.peak_force, k, found.normal_force.values)
        assert found.sizes["contact"] == 0 and steps.min() > 0.5 * STEPS
        self.measured_duration = steps * sim.dt
        v, omega = (getattr(sim.state, n).to_numpy().reshape(3, -1, 3) for n in ("velocity", "angular_velocity"))
        bodies = range(self.bodies)
        self.after = self.surface_velocity([v[:, b] for b in bodies], [omega[:, b] for b in bodies])

    def check_peaks(self):
        """Force, overlap and duration of an elastic impact."""
        assert self.peak_force == pytest.approx(self.force, rel=0.01)
        assert self.peak_overlap == pytest.approx(self.overlap, rel=0.01)
        assert self.measured_duration == pytest.approx(self.duration, rel=0.01)

    def check_sliding(self):
        """Surface velocity after an impact that slides to its end: the impulse p (n + mu t) acts on rigid bodies."""
        slip = self.before - (self.before @ N)[:, None] * N
        along = N + self.material.friction * slip / np.linalg.norm(slip, axis=1, keepdims=True)
        change = np.einsum("cij,cj->ci", self.mobility, along)
        impulse = (1.0 + self.material.restitution) * (self.before @ N) / (change @ N)
        expected = self.before - impulse[:, None] * change
        slip_after = expected - (expected @ N)[:, None] * N
        assert np.all(np.sum(slip * slip_after, axis=1) > 0.1 * np.sum(slip * slip, axis=1))  # theory slides to the end
        assert np.abs(self.after - expected).max() < 0.01 * np.linalg.norm(self.before, axis=1).max()


_sims = {}  # compiled once with a wall and once without


def crossed(a):
    """Matrices (n, 3, 3) of the cross products with the vectors a (n, 3)."""
    return np.cross(a[:, None, :], np.eye(3)).transpose(0, 2, 1)


@pytest.mark.parametrize("material", [GLASS, LIMESTONE], ids=["glass", "limestone"])
def test_1_two_grains(material):
    impact = Impact(material, 0.01, (10.0, 0.0, 0.0))
    impact.check_peaks()
    assert impact.after @ N == pytest.approx(-impact.before @ N, rel=1e-3)


@pytest.mark.parametrize("material", [ALUMINIUM, MAGNESIUM], ids=["aluminium", "magnesium"])
def test_2_grain_and_rigid_wall(material):
    # The modulus of the grain alone: the wall is rigid by itself.
    halved = type(material)(0.5 * material.modulus, material.ratio, material.density)
    impact = Impact(halved, 0.1, (0.2, 0.0, 0.0), wall=True)
    impact.check_peaks()
    assert impact.after @ N == pytest.approx(-impact.before @ N, rel=1e-3)


@pytest.mark.parametrize("e", [0.1, 0.4, 0.7])
@pytest.mark.parametrize("wall", [False, True])
def test_3_restitution(wall, e):
    material = type(ALUMINA)(ALUMINA.modulus, ALUMINA.ratio, ALUMINA.density, restitution=e)
    impact = Impact(material, 2.5e-3, (3.9, 0.0, 0.0), wall=wall)
    assert -(impact.after @ N) / (impact.before @ N) == pytest.approx(e, rel=0.01)


@pytest.mark.parametrize("wall", [False, True])
def test_4_and_5_oblique_impacts(wall):
    """A hundredth of the paper's speed: the contact moves on flat faces as they turn, by a share that falls with it."""
    for angle in np.radians([45.0, 60.0, 75.0]):
        speed = 0.039 * np.array([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
        Impact(ALUMINA, 2.5e-3, tuple(speed), wall=wall).check_sliding()


@pytest.mark.parametrize("wall", [False, True])
def test_6_to_8_rotating_grains(wall):
    for omega in (0.16, 0.24):
        Impact(ALLOY, 0.1, (0.002, 0.0, 0.0), (0.0, 0.0, omega), wall=wall).check_sliding()
