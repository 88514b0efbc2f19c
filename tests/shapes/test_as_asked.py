"""Makers of shapes give what was asked for: extents, area or volume, and inertia, to a hundredth."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.shapes import crossed_bars, ellipse, ellipsoid, from_planes, from_polygon, superellipse

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


@pytest.mark.parametrize(("length", "area", "polar"), [(1.0, 0.98, 0.96), (10.0, 0.92, 0.85)])
def test_the_area_of_bulging_sides_is_what_the_docstring_says(length, area, polar):
    vertices = 0.5 * np.array([(-length, -1), (length, -1), (length, 1), (-length, 1)])
    shape = from_polygon(vertices, 0.02, normalise=False)
    whole, moment = polygon_moments(vertices)
    assert (shape.measure / whole, shape.inertia[0] / moment) == pytest.approx((area, polar), abs=0.006)


@pytest.mark.parametrize(("length", "volume", "largest"), [(1, 0.91, 0.83), (26, 0.84, 0.72)])
def test_the_volume_of_bulging_faces_is_what_the_docstring_says(length, volume, largest):
    a = np.array((length, 1.0, 1.0))
    shape = from_planes(PLANES, 0.5 * np.concatenate([a, a]), 0.02, normalise=False)
    squares = a.prod() * a**2 / 12
    moments = np.sort(shape.inertia) / np.sort(squares.sum() - squares)
    assert (shape.measure / a.prod(), moments.min()) == pytest.approx((volume, largest), abs=0.006)


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


@pytest.mark.parametrize("aspect", [2.0, 10.0, 20.0])
@pytest.mark.parametrize("arcs", [30, 60])
def test_long_ellipses_are_as_long_as_asked(aspect, arcs):
    shape = ellipse(aspect, arcs)
    assert np.divide(*extents(shape, np.eye(2))) == pytest.approx(aspect, rel=0.01)
    assert shape.inertia[0] == pytest.approx(np.pi / 64 * (aspect + 1 / aspect), rel=0.01)


@pytest.mark.parametrize("aspect", [4.0, 10.0, 20.0])
@pytest.mark.parametrize(("arcs", "within"), [(30, 0.03), (60, 0.003)])
def test_long_superellipses_are_as_long_as_asked(aspect, arcs, within):
    assert np.divide(*extents(superellipse(aspect, 4.0, arcs), np.eye(2))) == pytest.approx(aspect, rel=within)


@pytest.mark.parametrize(
    ("axes", "faces", "within"), [((10, 1, 1), 60, 0.02), ((4, 1, 1), 60, 0.01), ((10, 1, 1), 150, 0.012)]
)
def test_long_ellipsoids_are_as_long_as_asked(axes, faces, within):
    got = np.sort(extents(ellipsoid(axes, faces), np.eye(3)))
    half = np.sort(np.array(axes, float)) / np.cbrt(np.prod(axes))
    assert got == pytest.approx(half, rel=within)


def test_an_ellipsoid_that_would_be_another_body_is_refused():
    with pytest.raises(lsm.InputError, match=r"axes = .*0.05\] of 60 faces .* 24 % off, must be within 10 %; raise"):
        ellipsoid((1.0, 1.0, 0.05))
    with pytest.raises(lsm.InputError, match=r"axes = .*0.01\]: 60 balls give no closed body, .*; raise faces"):
        ellipsoid((1.0, 1.0, 0.01))


def test_ellipses_and_ellipsoids_have_their_axes():
    plane = ellipse(6.0)
    assert np.divide(*extents(plane, np.eye(2))) == pytest.approx(6.0, rel=0.01)
    assert plane.inertia[0] == pytest.approx(np.pi / 64 * (6.0 + 1 / 6.0), rel=0.01)
    axes = np.array([1.0, 1.5, 2.0])
    solid = ellipsoid(axes, 150)
    half = 0.5 * axes / np.cbrt(axes.prod())
    assert np.sort(extents(solid, np.eye(3))) == pytest.approx(2 * half, rel=0.01)
    assert np.sort(solid.inertia) == pytest.approx(np.pi / 30 * (np.sum(half**2) - half[::-1] ** 2), rel=0.01)
