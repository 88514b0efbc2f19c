"""Periodic Voronoi tiles and polygon measures."""

import numpy as np
import pytest
from shapely import Polygon, affinity, unary_union

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import polygon_measures, voronoi_tiles


@pytest.mark.parametrize(("count", "relaxations"), [(4, 0), (60, 0), (60, 3)])
def test_tiles_fill_the_periodic_square_once(count, relaxations):
    length = 3.0
    tiles = [Polygon(tile) for tile in voronoi_tiles(count, length, seed=1, relaxations=relaxations)]
    assert len(tiles) == count
    assert all(tile.is_valid and tile.exterior.is_ccw for tile in tiles)
    assert all(tile.convex_hull.area == pytest.approx(tile.area, rel=1e-12) for tile in tiles)
    assert sum(tile.area for tile in tiles) == pytest.approx(length**2, rel=1e-12)
    shifts = [(length * i, length * j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    copies = [affinity.translate(tile, *shift) for tile in tiles for shift in shifts]
    square = Polygon([(0, 0), (length, 0), (length, length), (0, length)])
    # covering the square with tiles of the square's own area leaves no space for an overlap
    assert unary_union(copies).buffer(1e-9).contains(square)


def test_tiles_depend_on_the_seed_alone_and_scale_with_the_length():
    a, b = voronoi_tiles(20, 1.0, seed=5), voronoi_tiles(20, 2.0, seed=5)
    assert all(np.array_equal(2 * s, t) for s, t in zip(a, b))
    assert not np.array_equal(a[0], voronoi_tiles(20, 1.0, seed=6)[0])


def test_relaxation_makes_tiles_rounder_and_more_alike():
    def spread(relaxations):
        measures = [polygon_measures(t) for t in voronoi_tiles(200, 1.0, 3, relaxations)]
        return np.mean([m.aspect for m in measures]), np.std([m.area for m in measures])

    (aspect_0, area_0), (aspect_1, area_1), (aspect_5, area_5) = map(spread, (0, 1, 5))
    assert aspect_5 < aspect_1 < aspect_0
    assert area_5 < area_1 < area_0


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_measures_of_a_rectangle(angle):
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([(0, 0), (3, 0), (3, 2), (0, 2)]) @ np.array([[c, s], [-s, c]]) + 1000.0
    measures = polygon_measures(corners)
    assert measures.sides == 4
    assert measures.aspect == pytest.approx(1.5, rel=1e-10)
    assert measures.area == pytest.approx(6.0, rel=1e-10)
    assert measures.diameter == pytest.approx(np.sqrt(24 / np.pi), rel=1e-10)
    assert measures.centroid == pytest.approx(corners.mean(axis=0), rel=1e-14)


def test_measures_of_an_ellipse_and_a_triangle():
    t = 2 * np.pi / 500 * np.arange(500)
    ellipse = polygon_measures(np.column_stack([1.3 * np.cos(t), np.sin(t)]))
    assert (ellipse.sides, ellipse.aspect) == (500, pytest.approx(1.3, rel=1e-12))
    corners = np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 1.0)])
    assert polygon_measures(corners).centroid == pytest.approx([4 / 3, 1 / 3])
    # principal moments of a triangle: eigenvalues of area/36 [[16, -2], [-2, 1]]
    least, greatest = np.linalg.eigvalsh([[16.0, -2.0], [-2.0, 1.0]])
    assert polygon_measures(corners).aspect == pytest.approx(np.sqrt(greatest / least), rel=1e-12)


def test_extra_vertices_change_no_measure_but_the_sides():
    corners = np.array([(0, 0), (3, 0), (3, 2), (0, 2)], dtype=float)
    plain = polygon_measures(corners)
    more = polygon_measures(np.insert(corners, 1, [(0.5, 0), (1, 0), (2, 0)], axis=0))
    assert more.sides == 7
    assert (more.aspect, more.area) == pytest.approx((plain.aspect, plain.area), rel=1e-14)
    assert more.centroid == pytest.approx(plain.centroid, rel=1e-14)


def test_sides_of_no_length_do_not_count():
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    assert polygon_measures([*square, (0, 1e-9)]).sides == 4
    assert polygon_measures([*square, (0, 1e-3)]).sides == 5


def test_what_is_out_of_range_is_refused():
    with pytest.raises(InputError, match="counter-clockwise"):
        polygon_measures([(0, 0), (0, 1), (1, 0)])
    with pytest.raises(InputError, match="k >= 3"):
        polygon_measures([(0, 0), (0, 1)])
    with pytest.raises(InputError, match="count = 3"):
        voronoi_tiles(3, 1.0, 0)
    with pytest.raises(InputError, match="length = -1"):
        voronoi_tiles(10, -1.0, 0)
    with pytest.raises(InputError, match="relaxations = -1"):
        voronoi_tiles(10, 1.0, 0, relaxations=-1)
