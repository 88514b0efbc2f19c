"""Tiles of a periodic cube against their definition, and one grain inside every tile."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import polyhedra
from taichi_lsm.shapes.laguerre_tiles import Tile, grain_in_tile, laguerre_packing, laguerre_tiles, without_corners

MODULE = sys.modules["taichi_lsm.shapes.laguerre_tiles"]  # the package has a function of this name
LENGTH = 3.0
IMAGES = LENGTH * np.array(np.meshgrid(*[(-1, 0, 1)] * 3)).reshape(3, -1).T
RADII = np.random.default_rng(0).uniform(0.2, 0.6, 24)


@pytest.fixture(scope="module", params=[None, RADII], ids=["voronoi", "laguerre"])
def tiling(request):
    radii = np.zeros(24) if request.param is None else request.param
    return laguerre_tiles(24, LENGTH, 7, radii=request.param), radii


def test_volumes_fill_the_cube_and_are_those_of_the_corners(tiling):
    tiles, _ = tiling
    assert sum(tile.volume for tile in tiles) == pytest.approx(LENGTH**3, rel=1e-12)
    for tile in tiles:
        assert tile.volume == pytest.approx(ConvexHull(tile.vertices).volume, rel=1e-9)


def test_planes_and_corners_describe_the_same_body(tiling):
    for tile in tiling[0]:
        over = (tile.vertices - tile.site) @ tile.normals.T - tile.distances
        assert over.max() < 1e-9
        assert np.all((over > -1e-7).sum(axis=0) >= 3)  # every plane carries a face
        assert np.linalg.norm(tile.normals, axis=1) == pytest.approx(1.0, abs=1e-14)


def test_a_point_belongs_to_the_tile_of_least_power(tiling):
    """Brute force over all sites and their images; a tile that crosses the border holds its points one period off."""
    tiles, radii = tiling
    points = LENGTH * np.random.default_rng(1).random((400, 3))
    images = np.array([tile.site + IMAGES for tile in tiles])
    power = np.sum((points[:, None, None] - images) ** 2, axis=3) - (radii**2)[:, None]
    owner, image = np.divmod(power.reshape(len(points), -1).argmin(axis=1), len(IMAGES))
    for x, k, j in zip(points, owner, image):
        assert np.all((x - images[k, j]) @ tiles[k].normals.T <= tiles[k].distances + 1e-12)


def test_both_sides_have_a_plane_in_the_same_place(tiling):
    tiles, _ = tiling
    for k, tile in enumerate(tiles):
        for n, h, other in zip(tile.normals, tile.distances, tile.neighbours):
            twin = tiles[other]
            back = np.flatnonzero((twin.neighbours == k) & (np.abs(twin.normals + n).max(axis=1) < 1e-12))
            assert len(back) == 1
            apart = h + twin.distances[back[0]]  # from site to site along the common normal
            between = twin.site - tile.site - apart * n
            assert np.abs(between / LENGTH - np.round(between / LENGTH)).max() < 1e-12


def test_larger_balls_get_larger_tiles():
    volumes = [tile.volume for tile in laguerre_tiles(24, LENGTH, 7, radii=RADII)]
    assert np.corrcoef(volumes, RADII**3)[0, 1] > 0.9
    equal = [tile.volume for tile in laguerre_tiles(24, LENGTH, 7, radii=np.full(24, 0.4))]
    assert equal == pytest.approx([tile.volume for tile in laguerre_tiles(24, LENGTH, 7)], rel=1e-9)


def test_lloyd_steps_make_tiles_rounder_and_more_equal():
    def spread_of(relaxations):
        return np.std([tile.volume for tile in laguerre_tiles(60, 1.0, 2, relaxations)])

    assert spread_of(3) < 0.5 * spread_of(0)


def test_the_length_only_scales_and_the_seed_decides():
    small, large = laguerre_tiles(9, 1.0, 3), laguerre_tiles(9, 250.0, 3)
    for a, b in zip(small, large):
        assert 250.0 * a.vertices == pytest.approx(b.vertices, rel=1e-12)
        assert np.array_equal(a.neighbours, b.neighbours)
    assert not np.allclose(small[0].site, laguerre_tiles(9, 1.0, 4)[0].site)


def test_one_site_owns_the_whole_cube():
    (tile,) = laguerre_tiles(1, 2.0, 0)
    assert tile.volume == pytest.approx(8.0, rel=1e-14)
    assert sorted(map(tuple, np.round(tile.normals, 12))) == sorted(map(tuple, np.concatenate([np.eye(3), -np.eye(3)])))


@pytest.mark.parametrize(
    ("field", "value"),
    [("count", 0), ("length", 0.0), ("length", np.inf), ("relaxations", -1), ("radii", [1.0, -1.0]), ("radii", [1.0])],
)
def test_tiles_refuse_what_is_out_of_range(field, value):
    with pytest.raises(InputError, match=f"{field} = "):
        laguerre_tiles(**{"count": 2, "length": 1.0, "seed": 1, field: value})


def test_a_ball_that_swallows_others_is_named_as_the_cause():
    with pytest.raises(InputError, match=r"radii: sites .* get no tile"):
        laguerre_tiles(24, LENGTH, 7, radii=np.where(np.arange(24) == 0, 2.5, 0.0))


def excess(shape, centre, frame, tile, gap, diameter=1.0):
    """How far a grain at its position sticks out of the planes drawn in by the gap; negative if it has space."""
    reach = diameter * shape.support(tile.normals @ frame) + tile.normals @ (centre - tile.site)
    return (reach - (tile.distances - gap)).max()


@pytest.mark.parametrize("radii", [None, np.linspace(0.4, 0.7, 8)], ids=["voronoi", "laguerre"])
def test_every_grain_keeps_the_gap_inside_its_tile(radii):
    shapes, positions, diameters, orientations = laguerre_packing(8, 2.0, 5, 0.06, 0.02, radii=radii)
    tiles = laguerre_tiles(8, 2.0, 5, radii=radii)
    for shape, x, d, q, tile in zip(shapes, positions, diameters, orientations, tiles, strict=True):
        frame = Rotation.from_quat(q, scalar_first=True).as_matrix()
        assert excess(shape, x, frame, tile, 0.02, d) < 1e-9
        assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)
        assert d * shape.dilation == pytest.approx(0.06, rel=1e-9)
        assert 0.7 < np.pi / 6 * d**3 / tile.volume < 1.0


def test_a_plane_too_small_for_a_face_of_its_own_is_kept_all_the_same(monkeypatch):
    """A cube with a corner cut off, where faces as small as the cut are left out: the first fit reaches through it."""
    monkeypatch.setattr(polyhedra, "LEAST_FACE", 0.04)
    monkeypatch.setattr(polyhedra, "LEAST_SECTION", 1.0)
    normals = np.concatenate([np.eye(3), -np.eye(3), np.ones((1, 3)) / np.sqrt(3)])
    distances = np.concatenate([np.full(6, 0.5), [np.sqrt(0.75) - 0.12]])
    tile = Tile(np.array([5.0, 6.0, 7.0]), normals, distances, np.zeros(7, int), np.zeros((0, 3)), 1.0)
    fits = []
    original = MODULE.from_planes_and_frame

    def recorded(*args, **options):
        fits.append(original(*args, **options))
        return fits[-1]

    monkeypatch.setattr(MODULE, "from_planes_and_frame", recorded)
    shape, centre, frame = grain_in_tile(tile, 0.02, 0.01)
    assert fits[0][0].face_count == 6
    assert excess(fits[0][0], tile.site + fits[0][1], fits[0][2], tile, 0.01) > 1e-3
    assert excess(shape, centre, frame, tile, 0.01) < 1e-12
    assert shape.dilation == pytest.approx(0.02, rel=1e-12)
    assert shape.measure > 0.7


def test_a_grain_that_never_fits_is_refused(monkeypatch):
    tile = laguerre_tiles(1, 2.0, 0)[0]
    big = SimpleNamespace(support=lambda n: np.full(len(n), 1.5), bounding_radius=1.5)
    monkeypatch.setattr(MODULE, "from_planes_and_frame", lambda *args, **options: (big, np.zeros(3), np.eye(3)))
    with pytest.raises(InputError, match="sticks out"):
        grain_in_tile(tile, 0.1, 0.0)


def test_a_packing_refuses_what_does_not_fit():
    with pytest.raises(InputError, match=r"tile 0.*corner_radius = 0.9"):
        laguerre_packing(8, 2.0, 5, 0.9, 0.0)
    with pytest.raises(InputError, match=r"gap = -0.1"):
        laguerre_packing(8, 2.0, 5, 0.05, -0.1)


def test_cut_corners_add_faces_and_stay_inside(tiling):
    (tile, *_), _ = tiling
    cut = without_corners(tile, 3)
    assert len(cut.normals) == len(tile.normals) + 3 and (cut.neighbours[-3:] == -1).all()
    beyond = (cut.vertices - tile.site) @ cut.normals.T - cut.distances
    assert beyond.max() < 1e-9 * LENGTH
    reach, whole = (np.linalg.norm(t.vertices - tile.site, axis=1).max() for t in (cut, tile))
    assert reach < whole
    with pytest.raises(InputError, match="chamfers = -1"):
        without_corners(tile, -1)


def test_tiles_of_a_volume_hold_their_grains_apart():
    shapes, position, diameter, orientation = laguerre_packing(12, 2.0, 3, 0.06, 0.02)
    n = np.random.default_rng(0).normal(size=(400, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    frames = [Rotation.from_quat(q, scalar_first=True).as_matrix() for q in orientation]
    gaps = []
    for k in range(12):
        for l in range(k + 1, 12):
            d = position[l] - position[k]
            d -= 2.0 * np.round(d / 2.0)
            near, width = n, 0.3
            for _ in range(8):  # the direction that separates the two best
                h = diameter[k] * shapes[k].support(near @ frames[k]) + diameter[l] * shapes[l].support(
                    -near @ frames[l]
                )
                best = near[np.argmax(near @ d - h)]
                gap = (near @ d - h).max()
                near = np.concatenate([best[None], best + width * n[:150]])
                near /= np.linalg.norm(near, axis=1, keepdims=True)
                width *= 0.4
            gaps.append(gap)
    assert min(gaps) > 0.0
    assert 0.6 < (np.pi / 6 * diameter**3).sum() / 8.0 < 1.0
