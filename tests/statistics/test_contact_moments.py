"""One moment of the contacts of a run, from the dataset, the file and the tree."""

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
from tests.helpers.contact_tables import moments_of, touching, write_contacts

PLACES = [np.array([[0.0, 0.0], [0.9, 0.1], [1.7, 0.4]]), np.array([[0.0, 0.0], [5.0, 0.0], [9.0, 0.0]])]
MOMENTS = [touching(PLACES[0], 1.0), touching(PLACES[1], 1.0), touching(PLACES[0] + [2.0, 0.0], 1.1)]
TIMES = (0.0, 0.5, 2.0)


@pytest.fixture
def contacts():
    return moments_of(MOMENTS, TIMES)


def same(found, expected):
    xarray.testing.assert_equal(found.drop_vars(["time", "shear_strain"]), expected)


def test_moments_are_found_by_time_and_by_number(contacts):
    assert [m.sizes["contact"] for m in MOMENTS] == [2, 0, 3 - 1]
    for given, which in (({}, 2), ({"time": 0.2}, 0), ({"time": 0.6}, 1), ({"index": 1}, 1), ({"index": -3}, 0)):
        found = lsm.contacts_at(contacts, **given)
        same(found, MOMENTS[which])
        assert float(found.time) == TIMES[which] and float(found.shear_strain) == pytest.approx(0.1 * TIMES[which])
    assert lsm.contacts_at(MOMENTS[0]) is MOMENTS[0]


def test_wrong_moments_are_refused(contacts):
    for given, message in (
        ({"index": 3}, "index = 3: must be an integer from -3 to 2"),
        ({"index": 0.5}, r"index = 0\.5"),
        ({"time": 1.0, "index": 1}, "give one of them"),
        ({"time": np.nan}, "time = nan: must be a time"),
    ):
        with pytest.raises(lsm.InputError, match=message):
            lsm.contacts_at(contacts, **given)
    with pytest.raises(lsm.InputError, match="holds no moment yet"):
        lsm.contacts_at(contacts.isel(time=slice(0)))
    with pytest.raises(lsm.InputError, match="row_size does not count the rows"):
        lsm.contacts_at(contacts.isel(contact=slice(3)))
    with pytest.raises(lsm.InputError, match=r"has no first_id, second_id, must be a contacts\.nc"):
        lsm.contacts_at(xarray.Dataset({"friction": ("time", [0.1])}))
    with pytest.raises(lsm.InputError, match=r"contacts: 'out', must be what lsm\.open_run gives"):
        lsm.contacts_at("out")


@pytest.mark.parametrize("run_status", ["complete", "running"])
def test_room_that_is_not_used_is_left_out(tmp_path, contacts, run_status):
    write_contacts(tmp_path / "contacts.nc", contacts, room=4, run_status=run_status)
    for found in (lsm.open_run(tmp_path / "contacts.nc"), lsm.open_run(tmp_path).contacts):
        assert found.sizes["time"] == 3 and found.sizes["contact"] == 4
        same(lsm.contacts_at(found), MOMENTS[2])
    tree = lsm.open_run(tmp_path)
    assert not tree.contacts.branch.variable._in_memory
    same(lsm.contacts_at(tree, 0.1), MOMENTS[0])
    with xarray.open_dataset(tmp_path / "contacts.nc") as plain:  # by xarray alone: with the room
        assert plain.sizes["time"] == 7
        same(lsm.contacts_at(plain), MOMENTS[2])
        same(lsm.contacts_at(plain, 0.1), MOMENTS[0])


def test_a_moment_whose_rows_are_not_all_there_is_not_there_yet(tmp_path, contacts):
    cut = contacts.isel(contact=slice(3))
    path = tmp_path / "contacts.nc"
    write_contacts(path, cut, room=1, run_status="running")
    found = lsm.open_run(path)
    assert found.time.values.tolist() == [0.0, 0.5] and found.sizes["contact"] == 2
    write_contacts(path, cut, run_status="complete")
    with pytest.raises(lsm.InputError, match=r"contacts\.nc: cannot be read \(it counts 4 contacts and holds 3\)"):
        lsm.open_run(path)
    write_contacts(path, contacts.assign_coords(time=[0.0, np.nan, 2.0]), run_status="running")
    with pytest.raises(lsm.InputError, match="its moments do not follow each other"):
        lsm.open_run(tmp_path)
