"""One grain per tile: inside its tile, apart from its neighbours, of about the size of the tile."""

import numpy as np
import pytest

from taichi_lsm.shapes import voronoi_packing, voronoi_tiles
from taichi_lsm.shapes.voronoi_tiles import polygon_measures

GAP = 0.02


@pytest.fixture(scope="module")
def packing():
    return voronoi_packing(36, 6.0, 5, corner_radius=0.08, gap=GAP)


def test_every_grain_keeps_the_gap_inside_its_tile(packing):
    shapes, place, diameter = packing
    for shape, centre, size, tile in zip(shapes, place, diameter, voronoi_tiles(36, 6.0, 5), strict=True):
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


def test_too_sharp_a_demand_is_refused():
    with pytest.raises(ValueError, match="corner_radius"):
        voronoi_packing(36, 6.0, 5, corner_radius=0.9, gap=GAP)
