"""grains.nc: snapshots survive kills, cut files are refused, and what does not fit the format is refused by name."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.schema import Variable
from taichi_lsm.io.grains_file import GrainsWriter, static_rows
from tests.helpers.output_files import attributes, grains, grains_writer

ROOT = Path(__file__).resolve().parents[2]
WRITE_FOREVER = """
import sys
from pathlib import Path
from tests.io.test_grains_file import snapshot
from tests.helpers.output_files import grains, grains_writer
static, _ = grains(3, count=2000)
writer = grains_writer(Path(sys.argv[1]), static, 3)
i = 0
while True:
    writer.append(0.5 * i, snapshot(i, 2000))
    i += 1
"""


def snapshot(i, count=5):
    """Snapshot number i; every value tells i, so that a mixed-up or unfinished one shows."""
    return {
        "position": np.full((count, 3), i + 0.25),
        "velocity": np.full((count, 3), -i),
        "angular_velocity": np.full((count, 3), 2 * i),
        "orientation": np.full((count, 4), 3 * i),
        "shear_strain": 0.01 * i,
        "stage": ("settle", "schubkräftig")[i % 2],
    }


def check_snapshots(path, run_status="running"):
    """Open the file, check that every snapshot is whole, return their number."""
    dataset = lsm.open_run(path)
    i = np.arange(dataset.sizes["time"])
    np.testing.assert_array_equal(dataset.time, 0.5 * i)
    np.testing.assert_array_equal(dataset.shear_strain, 0.01 * i)
    values = {"position": i + 0.25, "velocity": -i, "angular_velocity": 2 * i, "orientation": 3 * i}
    for name, expected in values.items():
        assert (dataset[name].values == expected[:, None, None]).all(), name
    assert dataset.stage.values.tolist() == [("settle", "schubkräftig")[k % 2] for k in i]
    assert dataset.run_status == run_status
    return len(i)


@pytest.mark.validate
def test_kill_at_any_instant_leaves_whole_snapshots(tmp_path):
    """Five writers are killed in the middle of their work while a reader opens their files again and again."""
    rng = random.Random(3)
    for attempt in range(5):
        path = tmp_path / f"grains{attempt}.nc"
        command = [sys.executable, "-c", WRITE_FOREVER, str(path)]
        process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE)
        try:
            deadline = time.monotonic() + 30
            while not path.exists() or check_snapshots(path) < 3:
                assert process.poll() is None, process.stderr.read().decode()
                assert time.monotonic() < deadline, "the writer does not start"
                time.sleep(0.01)
            check_snapshots(path)
            time.sleep(rng.uniform(0, 0.01))
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()
            process.stderr.close()
        count = check_snapshots(path)
        assert count >= 3
        static, _ = grains(3, count=2000)
        writer = grains_writer(path, static, 3, keep=count)
        writer.append(0.5 * count, snapshot(count, 2000))
        assert check_snapshots(path) == count + 1
        os.unlink(path)


def written(path, count=3):
    writer = grains_writer(path, grains(3)[0], 3)
    for i in range(count):
        writer.append(0.5 * i, snapshot(i))
    return writer


def test_files_cut_off_are_refused_and_trailing_bytes_ignored(tmp_path):
    """Where a record is missing the netCDF library would give zeros."""
    path = tmp_path / "grains.nc"
    written(path).close("complete")
    whole = path.read_bytes()
    path.write_bytes(whole + b"half a record")
    assert check_snapshots(path, "complete") == 3
    for data in (whole[:-1], whole[:-900]):
        path.write_bytes(data)
        with pytest.raises(lsm.InputError, match=r"cannot be read \(it counts 3 snapshots and holds [12]\), must be"):
            lsm.open_run(path)
    for share in (0.01, 0.3, 0.6):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(lsm.InputError, match=r"cannot be read .*must be a NetCDF file that this package wrote"):
            lsm.open_run(path)


@pytest.mark.parametrize("run_status", ["complete", "failed", "interrupted"])
def test_the_end_of_a_run_is_noted_in_its_place(tmp_path, run_status):
    path = tmp_path / "grains.nc"
    writer = written(path)
    size = path.stat().st_size
    writer.close(run_status)
    assert check_snapshots(path, run_status) == 3 and path.stat().st_size == size
    with pytest.raises(lsm.InputError, match=rf"closed \({run_status}\)"):
        writer.append(9.0, snapshot(9))


def test_texts_that_have_no_room_are_refused(tmp_path):
    path = tmp_path / "grains.nc"
    writer = written(path, 1)
    with pytest.raises(lsm.InputError, match=r"stage: 'ä+' has 66 bytes, must have at most 64"):
        writer.append(0.5, snapshot(1) | {"stage": "ä" * 33})
    writer.append(0.5, snapshot(1))
    assert check_snapshots(path) == 2


def test_variables_that_the_format_cannot_hold_are_refused(tmp_path):
    """More than 4 GiB in one snapshot, before anything is allocated; and nothing at all."""
    static, _ = grains(2)
    rows = [Variable("force", ("grain", "a", "b"), "real", "N", "force")]
    for count, message in (
        (40000, r"force: shape \(5, 40000, 40000\), 32000000000 bytes; .*4294967292 bytes"),
        (0, r"force: shape \(5, 0, 0\), 0 bytes"),
    ):
        labels = {dimension: [str(i) for i in range(count)] for dimension in "ab"}
        with pytest.raises(lsm.InputError, match=message):
            GrainsWriter(tmp_path / "g.nc", static, static_rows(2), rows, attributes(), labels, precision="f32")
    assert not os.listdir(tmp_path)
