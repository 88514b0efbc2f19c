"""contacts.nc: moments of any number of contacts, whole after a kill at any byte, taken over, and closed to size."""

import os
from dataclasses import replace

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core import record_netcdf
from taichi_lsm.core.schema import Variable
from taichi_lsm.io import contacts_file
from taichi_lsm.io.contacts_file import ContactsWriter
from tests.helpers.output_files import SCALARS, STAGE, STAGES, attributes
from tests.helpers.processes import run_python

ROWS = [
    Variable("first_id", ("contact",), "i32", "1", "first grain"),
    Variable("sliding", ("contact",), "i8", "1", "whether it slides"),
    Variable("normal", ("contact", "space"), "f64", "1", "unit normal"),
    Variable("normal_force", ("contact",), "f64", "N", "normal force"),
]
OF_MOMENT = [
    Variable("shear_strain", ("time",), "f64", "1", "shear strain"),
    Variable("parted_power", ("time",), "f64", "W", "power of contacts that ended"),
]
COUNTS = (3, 0, 5, 1, 2)  # contacts of the moments, in turn


def writer(path, **options):
    flags = {"sliding": {"flag_values": [0, 1], "flag_meanings": "sticking sliding"}}
    return ContactsWriter(path, ROWS, OF_MOMENT, attributes(), 2, STAGE, SCALARS, flags, **options)


def moment(i):
    """Moment number i; every value tells i and the row."""
    n = COUNTS[i % len(COUNTS)]
    rows = 10.0 * i + np.arange(n)
    contacts = {
        "first_id": rows.astype(np.int32),
        "sliding": np.arange(n) % 2,
        "normal": np.stack([rows, -rows], axis=1),
        "normal_force": rows + 0.5,
    }
    return 0.5 * i, {"shear_strain": 0.01 * i, "parted_power": -1.0 * i, "stage": STAGES[i % 2]}, contacts


def check(path):
    """Every moment that the file knows is whole; returns how many there are."""
    dataset = lsm.open_run(path)
    known = np.isfinite(dataset.time.values)
    count = int(known.sum())
    assert known[:count].all()
    begin = 0
    for i in range(count):
        time, values, contacts = moment(i)
        now = dataset.isel(time=i)
        assert (now.time, now.shear_strain, now.parted_power) == (time, values["shear_strain"], values["parted_power"])
        assert str(now.stage.values) == values["stage"]
        rows = slice(begin, begin + int(now.row_size))
        for name, expected in contacts.items():
            assert np.array_equal(dataset[name].values[rows], expected), (i, name)
        begin = rows.stop
    assert dataset.sizes["contact"] >= begin
    return count


def room(path):
    """Moments that the file has room for."""
    with netCDF4.Dataset(path) as file:
        return len(file.dimensions["time"])


def filled(path, count, **options):
    file = writer(path, **options)
    for i in range(count):
        file.append(*moment(i))
    return file


def test_moments_are_read_while_the_run_goes_on_and_fit_the_file_at_its_end(tmp_path, monkeypatch):
    """Also where the room is used up twice on the way."""
    monkeypatch.setattr(contacts_file, "ROOM", 4)
    path = tmp_path / "contacts.nc"
    file = writer(path)
    for i in range(11):
        file.append(*moment(i))
        assert check(path) == i + 1 == len(file)
    assert room(path) == 16 and lsm.open_run(path).run_status == "running"
    file.close("complete")
    dataset = lsm.open_run(path)
    assert check(path) == 11 and dataset.run_status == "complete"
    assert dataset.sizes["time"] == 11 and dataset.sizes["contact"] == dataset.row_size.sum() == 25
    assert dataset.row_size.sample_dimension == "contact" and "shear_strain" in dataset.coords
    assert dataset.normal.dims == ("contact", "space") and dataset.sliding.dtype == np.int8
    assert float(dataset.density) == 2500.0 and dataset.normal_force.units == "N"
    with pytest.raises(lsm.InputError, match=r"contacts\.nc is closed \(complete\)"):
        file.append(*moment(11))


@pytest.mark.parametrize("count", [0, 35])
def test_a_file_without_a_moment_says_so(tmp_path, count):
    """However long the header is: the library reads it by windows, which reach beyond so short a file."""
    path = tmp_path / "contacts.nc"
    scalars = [replace(SCALARS[1], name=f"parameter_{i}") for i in range(count)]
    ContactsWriter(path, ROWS, OF_MOMENT, attributes(), 2, STAGE, scalars).close("failed")
    dataset = lsm.open_run(path)
    assert not np.isfinite(dataset.time).any() and dataset.sizes["contact"] == 0 and dataset.run_status == "failed"


DIE = """
import os, shutil, sys
from pathlib import Path
from taichi_lsm.core import record_netcdf
from tests.io.test_contacts_file import check, filled, moment

path, write, whole = Path(sys.argv[1]), record_netcdf._write_at, record_netcdf.os.fsync

class Dying:
    def __init__(self, file, left):
        self.file, self.left = file, left
    def seek(self, at):
        return self.file.seek(at)
    def write(self, data):
        if self.left < len(data) <= 8:  # a number is written at once
            os._exit(0)
        self.left -= len(data)
        if self.left <= 0:
            self.file.write(data[: len(data) + self.left])
            os._exit(0)
        return self.file.write(data)

left, found, died = 1, set(), True
while died:
    copy = path.with_name(f"{left}.nc")
    child = os.fork()
    if child == 0:
        file = filled(copy, 2)
        budget = [left]
        def dying(opened, start, parts):
            opened = Dying(opened, budget[0])
            write(opened, start, parts)
            budget[0] = opened.left
        record_netcdf._write_at = dying
        file.append(*moment(2))
        os._exit(7)
    died = os.waitpid(child, 0)[1] == 0
    found.add(check(copy))
    copy.unlink()
    left += 29
print(left, sorted(found))
"""


def test_death_at_any_byte_leaves_whole_moments(tmp_path):
    """A process dies after each 29th byte of a moment, in turn."""
    left, found = run_python("-c", DIE, tmp_path / "contacts.nc").split(maxsplit=1)
    assert int(left) > 200 and found.strip() == "[2, 3]"


def test_a_run_that_goes_on_writes_the_same_file(tmp_path, monkeypatch):
    """From a file that was killed with moments behind those that a checkpoint counts, and from a closed one."""
    monkeypatch.setattr(contacts_file, "ROOM", 4)
    whole = tmp_path / "whole.nc"
    filled(whole, 9).close("complete")
    for closed, keep in ((False, 5), (True, 5), (True, 0), (False, 7)):
        path = tmp_path / "contacts.nc"
        file = filled(path, 7)
        if closed:
            file.close("interrupted")
        file = writer(path, keep=keep)
        assert len(file) == keep and check(path) == keep
        for i in range(keep, 9):
            file.append(*moment(i))
        file.close("complete")
        same = netCDF4.Dataset(path), netCDF4.Dataset(whole)
        for name in same[1].variables:
            assert np.array_equal(*(np.ma.getdata(one[name][:]) for one in same)), name
        assert same[0].history.count("resumed") == 1
        for one in same:
            one.close()


def test_a_damaged_file_is_refused_by_its_name(tmp_path):
    path = tmp_path / "contacts.nc"
    filled(path, 4).close("interrupted")
    with pytest.raises(lsm.InputError, match=r"contacts\.nc: holds 4 moments, fewer than the 5 to keep"):
        writer(path, keep=5)
    data = path.read_bytes()
    path.write_bytes(data[:-10])
    with pytest.raises(lsm.InputError, match=r"contacts\.nc: holds 8 whole rows of contacts, fewer than the 9 to keep"):
        writer(path, keep=4)
    with pytest.raises(lsm.InputError, match=r"contacts\.nc: cannot be read \(it counts 9 \w+ and holds 8\)"):
        lsm.open_run(path)
    path.write_bytes(data[:900])
    with pytest.raises(lsm.InputError, match=r"contacts\.nc"):
        writer(path, keep=2)
    path.unlink()
    with pytest.raises(lsm.InputError, match=r"contacts\.nc: cannot be continued, there is no such file"):
        writer(path, keep=2)


def test_what_does_not_fit_is_refused_and_leaves_the_file_as_it_is(tmp_path):
    path = tmp_path / "contacts.nc"
    file = filled(path, 2)
    time, values, contacts = moment(2)
    for message, changed in (
        (r"time: 0.5 s, must be finite and above the last moment's 0.5 s", (0.5, values, contacts)),
        (r"missing normal", (time, values, {k: v for k, v in contacts.items() if k != "normal"})),
        (r"missing stage", (time, {k: v for k, v in values.items() if k != "stage"}, contacts)),
        (r"normal: shape \(5, 3\)", (time, values, contacts | {"normal": np.zeros((5, 3))})),
        (r"sliding: .*does not fit into 8 bits", (time, values, contacts | {"sliding": np.full(5, 300)})),
        (r"stage: .* has 70 bytes", (time, values | {"stage": "x" * 70}, contacts)),
    ):
        with pytest.raises(lsm.InputError, match=message):
            file.append(*changed)
    assert check(path) == 2


def test_moments_share_their_way_to_the_disk(tmp_path, monkeypatch):
    path = tmp_path / "contacts.nc"
    file = filled(path, 1, shares=True)
    monkeypatch.setattr(record_netcdf, "SPARE", 1e9)
    for i in range(1, 6):
        file.append(*moment(i))
    assert check(path) == 1 and len(file) == 6
    file.flush()
    assert check(path) == 6


def test_a_disk_without_room_for_a_copy_keeps_the_moments(tmp_path, monkeypatch):
    path = tmp_path / "contacts.nc"
    file = filled(path, 3)

    def full(*arguments):
        raise lsm.SimulationError("disk full")

    monkeypatch.setattr(contacts_file, "create_record_file", full)
    file.close("failed")
    assert check(path) == 3 and lsm.open_run(path).run_status == "failed"
    assert room(path) == contacts_file.ROOM and not os.listdir(tmp_path)[1:]


def test_a_file_that_cannot_grow_keeps_its_room(tmp_path, monkeypatch):
    monkeypatch.setattr(contacts_file, "ROOM", 4)
    path = tmp_path / "contacts.nc"
    file, make = filled(path, 4), contacts_file.create_record_file

    def full(*arguments):
        raise lsm.SimulationError("disk full")

    monkeypatch.setattr(contacts_file, "create_record_file", full)
    with pytest.raises(lsm.SimulationError, match="disk full"):
        file.append(*moment(4))
    assert check(path) == 4 == len(file) and room(path) == 4
    monkeypatch.setattr(contacts_file, "create_record_file", make)
    file.append(*moment(4))
    assert check(path) == 5 and room(path) == 8
