"""Stress within grains: known forces on one grain, and the stress of all contacts when it is summed."""

import numpy as np
import pytest
import xarray

from taichi_lsm import InputError
from taichi_lsm.statistics import grain_stress
from tests.helpers.contact_tables import THICKNESS, grains_of, moment_of, moments_of, touching

SIDE, SHIFT = 8.0, 27.3


def packing(dim, seed=3, count=90):
    """Grains (n, D) that overlap at random in a sheared cell, with positions far across its borders."""
    rng = np.random.default_rng(seed)
    share = rng.random((count, dim))
    edges = np.diag([SIDE] * dim)
    edges[0, 1] = SHIFT
    return share @ edges.T, edges, rng


@pytest.mark.parametrize("dim", [2, 3])
def test_all_grains_together_carry_what_all_contacts_carry(dim):
    place, edges, rng = packing(dim)
    diameter = rng.uniform(1.0, 1.4, len(place)) * (1.0 if dim == 2 else 1.4)
    contacts = touching(place, diameter, [SIDE] * dim, SHIFT - round(SHIFT / SIDE) * SIDE, slope=0.3)
    assert contacts.sizes["contact"] > 100
    wrapped = place + rng.integers(-2, 3, place.shape) @ edges.T
    moved = (wrapped - place)[contacts.first_id.values]
    moved[::2] = 0.0  # points beside another image of the grain
    contacts["point"] = contacts.point + moved
    grains = grains_of(wrapped, diameter, [SIDE] * dim, cells=[(SIDE, SHIFT, 0.0)])
    found = grain_stress(grains, contacts=contacts)
    force = contacts.normal_force.values[:, None] * contacts.normal.values + contacts.tangential_force.values
    total = np.einsum("g,gij->ij", found.volume.values, found.stress.values)
    assert total == pytest.approx(
        np.einsum("ci,cj->ij", force, contacts.branch.values), rel=1e-12, abs=1e-9 * total.max()
    )
    # Of each grain alone: arms lie along the normals, as long as the radius less half of the overlap.
    depth = contacts.normal_force.values / 1e4
    by_hand = np.zeros_like(found.stress.values)
    for ids in (contacts.first_id.values, contacts.second_id.values):
        reach = 0.5 * diameter[ids] - 0.5 * depth
        np.add.at(by_hand, ids, reach[:, None, None] * force[:, :, None] * contacts.normal.values[:, None, :])
    assert found.stress.values == pytest.approx(by_hand / found.volume.values[:, None, None], rel=1e-9, abs=1e-3)
    assert_equal = xarray.testing.assert_allclose
    arm = (0.5 * diameter[contacts.first_id.values] - 0.5 * depth)[:, None] * contacts.normal.values
    assert_equal(
        grain_stress(grains, contacts=contacts.assign(arm=(("contact", "space"), arm), point=contacts.point + 9.9)),
        found,
    )
    assert found.contact_count.values.sum() == 2 * contacts.sizes["contact"]


def test_a_disc_pressed_from_both_sides():
    """sigma_xx = 2 F r/V; the wall below counts for the grain, the platen has no stress of its own."""
    radius, force = 0.5e-3, 3.0
    grains = grains_of([[0.0, radius], [1e-3, radius], [-1e-3, radius]], 2 * radius, glued=(1, 2))
    ends = [
        (0, 1, [radius, radius], [1e-3, 0.0]),
        (0, 2, [-radius, radius], [-1e-3, 0.0]),
        (0, -1, [0.0, 0.0], [0.0, -radius]),
    ]
    first, second, point, branch = (list(column) for column in zip(*ends, strict=True))
    normal = [[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]
    contacts = moment_of(first, second, point, branch, normal, [force, force, 0.5 * force], np.zeros((3, 2)))
    found = grain_stress(grains, contacts=contacts)
    volume = np.pi * radius**2 * THICKNESS
    assert found.stress.values[0] == pytest.approx(
        np.array([[2 * force * radius, 0.0], [0.0, 0.5 * force * radius]]) / volume
    )
    assert np.isnan(found.stress.values[1:]).all() and found.contact_count.values.tolist() == [3, 1, 1]


def test_positions_of_another_instant_and_other_grains_are_refused():
    place = np.array([[0.0, 0.0], [0.9, 0.0]])
    contacts = moments_of([touching(place, 1.0)] * 2, [0.0, 0.4])
    grains = grains_of([place, place], 1.0)
    assert grain_stress(grains, 0.1, contacts).time == 0.0
    with pytest.raises(
        InputError, match=r"contacts are those of 0\.4 s, the nearest positions of 0 s, .*--snapshots and"
    ):
        grain_stress(grains, contacts=contacts)
    with pytest.raises(InputError, match="ids up to 1, the run has 1 grains"):
        grain_stress(grains.isel(grain=[0]), 0.0, contacts)
    with pytest.raises(InputError, match="has no density"):
        grain_stress(grains.drop_vars("density"), 0.0, contacts)
    tree = xarray.DataTree(children={"grains": xarray.DataTree(grains)})
    with pytest.raises(InputError, match=r"holds no contacts\.nc; run with --contacts"):
        grain_stress(tree)
    tree["contacts"] = xarray.DataTree(contacts)
    assert grain_stress(tree).time == 0.0  # positions of the last contacts are not there yet, or were lost by a kill
    assert grain_stress(tree, 0.0).stress.values[0, 0, 0] == pytest.approx(1e3 * 0.45 / (np.pi / 4 * THICKNESS))
