"""A disk that is full, read-only or gone while a run writes: the error says so, and what was there stays."""

import os
import resource
import shutil
import subprocess
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers.output_files import grains, grains_writer, run_row, run_writer
from tests.io.test_contacts_file import writer as contacts_writer
from tests.io.test_grains_file import snapshot

COUNT = 500  # grains, 0.05 MB in a snapshot


@pytest.fixture
def disk(tmp_path):
    """A file system of 1 MB of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no file system can be mounted: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)  # -l: HDF5 keeps a file open that it could not write


@contextmanager
def nearly_full(folder, left):
    """Another file takes all but `left` bytes."""
    ballast = folder / "ballast"
    ballast.write_bytes(bytes(shutil.disk_usage(folder).free - left))
    yield
    ballast.unlink()


def check_fails(action, path, reason):
    """The error names the file, what is wrong and what to do; no temporary file is left."""
    with pytest.raises(lsm.SimulationError, match=rf"{path}: cannot be written.*{reason}") as raised:
        action()
    assert ("Errno" not in str(raised.value) and raised.value.__cause__ is not None) or "gone" in reason
    if path.parent.is_dir():
        assert not [name for name in os.listdir(path.parent) if name.endswith(".part")]


def write_snapshots(path):
    writer = grains_writer(path, grains(3, COUNT)[0], 3)
    for i in range(3):
        writer.append(0.5 * i, snapshot(i, COUNT))
    return writer


def write_rows(path):
    """A file with three rows, a fourth one is buffered."""
    writer = run_writer(path, flush_seconds=1e9)
    for i in range(3):
        writer.append(run_row(i))
    writer.flush()
    writer.append(run_row(3))
    return writer


def test_snapshots_on_a_full_disk(disk):
    """Earlier ones stay, how the run ended can still be noted, and with room it goes on."""
    path = disk / "grains.nc"
    writer = write_snapshots(path)
    size = path.stat().st_size
    full = rf"disk full: 0\.\d MB free in {disk}; make room and resume"
    with nearly_full(disk, 20000):  # less than half a snapshot
        check_fails(partial(writer.append, 1.5, snapshot(3, COUNT)), path, full)
        assert path.stat().st_size == size and lsm.open_run(path).sizes["time"] == 3
    writer.append(1.5, snapshot(3, COUNT))
    with nearly_full(disk, 0):
        writer.close("failed")
    assert lsm.open_run(path).run_status == "failed"
    np.testing.assert_array_equal(lsm.open_run(path).position[:, 0, 0], [0.25, 1.25, 2.25, 3.25])


def many_contacts(i, count=2000):
    """A moment of 0.06 MB."""
    values = {"shear_strain": 0.1 * i, "parted_power": 0.0, "stage": "shear"}
    whole = np.full(count, i)
    return 0.5 * i, values, {"first_id": whole, "sliding": whole, "normal": np.ones((count, 2)), "normal_force": whole}


def test_contacts_on_a_full_disk(disk):
    """As snapshots; at the end there is no room for a copy without spare moments, and the file is kept as it is."""
    path = disk / "contacts.nc"
    writer = contacts_writer(path)
    for i in range(3):
        writer.append(*many_contacts(i))
    full = rf"disk full: 0\.\d MB free in {disk}; make room and resume"
    with nearly_full(disk, 20000):
        check_fails(partial(writer.append, *many_contacts(3)), path, full)
        assert lsm.open_run(path).sizes["contact"] == 6000 and len(writer) == 3
    writer.append(*many_contacts(3))
    with nearly_full(disk, 0):
        writer.close("failed")
    dataset = lsm.open_run(path)
    assert dataset.run_status == "failed" and dataset.sizes["contact"] == 8000
    assert np.isfinite(dataset.time).sum() == 4 and dataset.first_id.values[::2000].tolist() == [0, 1, 2, 3]


def test_rows_on_a_full_disk(disk):
    """Earlier ones stay, and the next write has all."""
    path = disk / "run.nc"
    writer = write_rows(path)
    full = rf"disk full: 0\.\d MB free in {disk}; make room and resume"
    with nearly_full(disk, 8000):
        free = shutil.disk_usage(disk).free
        for action in (writer.flush, partial(writer.close, "failed")):
            check_fails(action, path, full)
            assert shutil.disk_usage(disk).free == free  # nothing takes space that has no name
        assert lsm.open_run(path).contact_count.values.tolist() == [0, 10, 20]
    writer.close("interrupted")
    assert lsm.open_run(path).contact_count.values.tolist() == [0, 10, 20, 30]


def test_a_first_file_on_a_full_disk(disk):
    with nearly_full(disk, 0):
        for begin, name in ((write_rows, "run.nc"), (write_snapshots, "grains.nc")):
            check_fails(partial(begin, disk / name), disk / name, "disk full")
        assert os.listdir(disk) == ["ballast"]


def test_a_disk_that_became_read_only(disk):
    writers = [write_rows(disk / "run.nc"), write_snapshots(disk / "grains.nc")]
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    for writer in writers:
        check_fails(partial(writer.close, "failed"), writer.path, r"free in .*; make the file and its folder writable")
        assert lsm.open_run(writer.path).sizes["time"] == 3


@contextmanager
def largest_file(size):
    """No file may become larger than `size` bytes."""
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, former[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)


def test_a_limit_of_the_system(tmp_path):
    """Runs where no file system can be mounted, too."""
    rows, snapshots = write_rows(tmp_path / "run.nc"), write_snapshots(tmp_path / "grains.nc")
    with largest_file(snapshots.path.stat().st_size + 20000):
        check_fails(partial(snapshots.append, 1.5, snapshot(3, COUNT)), snapshots.path, r"\(File too large; .*resume")
    with largest_file(8000):
        check_fails(rows.flush, rows.path, r"free in .*resume")
    for writer in (rows, snapshots):
        assert lsm.open_run(writer.path).sizes["time"] == 3
    rows.close("complete")
    snapshots.append(1.5, snapshot(3, COUNT))
    for writer in (rows, snapshots):
        assert lsm.open_run(writer.path).sizes["time"] == 4


def test_a_folder_that_was_removed(tmp_path):
    """No folder at the start is a mistake of the user, later it is a failure of the run."""
    folder = tmp_path / "out"
    for begin in (write_rows, write_snapshots):
        with pytest.raises(lsm.InputError, match=r"cannot be written, there is no folder .*out; make it first"):
            begin(folder / "file.nc")
    folder.mkdir()
    rows, snapshots = write_rows(folder / "run.nc"), write_snapshots(folder / "grains.nc")
    shutil.rmtree(folder)
    for writer in (rows, snapshots):
        check_fails(partial(writer.close, "failed"), writer.path, rf"the folder {folder} is gone")
