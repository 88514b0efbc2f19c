"""Profiles along the height: affine flow, slices of grains, fluctuations and stresses that are known."""

import itertools

import numpy as np
import pytest
import xarray

from taichi_lsm import InputError, contacts_at, profiles, shear_band
from tests.helpers.contact_tables import THICKNESS, grains_of, moments_of, touching

SIDE, SHIFT, RATE = 8.0, 27.3, 3.0


def sheared_cell(dim, seed=5, count=90):
    """(grains, contacts) of a sheared cell in affine flow, with positions far across its borders."""
    rng = np.random.default_rng(seed)
    edges = np.diag([SIDE] * dim)
    edges[0, 1] = SHIFT
    place = rng.random((count, dim)) @ edges.T
    diameter = rng.uniform(1.0, 1.4, count) * (1.0 if dim == 2 else 1.4)
    contacts = touching(place, diameter, [SIDE] * dim, SHIFT - round(SHIFT / SIDE) * SIDE, slope=0.3)
    wrapped = place + rng.integers(-2, 3, place.shape) @ edges.T
    contacts["point"] = contacts.point + (wrapped - place)[contacts.first_id.values]
    velocity = np.zeros_like(wrapped)
    velocity[:, 0] = RATE * wrapped[:, 1]
    cells = [(SIDE, SHIFT, RATE)]
    return grains_of(wrapped, diameter, [SIDE] * dim, velocity=velocity, cells=cells), contacts


@pytest.mark.parametrize("dim", [2, 3])
def test_affine_flow_of_a_sheared_cell_has_a_slope_and_no_fluctuations(dim):
    grains, contacts = sheared_cell(dim)
    found = profiles(grains, bins=5, contacts=contacts)
    assert found.shear_rate.values == pytest.approx(RATE)
    assert np.abs(found.granular_temperature.values).max() < 1e-12 * (RATE * SIDE) ** 2
    assert found.velocity.values[:, 0] == pytest.approx(RATE * found.height.values, abs=RATE)  # of few grains each
    assert found.velocity.values[:, 1:] == pytest.approx(0.0)
    solid = grains.mass.values.sum() / float(grains.density) / (SIDE**dim * (THICKNESS if dim == 2 else 1.0))
    assert float((found.solid_fraction * found.slab_height).sum()) / SIDE == pytest.approx(solid, rel=1e-12)
    # All slabs together carry what all contacts carry.
    force = contacts.normal_force.values[:, None] * contacts.normal.values + contacts.tangential_force.values
    volume = SIDE**dim * (THICKNESS if dim == 2 else 1.0)
    total = np.einsum("ci,cj->ij", force, contacts.branch.values) / volume
    assert found.stress.mean("height").values == pytest.approx(total, rel=1e-10, abs=1e-10 * total.max())


@pytest.mark.parametrize("dim", [2, 3])
def test_slices_of_a_grain_have_the_share_of_its_volume(dim):
    """Against the areas of chords, or sections, summed over thin slices."""
    place = np.zeros((1, dim))
    borders = np.array([-0.5, -0.2, 0.1, 0.6])
    found = profiles(grains_of(place, 1.0), bins=borders)
    y = (np.arange(100_000) + 0.5) / 100_000 - 0.5
    section = 2.0 * np.sqrt(0.25 - y**2) if dim == 2 else np.pi * (0.25 - y**2)
    by_hand = [section[(y > low) & (y < high)].sum() / 100_000 for low, high in itertools.pairwise(borders)]
    room = np.diff(borders) * 1.0 ** (dim - 1)  # as wide as the grain
    assert found.solid_fraction.values == pytest.approx(np.array(by_hand) / room, rel=1e-4)


def test_fluctuations_and_their_stress():
    """Two grains at one height with velocities 1 +- u: T = u^2/2 in 2D, stress 2 m u^2 over the volume along x."""
    grains = grains_of([[0.0, 0.0], [2.0, 0.0]], 1.0, [4.0], velocity=[[1.3, 0.0], [0.7, 0.0]])
    contacts = moments_of([touching([[0.0, 0.0], [2.0, 0.0]], 1.0)], [0.0])
    found = profiles(grains, bins=[-0.5, 0.5], contacts=contacts)
    assert found.velocity.values[0].tolist() == [1.0, 0.0]
    assert found.granular_temperature.values[0] == pytest.approx(0.09 / 2)
    assert found.stress.values[0, 0, 0] == pytest.approx(float(grains.mass.sum()) * 0.09 / (4.0 * THICKNESS))
    assert found.stress.values[0, 1, 1] == pytest.approx(0.0, abs=1e-12)
    grains["angular_velocity"] = (("time", "grain"), [[2.0, 4.0]])
    assert profiles(grains, bins=[-0.5, 0.5]).angular_velocity.values[0] == pytest.approx(3.0)


def test_a_contact_counts_by_the_share_of_its_branch():
    """Two discs one above the other: the branch vector of 0.9 lies by a third in the lower slab."""
    place = [[0.0, 0.0], [0.0, 0.9]]
    grains, contacts = grains_of(place, 1.0, [4.0]), touching(place, 1.0, [4.0])
    found = profiles(grains, bins=[-0.6, 0.3, 1.5], contacts=contacts)
    force = float(contacts.normal_force[0])
    assert found.stress.values[:, 1, 1] == pytest.approx(
        [force * 0.3 / (4.0 * 0.9 * THICKNESS), force * 0.6 / (4.0 * 1.2 * THICKNESS)]
    )


@pytest.fixture
def layer():
    """Tree of a layer whose grains move as an error function of the height, between platens of three grains each."""
    from scipy.special import erf

    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(3.0), np.arange(22.0), indexing="ij"))
    place = np.stack([x, y], axis=1)
    glued = np.flatnonzero((y == 0) | (y == 21))
    velocity = np.stack([0.5 + 0.5 * erf((y - 9.0) / (np.sqrt(2.0) * 2.0)), np.zeros_like(y)], axis=1)
    velocity[glued, 0] = y[glued] / 21.0
    grains = grains_of([place, place + np.array([1.0, 0.0])], 1.001, [3.0], glued, velocity=velocity)
    children = {"grains": grains, "contacts": moments_of([touching(place, 1.001, [3.0])], [1.0])}
    return xarray.DataTree(children={name: xarray.DataTree(dataset) for name, dataset in children.items()})


def test_a_layer_reaches_from_plane_to_plane_and_its_band_is_found(layer):
    found = profiles(layer, bins=20)
    assert found.height.values == pytest.approx(np.arange(1.0, 21.0), abs=2e-3)
    assert found.solid_fraction.values == pytest.approx(np.pi / 4, rel=0.02)  # glued grains are left out
    assert found.platen_velocity.values[:, 0].tolist() == [0.0, 1.0] and found.attrs["snapshots"] == 1
    band = shear_band(found)
    assert band.centre.mean == pytest.approx(9.0, abs=0.02) and band.width.mean == pytest.approx(2.563 * 2.0, rel=0.02)
    assert band.share.mean == pytest.approx(1.0, rel=0.01)
    moment = contacts_at(layer)
    load = float(moment.normal_force[0]) / (1.0 * THICKNESS)  # of each column of grains
    assert found.stress.values[:, 1, 1] == pytest.approx(load, rel=1e-9)


def test_many_snapshots_are_averaged(layer):
    grains = layer.grains.to_dataset().copy(deep=True)
    grains["velocity"] = grains.velocity * xarray.DataArray([1.0, 3.0], dims="time")
    first, last, both = (profiles(grains, time, 5) for time in (0.0, 1.0, (0.0, 9.0)))
    assert both.velocity.values == pytest.approx(0.5 * (first.velocity.values + last.velocity.values))
    assert both.attrs["snapshots"] == 2 and both.attrs["times"] == [0.0, 1.0]
    xarray.testing.assert_equal(profiles(grains.isel(time=1), bins=5), last)
    assert "stress" not in profiles(layer, 0.0) and "stress" in profiles(layer, (0.0, 1.0))  # contacts are of 1 s


def test_empty_slabs_are_nan_and_left_out_of_the_band(layer):
    grains = layer.grains.to_dataset()
    found = profiles(grains, bins=np.arange(-3.0, 24.0) + 0.499)
    assert np.isnan(found.velocity.values[:3]).all() and found.solid_fraction.values[0] == 0.0
    assert found.solid_fraction.values[2] == 0.0  # of glued grains alone, whose centres are at 0
    assert shear_band(found).centre.mean == pytest.approx(9.0, abs=0.05)


def test_what_is_no_profile_is_refused(layer):
    for given, message in (
        ({"bins": 0}, "bins = 0: must be a number from 1"),
        ({"bins": [1.0, 0.0]}, "must be a number of slabs, or at least 2 rising borders"),
        ({"time": (5.0, 6.0)}, r"no snapshot lies there; those of the run are from 0 to 1 s"),
        ({"time": "noon"}, "time = 'noon': must be a time"),
    ):
        with pytest.raises(InputError, match=message):
            profiles(layer, **given)
    with pytest.raises(InputError, match=r"holds no grains\.nc"):
        profiles(xarray.DataTree(children={"run": xarray.DataTree()}))
    with pytest.raises(InputError, match="grains: has no position, velocity"):
        profiles(layer.contacts)
    with pytest.raises(InputError, match=r"must be what lsm\.profiles gives"):
        shear_band(layer.grains.to_dataset())
    with pytest.raises(InputError, match="velocity: None, must be the velocity at each height"):
        shear_band(np.arange(9.0))


def test_a_run_whose_contacts_have_no_moment_yet_has_profiles_without_stress():
    """As one with --contacts end that goes on."""
    place = [[0.0, 0.0], [0.0, 0.9]]
    grains, moments = grains_of(place, 1.0, [4.0]), moments_of([touching(place, 1.0, [4.0])], [0.0])
    tree = xarray.DataTree.from_dict({"grains": grains, "contacts": moments})
    assert "stress" in profiles(tree, bins=2)
    none = moments.isel(time=slice(0), contact=slice(0))
    found = profiles(xarray.DataTree.from_dict({"grains": grains, "contacts": none}), bins=2)
    xarray.testing.assert_identical(found, profiles(tree, bins=2).drop_vars("stress"))
