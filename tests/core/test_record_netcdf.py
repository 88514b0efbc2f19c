"""Files that grow by records: as the netCDF library reads them, and as a crash at any write leaves them."""

import os

import netCDF4
import numpy as np
import pytest

from taichi_lsm.core import record_netcdf
from taichi_lsm.core.errors import SimulationError
from taichi_lsm.core.record_netcdf import (
    RecordAppender,
    create_record_file,
    read_layout,
    record_bytes,
    replace_texts,
    write_entries,
)
from tests.helpers.processes import run_python


def fill(dataset):
    """Values of every type, whose bytes in a record are no multiples of 4, and one that has none."""
    dataset.setncatts({"title": "Grüße", "run_status": "interrupted", "seed": 7, "lengths": [0.5, 1.0]})
    dataset.createDimension("grain", 3)
    dataset.createDimension("time", None)
    dataset.createDimension("length", 5)
    mass = dataset.createVariable("mass", "f4", ("grain",), fill_value=False)
    mass.units, mass[:] = "kg", [1, 2, 3]
    for name, kind, dims in (
        ("time", "f8", ("time",)),
        ("stage", "S1", ("time", "length")),
        ("kind", "i4", ("time", "grain")),
        ("position", "f8", ("time", "grain")),
        ("force", "f4", ("time", "grain")),
    ):
        dataset.createVariable(name, kind, dims, fill_value=False).long_name = name


def record(i):
    return {
        "time": np.float64(i),
        "stage": np.array(list("shear"), "S1"),
        "kind": np.array([i, -i, 2**31 - 1], np.int32),
        "position": np.array([0.1 * i, -0.0, np.nan]),
        "force": np.array([0.1 * i, np.inf, -1.0], np.float32),
    }


def append_record(path, layout, arrays):
    """Append and count one record; returns the layout with the new count."""
    appender = RecordAppender(path, layout)
    appender.append(record_bytes(layout, arrays))
    appender.flush()
    return appender.layout


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "records.nc"
    layout = create_record_file(path, fill, {"run_status": "running"})
    for i in range(2):
        layout = append_record(path, layout, record(i))
    return path, layout


def check(path, count):
    """The library reads `count` records, bit for bit."""
    with netCDF4.Dataset(path) as dataset:
        dataset.set_auto_mask(False)
        dataset["stage"].set_auto_chartostring(False)
        assert len(dataset.dimensions["time"]) == count
        for i in range(count):
            for name, array in record(i).items():
                stored = dataset[name][i]
                assert np.asarray(stored).tobytes() == array.tobytes(), name
        assert dataset["mass"][:].tolist() == [1, 2, 3]


def test_the_library_reads_what_was_appended(file):
    path, layout = file
    check(path, 2)
    assert layout.end == path.stat().st_size and layout == read_layout(path)
    with netCDF4.Dataset(path) as dataset:
        assert (
            dataset.run_status == "running" and dataset.title == "Grüße" and dataset.data_model == record_netcdf.FORMAT
        )


def test_records_that_the_library_wrote_are_understood(file):
    """And continued: neither side knows more than the specification of the format."""
    path, layout = file
    with netCDF4.Dataset(path, "a") as dataset:
        dataset["stage"].set_auto_chartostring(False)
        for name, array in record(2).items():
            dataset[name][2] = array
    assert read_layout(path).count == 3 and read_layout(path).end == path.stat().st_size
    append_record(path, read_layout(path), record(3))
    check(path, 4)


def test_a_record_is_counted_when_it_lies_on_the_disk(file, monkeypatch):
    path, layout = file
    on_disk, fsync = [], os.fsync

    def observed(number):
        fsync(number)
        on_disk.append((read_layout(path).count, path.stat().st_size - layout.end))

    monkeypatch.setattr(record_netcdf.os, "fsync", observed)
    append_record(path, layout, record(2))
    assert on_disk == [(2, layout.size), (3, layout.size)]


def test_an_append_writes_one_record_and_a_count(file, monkeypatch):
    path, layout = file
    written, write = [], record_netcdf._write_at

    def observed(opened, start, parts):
        written.append(sum(len(part) for part in parts))
        write(opened, start, parts)

    monkeypatch.setattr(record_netcdf, "_write_at", observed)
    for i in range(2, 12):
        layout = append_record(path, layout, record(i))
    assert written == [layout.size, 4] * 10
    check(path, 12)


DIE = """
import os, shutil, sys
from pathlib import Path
from taichi_lsm.core import record_netcdf
from tests.core.test_record_netcdf import append_record, record
path, bytes_of = Path(sys.argv[1]), {}

class Dying:
    def __init__(self, file, left):
        self.file, self.left = file, left
    def seek(self, at):
        return self.file.seek(at)
    def fileno(self):
        return self.file.fileno()
    def write(self, data):
        self.left -= len(data)
        if self.left <= 0:
            self.file.write(data[: len(data) + self.left])
            os._exit(0)
        return self.file.write(data)

layout = record_netcdf.read_layout(path)
write = record_netcdf._write_at
for left in range(1, layout.size + 4):
    copy = path.with_name(f"{left}.nc")
    shutil.copy(path, copy)
    child = os.fork()
    if child == 0:
        budget = [left]
        def dying(file, start, parts):
            file = Dying(file, budget[0])
            write(file, start, parts)
            budget[0] = file.left
        record_netcdf._write_at = dying
        append_record(copy, layout, record(2))
        os._exit(1)
    assert os.waitpid(child, 0)[1] == 0, left
"""


def test_death_at_any_byte_leaves_the_records_before(file, tmp_path):
    """A process dies after each number of bytes of the record, in turn; the next one appends where it stopped."""
    path, layout = file
    run_python("-c", DIE, path)
    left = sorted(tmp_path.glob("[0-9]*.nc"))
    assert len(left) == layout.size + 3
    assert len({p.stat().st_size for p in left}) == layout.size
    for i, copy in enumerate(left):
        check(copy, 2)
        if i % 20 == 0:
            append_record(copy, read_layout(copy), record(2))
            check(copy, 3)


def test_files_cut_off_hold_fewer_whole_records(file):
    path, layout = file
    data = path.read_bytes()
    for cut, whole in ((1, 1), (layout.size, 1), (layout.size + 1, 0)):
        path.write_bytes(data[:-cut])
        assert (read_layout(path).count, read_layout(path).whole) == (2, whole)
    for length in range(0, layout.start, 7):
        path.write_bytes(data[:length])
        with pytest.raises(ValueError, match=r"truncated|does not begin"):
            read_layout(path)


def test_a_file_that_somebody_else_changed_is_left_alone(file):
    path, layout = file
    append_record(path, layout, record(2))
    with pytest.raises(SimulationError, match=r"records\.nc: was changed by another process"):
        append_record(path, layout, record(2))
    check(path, 3)


def test_texts_change_in_their_place(file):
    path, layout = file
    before = path.read_bytes()
    for status in ("interrupted", "failed"):
        replace_texts(path, layout, {"run_status": status})
        with netCDF4.Dataset(path) as dataset:
            assert dataset.run_status == status
    assert path.stat().st_size == len(before)
    with pytest.raises(ValueError, match="has no room in 11 bytes"):
        replace_texts(path, layout, {"run_status": "interrupted for good"})
    replace_texts(path, layout, {"run_status": "running"})
    assert path.read_bytes() == before


def test_appends_share_their_way_to_the_disk(file, monkeypatch):
    """Three of them in one flush: until then a reader sees none, and a kill loses them."""
    path, layout = file
    syncs, fsync = [], os.fsync
    monkeypatch.setattr(record_netcdf.os, "fsync", lambda number: syncs.append(fsync(number)))
    appender = RecordAppender(path, layout, shares=True)
    assert appender.due
    for i in range(2, 5):
        appender.append(record_bytes(layout, record(i)))
    check(path, 2)
    assert appender.pending == 3 and not syncs
    appender.flush()
    check(path, 5)
    assert appender.pending == 0 and len(syncs) == 2 and not appender.due
    appender._flushed -= record_netcdf.SPARE * appender._took
    assert appender.due


def test_many_records_at_once_are_those_one_by_one(file, tmp_path):
    path, layout = file
    other = tmp_path / "other.nc"
    layout_of_other = create_record_file(other, fill, {"run_status": "running"})
    appender = RecordAppender(other, layout_of_other)
    appender.append([b"".join(b"".join(record_bytes(layout, record(i))) for i in range(2))], 2)
    appender.flush()
    assert other.read_bytes() == path.read_bytes()
    copied = list(record_netcdf.read_records(path, layout, 2))
    assert len(copied) == 1 and len(copied[0]) == 2 * layout.size


def test_entries_of_fixed_size_change_in_their_place(file):
    path, layout = file
    write_entries(path, layout, 1, {"mass": np.array([7.0, 8.0], np.float32)})
    with netCDF4.Dataset(path) as dataset:
        assert dataset["mass"][:].tolist() == [1.0, 7.0, 8.0]
    write_entries(path, layout, 1, {"mass": np.array([2.0, 3.0], np.float32)})
    check(path, 2)
