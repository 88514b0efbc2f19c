"""D2min: the values of OVITO, none for affine motion, and known values for single moves."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taichi_lsm import InputError, d2min
from tests.helpers.contact_tables import grains_of

REFERENCE = json.loads((Path(__file__).resolve().parents[1] / "data" / "d2min_ovito.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", REFERENCE)
def test_values_are_those_of_ovito(name):
    """Of OVITO 3.17.2: AtomicStrainModifier(cutoff=..., output_nonaffine_squared_displacements=True), with
    minimum_image_convention = True and the first positions and cell as the StaticSource of its `reference`. The cell in
    3D is periodic along x, y and z, the layer in 2D along x (SimulationCell.is2D = True)."""
    given = REFERENCE[name]
    cells, position = np.array(given["cells"]), np.array(given["positions"])
    if name == "layer in 2D":
        grains = grains_of(position, 1.0, periodic=[cells[0, 0, 0]])
    else:
        moved = [(cell[1, 1], cell[0, 1], 0.0) for cell in cells]
        grains = grains_of(position, 1.0, periodic=np.diag(cells[0]), cells=moved)
    found = d2min(grains, 0.0, 1.0, given["cutoff"]).d2min.values
    assert np.abs(found / given["d2min"] - 1.0).max() < 1e-10


def scattered(dim, count=500, seed=1):
    """Places in a cell of 6, all apart by no rule."""
    return np.random.default_rng(seed).uniform(0.0, 6.0, (count, dim))


@pytest.mark.parametrize("dim", [2, 3])
def test_affine_motion_has_none(dim):
    rng = np.random.default_rng(dim)
    place, move = scattered(dim), rng.normal(size=dim)
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7] if dim == 2 else [0.3, -0.4, 0.7]).as_matrix()[:dim, :dim]
    for gradient in (turn, np.eye(dim) + 0.3 * rng.normal(size=(dim, dim))):
        found = d2min(grains_of([place, place @ gradient.T + move], 1.0), 0.0, cutoff=2.0)
        assert np.abs(found.d2min.values).max() < 1e-24
        assert found.deformation_gradient.values == pytest.approx(np.tile(gradient, (len(place), 1, 1)), abs=1e-11)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_cell_that_is_sheared_over_many_periods_has_none(dim):
    """Grains go with the mean flow, and far across the borders; positions are not wrapped."""
    height, shift = (6.0, 7.2), (1.7, 50.3)
    place, lengths = scattered(dim), [6.0, 6.0, 6.0][:dim]
    edges = [
        np.diag([6.0, h, 6.0][:dim]) + s * np.eye(dim, k=1) * (np.arange(dim) == 0)[:, None]
        for h, s in zip(height, shift, strict=True)
    ]
    share = place / 6.0 + np.random.default_rng(2).integers(-2, 3, place.shape)
    cells = [(h, s, 0.0) for h, s in zip(height, shift, strict=True)]
    found = d2min(grains_of([share @ e.T for e in edges], 1.0, lengths, cells=cells), 0.0, 1.0, 1.5)
    assert np.abs(found.d2min.values).max() < 1e-20
    by_hand = edges[1] @ np.linalg.inv(edges[0])
    assert found.deformation_gradient.values == pytest.approx(np.tile(by_hand, (len(place), 1, 1)), abs=1e-10)


def test_a_single_move_within_a_square():
    """The middle of a square of four moves by a: D2min is 4 a^2 there; F takes nothing, for the four are symmetric."""
    place = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    moved = place.copy()
    moved[0] = [0.1, 0.2]
    found = d2min(grains_of([place, moved], 1.0, glued=(4,)), 0.0, cutoff=1.2)
    assert found.d2min.values[0] == pytest.approx(4 * (0.1**2 + 0.2**2)) and found.neighbour_count.values[0] == 4
    assert np.isnan(found.d2min.values[1:]).all()  # one neighbour alone spans no plane
    assert found.glued.values.tolist() == [False] * 4 + [True]


def test_by_brute_force_across_borders_of_a_sheared_cell():
    """Positions lie anywhere, and the image above is shifted by several periods at either time."""
    rng = np.random.default_rng(4)
    edges = np.array([[[6.0, 20.7], [0.0, 6.0]], [[6.0, 22.5], [0.0, 6.3]]])
    share = rng.random((60, 2)) + rng.integers(-2, 3, (60, 2))
    place, moved = share @ edges[0].T, share @ edges[1].T + 0.1 * rng.normal(size=share.shape)
    cells = [(6.0, 20.7, 0.0), (6.3, 22.5, 0.0)]
    found = d2min(grains_of([place, moved], 0.5, [6.0, 6.0], cells=cells), 0.0, cutoff=1.8)
    numbers = np.stack(np.meshgrid(np.arange(-30, 31), np.arange(-6, 7), indexing="ij"), axis=-1).reshape(-1, 2)
    for k in (0, 17, 42):
        images = (place - place[k])[:, None, :] + numbers @ edges[0].T
        near, image = np.nonzero(np.linalg.norm(images, axis=2) < 1.8)
        near, image = near[near != k], image[near != k]
        before = images[near, image]
        after = (moved - moved[k])[near] + numbers[image] @ edges[1].T
        fit, *_ = np.linalg.lstsq(before, after, rcond=None)
        assert found.neighbour_count.values[k] == len(near) > 4
        assert found.d2min.values[k] == pytest.approx(np.sum((after - before @ fit) ** 2), rel=1e-10)


def test_what_cannot_be_computed_is_refused():
    grains = grains_of([scattered(2), scattered(2)], 1.0, [6.0, 6.0])
    with pytest.raises(InputError, match="nearest snapshots are those of 1 and 1 s"):
        d2min(grains, 0.9)
    with pytest.raises(InputError, match=r"cutoff = 7 m: must be > 0 m and below the width of the cell, 6 m"):
        d2min(grains, 0.0, cutoff=7.0)
    with pytest.raises(InputError, match="time = 'noon': must be a time"):
        d2min(grains, "noon")
    with pytest.raises(InputError, match="is one snapshot"):
        d2min(grains.isel(time=0), 0.0)
    lost = grains.copy(deep=True)
    lost.position[1, 3] = np.nan
    found = d2min(lost, 0.0)
    assert np.flatnonzero(np.isnan(found.d2min)).tolist() == [3] and found.neighbour_count.values[3] == 0
