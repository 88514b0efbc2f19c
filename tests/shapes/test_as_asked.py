"""Makers of shapes give what was asked for: extents, area or volume, and inertia, to a hundredth."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.shapes import crossed_bars, ellipse, ellipsoid, from_planes, from_polygon

PLANES = np.concatenate([np.eye(3), -np.eye(3)])
BOXES_2D = {f"box {a:g}:1": 0.5 * np.array([(-a, -1), (a, -1), (a, 1), (-a, 1)]) for a in (1.0, 1.9, 4.0, 10.0, 26.0)}
POLYGONS = {**BOXES_2D, "sliver": np.array([(0.0, 0.0), (8.0, 0.0), (7.0, 1.0)])}
BOXES_3D = [(1, 1, 1), (4, 1, 1), (26, 1, 1), (10, 10, 1), (30, 20, 1)]


def extents(shape, normals):
    """Distance of the two tangent planes square to each normal."""
    n = np.asarray(normals, float)
    if shape.dim == 3:
        return shape.support(n) + shape.support(-n)
    points = np.concatenate([part.outline(20_000) for part in shape.parts])
    return np.ptp(points @ n.T, axis=0)


def polygon_moments(vertices):
    """Area of a polygon and its polar second moment about the centre of mass."""
    twice, first, second = lsm.shapes.geometry.polygon_integrals(vertices - vertices.mean(axis=0))
    area, middle = twice / 2, first / (3 * twice)
    return area, np.trace(second) / 24 - area * middle @ middle


@pytest.mark.parametrize("name", POLYGONS)
def test_flat_sides_give_the_polygon(name):
    vertices = POLYGONS[name]
    area, polar = polygon_moments(vertices)
    shape = from_polygon(vertices, 0.01, 2e-4, normalise=False)
    # The corners of a sliver are rounded away; its height is not.
    axes = np.eye(2) if "box" in name else np.array([(0.0, 1.0)])
    assert extents(shape, axes) == pytest.approx(np.ptp(vertices @ axes.T, axis=0), rel=0.01)
    assert (shape.measure, shape.inertia[0]) == pytest.approx((area, polar), rel=0.01)


@pytest.mark.parametrize("name", BOXES_2D)
def test_bulging_sides_give_the_polygon_less_their_bulges(name):
    vertices = BOXES_2D[name]
    shape = from_polygon(vertices, 0.05, normalise=False)
    length, width = np.ptp(vertices, axis=0)
    assert extents(shape, np.eye(2)) == pytest.approx((length, width), rel=0.01)
    slope = min(np.tan(np.radians(1.5)), 0.25 * width / length)  # of half the turn of a long side
    bulges = 2 * (length**2 * slope + width**2 * np.tan(np.radians(1.5))) / 6
    assert shape.measure == pytest.approx(length * width - bulges - (4 - np.pi) * 0.05**2, rel=0.01)


@pytest.mark.parametrize("sides", BOXES_3D, ids=str)
def test_flat_faces_give_the_box(sides):
    a = np.array(sides, float)
    shape = from_planes(PLANES, 0.5 * np.concatenate([a, a]), 0.01, flatness=2000.0, normalise=False)
    assert shape.face_count == 6
    assert extents(shape, np.eye(3)) == pytest.approx(a, rel=0.01)
    squares = a.prod() * a**2 / 12
    assert shape.measure == pytest.approx(a.prod(), rel=0.01)
    assert np.sort(shape.inertia) == pytest.approx(np.sort(squares.sum() - squares), rel=0.01)


@pytest.mark.parametrize("sides", BOXES_3D, ids=str)
def test_bulging_faces_keep_the_box_as_long_and_wide(sides):
    a = np.array(sides, float)
    shape = from_planes(PLANES, 0.5 * np.concatenate([a, a]), 0.05, normalise=False)
    assert (shape.face_count, shape.edge_count, shape.vertex_count) == (6, 12, 8)
    assert extents(shape, np.eye(3)) == pytest.approx(a, rel=0.01)
    assert shape.measure > 0.8 * a.prod()  # a face stands out by an eighth of the width at most


@pytest.mark.parametrize("arm_ratio", [2.0, 3.0, 8.0])
def test_bars_of_a_cross_are_as_slender_as_asked(arm_ratio):
    bar = crossed_bars(arm_ratio, 0.02).parts[0]
    points = bar.outline(20_000)
    assert np.divide(*np.ptp(points, axis=0)) == pytest.approx(arm_ratio, rel=0.01)


def test_ellipses_and_ellipsoids_have_their_axes():
    plane = ellipse(6.0)
    assert np.divide(*extents(plane, np.eye(2))) == pytest.approx(6.0, rel=0.01)
    assert plane.inertia[0] == pytest.approx(np.pi / 64 * (6.0 + 1 / 6.0), rel=0.01)
    axes = np.array([1.0, 1.5, 2.0])
    solid = ellipsoid(axes, 150)
    half = 0.5 * axes / np.cbrt(axes.prod())
    assert np.sort(extents(solid, np.eye(3))) == pytest.approx(2 * half, rel=0.01)
    assert np.sort(solid.inertia) == pytest.approx(np.pi / 30 * (np.sum(half**2) - half[::-1] ** 2), rel=0.01)
