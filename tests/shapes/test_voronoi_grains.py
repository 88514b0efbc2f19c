"""The angular family: exactly the grains that its definition promises."""

import numpy as np
import pytest
from shapely import Polygon

from taichi_lsm.shapes import polygon_measures, random_angular_shapes, voronoi_grains


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
        assert corner_angle > 0.8 * 2 * np.pi  # nearly all of the turn happens in sharp corners


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


def test_refusals():
    with pytest.raises(ValueError, match="count = -1"):
        random_angular_shapes(-1, seed=1)
    for corner_radius in (0.0, 0.5, np.nan):
        with pytest.raises(ValueError, match="corner_radius = "):
            random_angular_shapes(1, seed=1, corner_radius=corner_radius)
    for sides in ((2, 5), (7, 5)):
        with pytest.raises(ValueError, match="sides = "):
            random_angular_shapes(1, seed=1, sides=sides)
    with pytest.raises(ValueError, match="max_aspect = 1.0"):
        random_angular_shapes(1, seed=1, max_aspect=1.0)
    with pytest.raises(ValueError, match="widen one of them"):
        random_angular_shapes(1, seed=1, max_aspect=1.0001)
