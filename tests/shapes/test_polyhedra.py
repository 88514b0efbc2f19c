"""Platonic solids and superellipsoids."""

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import ellipsoid, from_planes, regular_polyhedron, superellipsoid

BOX = np.concatenate([np.eye(3), -np.eye(3)])


@pytest.mark.parametrize(
    ("faces", "edges", "vertices"), [(4, 6, 4), (6, 12, 8), (8, 12, 6), (12, 30, 20), (20, 30, 12)]
)
def test_regular_polyhedra_have_the_features_of_plato(faces, edges, vertices):
    shape = regular_polyhedron(faces, 0.04)
    assert (shape.face_count, shape.edge_count, shape.vertex_count) == (faces, edges, vertices)
    assert shape.inertia == pytest.approx(np.full(3, shape.inertia[0]), rel=1e-6)
    assert shape.dilation == pytest.approx(0.04, abs=1e-10)


def test_an_ellipsoid_has_its_moments():
    shape = ellipsoid((1.0, 1.3, 1.7), 90, 0.02)
    a = np.array([1.0, 1.3, 1.7]) ** 2
    expected = np.sort([a[1] + a[2], a[0] + a[2], a[0] + a[1]])
    assert np.sort(shape.inertia) / shape.inertia.max() == pytest.approx(expected / expected.max(), rel=0.01)
    with pytest.raises(InputError, match="exponent"):
        superellipsoid((1, 1, 1), 50.0)


def test_a_cube_from_its_planes_has_their_size():
    """Volume of a cube of side 2 whose edges and corners are rounded with r, but for slightly bulging faces."""
    r, side = 0.1, 2.0
    core = side - 2 * r
    exact = core**3 + 6 * core**2 * r + 3 * np.pi * core * r**2 + 4 / 3 * np.pi * r**3
    errors = []
    for flatness in (50.0, 100.0):
        shape = from_planes(BOX, np.ones(6), r, flatness=flatness, normalise=False)
        assert (shape.face_count, shape.edge_count, shape.vertex_count) == (6, 12, 8)
        errors.append(exact - shape.measure)
    assert 0 < errors[0] < 0.02 * exact
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.02)  # the rise of a face goes as 1 / radius


@pytest.mark.parametrize(
    ("normals", "corner_radius", "message"),
    [
        (BOX[:3], 0.1, "n >= 4"),
        (BOX[1:], 0.1, "no bounded body"),
        (BOX[[0, 1, 2, 3]], 0.1, "no bounded body"),
        (BOX, 1.0, "corner_radius = 1.0.*inscribed radius, 1"),
        (BOX, 0.0, "corner_radius = 0.0"),
    ],
)
def test_planes_without_a_grain_are_refused(normals, corner_radius, message):
    with pytest.raises(InputError, match=message):
        from_planes(normals, np.ones(len(normals)), corner_radius)


def test_solids_that_do_not_exist_are_refused():
    with pytest.raises(InputError, match=r"faces = 7: must be one of \[4, 6, 8, 12, 20\]"):
        regular_polyhedron(7)
    with pytest.raises(InputError, match="faces = 5"):
        ellipsoid((1.0, 1.0, 1.0), 5)
    with pytest.raises(InputError, match="axes = "):
        ellipsoid((1.0, 0.0, 1.0))
