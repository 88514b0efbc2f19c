"""Polygons, planes and directions against closed forms."""

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes.geometry import (
    cross_2d,
    deepest_point,
    even_directions,
    least_tangent_radii,
    polygon_integrals,
    principal_frame,
    unit_normals,
)


def test_integrals_of_a_rectangle_change_sign_with_its_sense():
    x, y, w, h = 0.5, -0.25, 3.0, 2.0  # lower left corner, sides
    corners = np.array([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
    middle, area = np.array([x + 0.5 * w, y + 0.5 * h]), w * h
    second = area * (np.diag([w**2, h**2]) / 12 + np.outer(middle, middle))
    for vertices, sign in ((corners, 1.0), (corners[::-1], -1.0)):
        twice_area, six_first, second_24 = polygon_integrals(vertices)
        assert twice_area == pytest.approx(sign * 2 * area, rel=1e-14)
        assert six_first == pytest.approx(sign * 6 * area * middle, rel=1e-14)
        assert second_24 == pytest.approx(sign * 24 * second, rel=1e-14)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_deepest_point_is_the_middle_of_a_box(dim):
    low, high = np.array([1.0, -2.0, 5.0])[:dim], np.array([7.0, 1.0, 9.0])[:dim]
    normals, distances = np.concatenate([np.eye(dim), -np.eye(dim)]), np.concatenate([high, -low])
    x, depth = deepest_point(normals, distances)
    assert depth == pytest.approx(1.5)  # half of the shortest side
    assert x[1] == pytest.approx(-0.5)
    with pytest.raises(InputError, match="enclose no body"):
        deepest_point(normals[:1], distances[:1])


def test_tangent_circles_through_the_points_of_a_circle_are_that_circle():
    n = unit_normals(2 * np.pi / 7 * np.arange(7))
    assert least_tangent_radii(3.0 * n, n, 6.0) == pytest.approx(3.0, rel=1e-12)
    assert np.isinf(least_tangent_radii(np.zeros((1, 2)), n[:1], 1.0))


def test_normals_and_directions_are_unit_vectors_of_zero_mean():
    n = unit_normals([0.0, 0.5 * np.pi])
    assert cross_2d(n[0], n[1]) == pytest.approx(1.0)
    u = even_directions(1000)
    assert np.linalg.norm(u, axis=1) == pytest.approx(1.0, abs=1e-14)
    assert np.abs(u.mean(axis=0)).max() < 1e-3
    assert u.T @ u / len(u) == pytest.approx(np.eye(3) / 3, abs=2e-3)


def test_the_principal_frame_of_a_rotated_box_is_its_edges():
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    edges = np.array([3.0, 2.0, 1.0])
    moments, frame = principal_frame(rotation @ np.diag(edges**2 / 12) @ rotation.T)
    assert moments == pytest.approx([5 / 12, 10 / 12, 13 / 12])  # (b^2 + c^2)/12, ascending
    assert np.abs(frame.T @ rotation) == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert principal_frame(np.diag([2.0, 3.0]))[0] == pytest.approx([5.0])
