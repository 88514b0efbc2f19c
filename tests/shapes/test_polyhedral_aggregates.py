"""Breakable grains in 3D: cells that fill a polyhedron, their common faces, and the rounded pieces within them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import angular_aggregate, polyhedral_aggregate, polyhedral_aggregates
from taichi_lsm.shapes.geometry import polyhedron_integrals
from taichi_lsm.shapes.polyhedra import corners_of
from taichi_lsm.shapes.polyhedral_aggregates import _tile, cut_grain, shared_area, whole_grain

CUBE = np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, 0.5)
PIECES, CORNER, SEED = 7, 0.08, 5


@pytest.fixture(scope="module")
def grain():
    return polyhedral_aggregate(PIECES, SEED, CORNER)


@pytest.fixture(scope="module")
def tiles():
    """The cells of that grain, drawn with the same numbers."""
    rng = np.random.default_rng(SEED)
    planes = whole_grain(rng)
    return planes, cut_grain(planes, PIECES, rng)


def test_pieces_in_2d_are_joined_too():
    """Seed 40 draws two tiles that share no side at first: the grain was two."""
    assert angular_aggregate(2, 40, CORNER).pairs.tolist() == [[1, 0]]


def test_volume_centre_and_moments_of_a_brick():
    sides, place = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, -6.0])
    corners = place + sides * np.array(np.meshgrid(*[(0, 1)] * 3)).reshape(3, -1).T
    volume, centre, second = polyhedron_integrals(corners)
    assert volume == pytest.approx(6.0, rel=1e-14)
    assert centre == pytest.approx(place + 0.5 * sides, rel=1e-14)
    assert second == pytest.approx(np.diag(6.0 * sides**2 / 12.0), abs=1e-13)


def test_a_cube_cut_into_octants_has_twelve_faces_within():
    sites = 0.25 * np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
    octants = [_tile(CUBE, sites, i) for i in range(8)]
    assert [tile.volume for tile in octants] == pytest.approx([0.125] * 8, rel=1e-12)
    areas = np.array([shared_area(octants[i], j) for i in range(8) for j in range(i)])
    assert sorted(areas) == pytest.approx([0.0] * 16 + [0.25] * 12, abs=1e-12)


def test_the_cells_fill_the_grain_and_share_their_faces(tiles):
    (normals, distances), cells = tiles
    whole, _, _ = polyhedron_integrals(corners_of(normals, distances, np.zeros(3)))
    assert sum(tile.volume for tile in cells) == pytest.approx(whole, rel=1e-12)
    for i, tile in enumerate(cells):
        others = [j for j in range(PIECES) if j != i]
        assert [shared_area(tile, j) for j in others] == pytest.approx([shared_area(cells[j], i) for j in others])


def test_the_pieces_have_the_mass_of_a_sphere_about_their_centre(grain):
    assert [shape.measure for shape in grain.shapes] == pytest.approx([np.pi / 6] * PIECES, rel=1e-12)
    assert (grain.diameter**3).sum() == pytest.approx(1.0, rel=1e-14)
    assert np.abs(grain.diameter**3 @ grain.position).max() < 1e-14
    links = np.eye(PIECES, dtype=int)
    links[tuple(grain.pairs.T)] = links[tuple(grain.pairs.T[::-1])] = 1
    assert (np.linalg.matrix_power(links, PIECES) > 0).all()


def test_pieces_touch_their_common_faces_and_do_not_pass_them(grain, tiles):
    _, cells = tiles
    mean = np.cbrt(6.0 / np.pi * sum(tile.volume for tile in cells) / PIECES)
    size = CORNER * mean / (grain.shapes[0].dilation * grain.diameter[0])  # of the grain, in the unit of its cells
    frames = Rotation.from_quat(grain.rotation, scalar_first=True)
    gaps = []
    for (i, j), area in zip(grain.pairs, grain.area, strict=True):
        branch = cells[j].site - cells[i].site
        n = branch / np.linalg.norm(branch)
        reach = [
            grain.diameter[k] * grain.shapes[k].support(frames[k].inv().apply(side)[None])[0]
            for k, side in ((i, n), (j, -n))
        ]
        gaps.append(n @ (grain.position[j] - grain.position[i]) - sum(reach))
        assert area * size**2 == pytest.approx(shared_area(cells[i], j), rel=1e-9)
    assert min(gaps) > -1e-11
    assert np.median(gaps) < 0.03
    assert 0.85 < np.pi / 6 * size**3 / sum(tile.volume for tile in cells) < 1.0


def test_the_balls_span_the_pieces_to_the_farthest_point(grain):
    centre, radius = grain.spanning_balls()
    assert (np.linalg.norm(centre, axis=1) + radius).max() <= grain.reach + 1e-12
    assert (np.linalg.norm(centre, axis=1) + radius).max() == pytest.approx(grain.reach, rel=2e-3)


@pytest.mark.parametrize(
    ("pieces", "corner", "words"), [(1, 0.05, "pieces = 1"), (7, 0.5, "corner_radius"), (2, 0.49, "none of 1 grains")]
)
def test_what_no_grain_can_have_is_refused(monkeypatch, pieces, corner, words):
    monkeypatch.setattr(polyhedral_aggregates, "DRAWS", 1)
    with pytest.raises(InputError, match=words):
        polyhedral_aggregate(pieces, 1, corner)
