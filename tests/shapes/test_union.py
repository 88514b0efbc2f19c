"""Unions of convex parts have the mass of what they cover."""

import numpy as np
import pytest
import shapely

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import place_part, union


def test_a_union_has_the_mass_of_what_it_covers():
    bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.1, normalise=False)
    parts = [place_part(bar, (0.0, 0.0)), place_part(bar, (1.0, 1.0), 0.5 * np.pi)]
    shape = union(parts, normalise=False)
    body = shapely.union_all([shapely.Polygon(p.outline(20000)) for p in parts])
    assert shape.measure == pytest.approx(body.area, rel=1e-7)
    moved = shapely.union_all([shapely.Polygon(p.outline(20000)) for p in shape.members])
    assert np.array(moved.centroid.coords[0]) == pytest.approx((0, 0), abs=1e-6)
    assert lsm.shapes.crossed_bars().stiffness_peak == 2.0
    with pytest.raises(InputError, match="hang together"):
        union([place_part(bar, (0.0, 0.0)), place_part(bar, (9.0, 0.0))])


def test_parts_may_overlap_round_a_hole():
    """Six bars in a ring: the hole counts against the area, whatever the sense of its points."""
    bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.1, normalise=False)
    angles = np.pi / 3 * np.arange(6)
    ring = [place_part(bar, 2.0 * np.array([np.cos(a), np.sin(a)]), a + 0.5 * np.pi) for a in angles]
    body = shapely.union_all([shapely.Polygon(part.outline(20000)) for part in ring])
    assert len(body.interiors) == 1
    assert union(ring, normalise=False).measure == pytest.approx(body.area, rel=1e-7)


def test_a_part_is_scaled_then_rotated_then_moved():
    bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.1, normalise=False)
    part = place_part(bar, (5.0, -1.0), 0.5 * np.pi, 2.0)
    assert part.outline(400).min(axis=0) == pytest.approx([4.0, -4.0], abs=0.1)
    assert part.outline(400).max(axis=0) == pytest.approx([6.0, 2.0], abs=0.1)


def test_wrong_parts_are_refused():
    bar, cube = lsm.shapes.regular_polygon(4), lsm.shapes.regular_polyhedron(6)
    with pytest.raises(InputError, match="none given"):
        union([])
    with pytest.raises(InputError, match="of one kind"):
        union([bar, cube])
    with pytest.raises(InputError, match="no convex shape"):
        union([lsm.shapes.crossed_bars(), bar])
    with pytest.raises(InputError, match="arc chain of 3 or more arcs"):
        place_part(lsm.disc(), (0.0, 0.0))
    with pytest.raises(InputError, match="must be an angle"):
        place_part(bar, (0.0, 0.0), np.eye(2))
    with pytest.raises(InputError, match=r"rotation has shape \(2, 2\)"):
        place_part(cube, (0.0, 0.0, 0.0), np.eye(2))
    with pytest.raises(InputError, match="arm_ratio = 1"):
        lsm.shapes.crossed_bars(1)


def test_a_union_in_3d_has_the_mass_of_what_it_covers():
    """Two balls of radius R = 0.5 at the distance s: less the lens pi (4 R + s)(2 R - s)^2/12 that they share."""
    s, ball = 0.6, lsm.shapes.ball_of_faces(1)
    pair = union([place_part(ball, (0.5 * s, 0.1, -0.2)), place_part(ball, (-0.5 * s, 0.1, -0.2))], normalise=False)
    assert pair.measure == pytest.approx(np.pi / 3 - np.pi * (2.0 + s) * (1.0 - s) ** 2 / 12, rel=1e-4)
    # About the axis int pi rho^4/2 dx, across int pi rho^2 (x^2 + rho^2/4) dx, rho^2 = R^2 - (x - s/2)^2 for x > 0.
    x, weight = np.polynomial.legendre.leggauss(20)
    x, weight = 0.5 * (0.5 + 0.5 * s) * (x + 1.0), 0.5 * (0.5 + 0.5 * s) * weight
    square = 0.25 - (x - 0.5 * s) ** 2
    axial, across = np.pi * weight @ square**2, 2.0 * np.pi * weight @ (square * (x**2 + 0.25 * square))
    assert pair.inertia == pytest.approx([axial, across, across], rel=2e-4)
