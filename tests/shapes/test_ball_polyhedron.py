"""Rounded ball-polyhedra: cones that tile, a surface with a continuous normal, and mass against meshes and formulas."""

import numpy as np
import pytest
import trimesh

from taichi_lsm.shapes import ball_of_faces, tangent_ball_polyhedron
from taichi_lsm.shapes.geometry import even_directions

RNG = np.random.default_rng(1)


def stone(faces=20, seed=2):
    n = np.random.default_rng(seed).normal(size=(faces, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    spaced = even_directions(faces)
    n = spaced + 0.2 * n
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return tangent_ball_polyhedron(n * [1.0, 0.8, 0.7] / 2, n, 0.05, name="stone")


@pytest.fixture(scope="module", params=[12, 20, 60])
def shape(request):
    return ball_of_faces(request.param) if request.param != 20 else stone()


def directions(count=5000):
    n = RNG.normal(size=(count, 3))
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def test_the_cones_of_all_features_tile_the_sphere(shape):
    n = directions()
    worst = np.array(
        [
            (shape.bound[a:b] @ n.T - shape.bound_offset[a:b, None]).max(axis=0)
            for a, b in zip(shape.first_bound[:-1], shape.first_bound[1:])
        ]
    )
    assert np.array_equal((worst <= 1e-12).sum(axis=0), np.ones(len(n)))
    assert np.array_equal(np.argmin(worst, axis=0), shape.feature_of(n))
    assert shape.face_count - shape.edge_count + shape.vertex_count == 2


def test_every_bound_is_the_exact_negation_of_its_twin(shape):
    owner = np.repeat(np.arange(len(shape.feature_radius)), np.diff(shape.first_bound))
    rows = {(f, *a, b) for f, a, b in zip(shape.bound_next, -shape.bound, -shape.bound_offset)}
    mine = {(f, *a, b) for f, a, b in zip(owner, shape.bound, shape.bound_offset)}
    single = mine - rows  # guards of faces against false normals on the far side have no twin
    assert len(single) <= shape.face_count // 4 and all(f < shape.face_count for f, *_ in single)


def test_support_points_lie_on_the_surface_and_are_the_gradient_of_the_support_function(shape):
    n = directions(1500)
    x = shape.support_points(n)
    faces = slice(0, shape.face_count)
    big = shape.feature_radius[faces]
    away = np.linalg.norm(x[:, None] - shape.feature_centre[faces], axis=2)
    assert (away - big).max() < 1e-12
    assert (n @ x.T).max(axis=1) == pytest.approx(shape.support(n), abs=2e-2)
    assert np.all((n @ x.T).max(axis=1) <= shape.support(n) + 1e-12)
    h = 1e-6
    for axis in np.eye(3):
        ends = []
        for side in (h, -h):
            m = n + side * axis
            length = np.linalg.norm(m, axis=1)
            ends.append(length * shape.support(m / length[:, None]))
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(x @ axis, abs=1e-8)


def test_volume_centre_and_moments_are_those_of_a_fine_mesh(shape):
    errors = []
    for points in (5000, 20000):
        mesh = trimesh.Trimesh(*shape.mesh(points))
        errors.append(np.array([mesh.volume - shape.measure, *(mesh.moment_inertia.diagonal() - shape.inertia)]))
        assert np.abs(mesh.center_mass).max() < 1e-5
    products = mesh.moment_inertia - np.diag(mesh.moment_inertia.diagonal())
    assert np.abs(products).max() < 2e-6  # of the finer mesh
    assert np.abs((4 * errors[1] - errors[0]) / 3).max() < 2e-5  # the mesh is inscribed: its error falls as 1/points
    assert np.abs(errors[1]).max() < 3e-4
    assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)


def test_the_bounding_radius_and_the_lever_hold_and_are_met(shape):
    n = directions()
    x = shape.support_points(n)
    reach, lever = np.linalg.norm(x, axis=1).max(), np.linalg.norm(np.cross(x, n), axis=1).max()
    assert 0.97 * shape.bounding_radius < reach <= shape.bounding_radius * (1 + 1e-9)
    assert 0.9 * shape.lever < lever <= shape.lever * (1 + 1e-9)


def test_patches_hold_their_normals(shape):
    centre, radius, axis, angle = shape.patches()
    n = directions()
    f = shape.feature_of(n)
    row = np.where(f < shape.face_count, f, f - shape.edge_count)
    spherical = (f < shape.face_count) | (f >= shape.face_count + shape.edge_count)
    inside = np.sum(n * axis[np.minimum(row, len(axis) - 1)], axis=1)[spherical]
    assert np.all(inside >= np.cos(angle[row[spherical]]) - 1e-6)
    assert len(centre) == len(radius) == shape.patch_count
