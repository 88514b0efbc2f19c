"""The angular family: exactly the grains that its definition promises; and one grain in every tile of a packing."""

import numpy as np
import pytest
from shapely import Polygon

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import (
    polygon_measures,
    random_angular_shapes,
    regular_polygon,
    voronoi_grains,
    voronoi_packing,
    voronoi_tiles,
)

GAP = 0.02


@pytest.fixture(scope="module")
def shapes():
    return random_angular_shapes(30, seed=1)


def test_count_names_and_size(shapes):
    assert len(shapes) == 30
    assert len({shape.name for shape in shapes}) == 30
    assert [shape.measure for shape in shapes] == pytest.approx([np.pi / 4] * 30, rel=1e-13)
    assert {shape.patch_count for shape in shapes} == {10, 12, 14}  # a side and a corner each, 5 to 7 of them


@pytest.mark.parametrize("corner_radius", [0.02, 0.05, 0.1, 0.3])
def test_corner_radius_is_in_units_of_the_grain(corner_radius):
    for shape in random_angular_shapes(4, seed=2, corner_radius=corner_radius):
        assert shape.overlap_limit == pytest.approx(corner_radius, abs=1e-9)
        assert shape.radius.min() == shape.overlap_limit


def test_grains_are_about_their_centre_of_mass_and_convex(shapes):
    for shape in shapes:
        polygon = Polygon(shape.outline(5000))
        assert np.hypot(polygon.centroid.x, polygon.centroid.y) < 1e-6
        assert polygon.convex_hull.area == pytest.approx(polygon.area, rel=1e-12)


def test_grains_are_angular_and_not_slender(shapes):
    for shape in shapes:
        assert polygon_measures(shape.outline(2000)[:-1]).aspect < 1.52  # rounding adds to the tile's 1.5
        corner_angle = shape._spans()[1][shape.radius < 2 * shape.overlap_limit].sum()
        assert corner_angle > 0.8 * 2 * np.pi  # nearly all of the turning happens in sharp corners


def test_sides_are_as_flat_as_asked(shapes):
    """The same tiles, whose sides turn by a tenth of what they turned: arcs of ten times the radius, nearly."""
    flat = random_angular_shapes(3, seed=1, side_half_width=np.radians(0.3))
    for a, b in zip(flat, shapes):
        assert a.radius.max() / b.radius.max() == pytest.approx(10.0, rel=0.1)
        assert a.overlap_limit == pytest.approx(0.05, abs=1e-9)
    assert regular_polygon(3, side_half_width=np.radians(0.3)).overlap_limit == pytest.approx(0.05, abs=1e-9)
    for make in (random_angular_shapes, regular_polygon):
        with pytest.raises(InputError, match=r"side_half_width = 1e-08: must be >= 1e-06 and below pi/2"):
            make(5, 0.05 if make is regular_polygon else 1, side_half_width=1e-8)
    assert regular_polygon(5, side_half_width=1e-6).bounding_radius == pytest.approx(0.5633859, abs=1e-6)


def test_deterministic_and_independent_of_the_count(shapes):
    again = random_angular_shapes(5, seed=1)
    for a, b in zip(shapes, again):
        assert np.array_equal(a.centre, b.centre) and np.array_equal(a.seam, b.seam)
    assert not np.array_equal(shapes[0].centre, random_angular_shapes(1, seed=9)[0].centre)
    assert random_angular_shapes(0, seed=1) == []


def test_continues_past_one_batch_of_tiles(monkeypatch):
    monkeypatch.setattr(voronoi_grains, "TILES_PER_BATCH", 4)
    shapes = random_angular_shapes(9, seed=3)
    assert len(shapes) == 9
    assert len({shape.inertia[0] for shape in shapes}) == 9  # no batch is used twice


def test_sides_and_aspect_choose_the_tiles():
    hexagons = random_angular_shapes(6, seed=4, sides=(6, 6), max_aspect=1.2)
    assert {shape.patch_count for shape in hexagons} == {12}
    assert max(polygon_measures(shape.outline(500)[:-1]).aspect for shape in hexagons) < 1.21


def test_what_is_out_of_range_is_refused():
    with pytest.raises(InputError, match="count = -1"):
        random_angular_shapes(-1, seed=1)
    for corner_radius in (0.0, 0.5, np.nan):
        with pytest.raises(InputError, match="corner_radius = "):
            random_angular_shapes(1, seed=1, corner_radius=corner_radius)
    for sides in ((2, 5), (7, 5)):
        with pytest.raises(InputError, match="sides = "):
            random_angular_shapes(1, seed=1, sides=sides)
    with pytest.raises(InputError, match=r"max_aspect = 1.0"):
        random_angular_shapes(1, seed=1, max_aspect=1.0)
    with pytest.raises(InputError, match="widen one of them"):
        random_angular_shapes(1, seed=1, max_aspect=1.0001)


@pytest.fixture(scope="module")
def packing():
    return voronoi_packing(36, 6.0, 5, corner_radius=0.08, gap=GAP)


def test_every_grain_keeps_the_gap_inside_its_tile(packing):
    shapes, position, diameter = packing
    for shape, centre, size, tile in zip(shapes, position, diameter, voronoi_tiles(36, 6.0, 5), strict=True):
        outline = centre + size * shape.outline(200)
        side = np.roll(tile, -1, axis=0) - tile
        normal = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.linalg.norm(side, axis=1, keepdims=True)
        beyond = (outline[:, None] - tile).transpose(1, 0, 2) @ normal[..., None]
        assert beyond.max() < -GAP + 1e-6


def test_grains_fill_their_tiles_and_have_about_thirty_patches(packing):
    shapes, _, diameter = packing
    tiles = [polygon_measures(t).area for t in voronoi_tiles(36, 6.0, 5)]
    filled = 0.25 * np.pi * diameter**2 / tiles
    assert filled.min() > 0.75 and filled.max() < 1.0
    assert 25 <= np.mean([s.patch_count for s in shapes]) <= 35
    assert min(s.overlap_limit * d for s, d in zip(shapes, diameter)) == pytest.approx(0.08, rel=1e-9)


def test_support_is_the_farthest_point_of_the_outline(packing):
    shape = packing[0][0]
    angle = np.linspace(0, 2 * np.pi, 37)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert shape.support(normal) == pytest.approx((shape.outline(20000) @ normal.T).max(axis=0), abs=1e-6)


def test_a_corner_radius_too_large_for_a_tile_is_refused():
    with pytest.raises(InputError, match="corner_radius"):
        voronoi_packing(36, 6.0, 5, corner_radius=0.9, gap=GAP)


@pytest.mark.parametrize("sides", [4, 5, 9])
def test_regular_polygons_have_their_corners(sides):
    shape = regular_polygon(sides, 0.07)
    assert shape.overlap_limit == pytest.approx(0.07, abs=1e-10)
    assert shape.patch_count == 2 * sides


def test_wrong_polygons_and_packings_are_refused():
    with pytest.raises(InputError, match="sides = 2"):
        regular_polygon(2)
    with pytest.raises(InputError, match="arcs_per_corner = 0"):
        regular_polygon(5, arcs_per_corner=0)
    with pytest.raises(InputError, match=r"gap = -0.1"):
        voronoi_packing(36, 6.0, 5, 0.08, -0.1)
    with pytest.raises(InputError, match=r"gap = 3.0: leaves nothing"):
        voronoi_packing(36, 6.0, 5, 0.08, 3.0)
    with pytest.raises(InputError, match="seed = -1"):
        voronoi_packing(36, 6.0, -1, 0.08, GAP)
