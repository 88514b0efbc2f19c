"""Wrong rows, declarations, snapshots and tables are refused by name and leave no trace; so are unreadable files."""

import os
import zlib

import netCDF4
import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from taichi_lsm.core.schema import Variable
from taichi_lsm.io.run_file import RunWriter
from tests.helpers.output_files import LABELS, RUN, attributes, grains, grains_writer, run_row, run_writer, table


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"friction": None}, "missing friction"),
        ({"frictoin": 0.1}, "unknown frictoin"),
        ({"dissipated_energy": [1.0]}, "dissipated_energy: shape"),
        ({"contact_count": 1.5}, "contact_count: values of type float64"),
        ({"contact_count": 2**40}, "contact_count: .* 32 bits"),
        ({"friction": "high"}, "friction: values of type"),
        ({"time": 0.5}, "time: 0.5 s"),
        ({"time": np.nan}, "time: nan s"),
    ],
)
def test_wrong_row_is_refused_and_leaves_no_trace(tmp_path, change, message):
    writer = run_writer(tmp_path / "run.nc")
    writer.append(run_row(1))
    row = {**run_row(2), **change}
    if change == {"friction": None}:
        del row["friction"]
    with pytest.raises(lsm.InputError, match=message):
        writer.append(row)
    writer.append(run_row(2))
    writer.close("complete")
    with xr.open_dataset(tmp_path / "run.nc") as ds:
        assert ds.contact_count.values.tolist() == [10, 20] and ds.friction.values.tolist() == [1.25, 2.25]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"coordinates": {"effect": ["a"]}}, "plate_velocity: dimension 'platen'"),
        ({"auxiliary": ("strain",)}, "auxiliary: strain unknown"),
        ({"extra_attributes": {"stages": {}}}, "extra_attributes: stages unknown"),
        ({"variables": [*RUN, RUN[0]]}, "declared twice: shear_strain"),
        ({"variables": [Variable("mass", ("grain",), "f64", "kg", "mass")]}, "mass: dims"),
    ],
)
def test_wrong_declaration_is_refused(tmp_path, options, message):
    options = {"variables": RUN, "coordinates": LABELS, **options}
    with pytest.raises(lsm.InputError, match=message):
        RunWriter(tmp_path / "run.nc", attributes=attributes(), **options)
    assert not os.listdir(tmp_path)


def test_closed_writer_refuses_rows(tmp_path):
    writer = run_writer(tmp_path / "run.nc")
    with pytest.raises(lsm.InputError, match="run_status 'done'"):
        writer.close("done")
    writer.close("failed")
    with pytest.raises(lsm.InputError, match=r"closed \(failed\)"):
        writer.append(run_row(0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"patch_count": [1, 2]}, "patch_count: adds up to 3"),
        ({"shape_index": [0, 1, 2, 0, 1]}, "shape_index: 0..2"),
        ({"mass": np.ones(4)}, "inertia: shape|mass: shape"),
        ({"colour": 1}, "unknown colour"),
    ],
)
def test_wrong_constants_are_refused(tmp_path, change, message):
    static, _ = grains(2)
    with pytest.raises(lsm.InputError, match=message):
        grains_writer(tmp_path / "g.nc", {**static, **change}, 2)
    assert not os.listdir(tmp_path)


def test_wrong_snapshot_is_refused(tmp_path):
    static, snapshot = grains(3)
    snapshot["stage"] = "settle"
    writer = grains_writer(tmp_path / "g.nc", static, 3)
    with pytest.raises(lsm.InputError, match="missing velocity"):
        writer.append(0.0, {k: v for k, v in snapshot.items() if k != "velocity"})
    with pytest.raises(lsm.InputError, match="stage: 2, must be a text"):
        writer.append(0.0, {**snapshot, "stage": 2})
    with pytest.raises(lsm.InputError, match="position: shape"):
        writer.append(0.0, {**snapshot, "position": np.ones((5, 2))})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"friction_mean": [0.1]}, "friction_mean: shape"),
        ({"shape": ["sphere", 2]}, "shape: 2 texts expected"),
        ({"mu": [1, 2]}, "unknown mu"),
    ],
)
def test_wrong_table_is_refused(tmp_path, change, message):
    with pytest.raises(lsm.InputError, match=message):
        table(tmp_path / "compare.nc", **change)
    assert not os.listdir(tmp_path)


def test_no_file_is_written_without_a_folder(tmp_path):
    with pytest.raises(
        lsm.InputError, match=r"compare\.nc: cannot be written, there is no folder .*runs; make it first"
    ):
        table(tmp_path / "runs" / "compare.nc")
    assert not os.listdir(tmp_path)


@pytest.fixture
def run_file(tmp_path):
    """A whole file, large enough to be compressed: what it is damaged for."""
    path = tmp_path / "run.nc"
    writer = run_writer(path)
    for i in range(3000):
        writer.append(run_row(i))
    writer.close("complete")
    return path


def check_refused(path, reason):
    with pytest.raises(lsm.InputError, match=rf"{path.name}: {reason}.*must be a NetCDF file that this package wrote"):
        lsm.open_run(path)


def test_missing_files_and_folders_are_named(tmp_path):
    check_refused(tmp_path / "run.nc", "no such file")
    with pytest.raises(lsm.InputError, match="holds no file of a run yet"):
        lsm.open_run(tmp_path)


def test_whole_run_is_opened_and_truncated_ones_are_refused(run_file):
    assert lsm.open_run(str(run_file)).sizes["time"] == 3000
    whole = run_file.read_bytes()
    for share in (0.0, 0.1, 0.5, 0.99):
        run_file.write_bytes(whole[: int(share * len(whole))])
        check_refused(run_file, "cannot be read")


def test_run_with_damaged_data_is_refused(run_file):
    """Bytes of compressed values are overwritten; the header stays whole."""
    with netCDF4.Dataset(run_file) as dataset:
        stored = np.ascontiguousarray(dataset["friction"][:])
    assert len(stored) == 3000
    whole = bytearray(run_file.read_bytes())
    start = max(zlib_streams(whole), key=lambda at: at[1])[0]
    whole[start + 2 : start + 200] = bytes(198)
    run_file.write_bytes(whole)
    check_refused(run_file, "cannot be read")


def zlib_streams(data):
    """(start, length) of everything in `data` that can be decompressed."""
    found = []
    for start in range(len(data) - 1):
        if data[start : start + 2] == b"\x78\x01":  # level 1, as files are written
            reader = zlib.decompressobj()
            try:
                reader.decompress(bytes(data[start:]))
            except zlib.error:
                continue
            if reader.eof:
                found.append((start, len(data) - start - len(reader.unused_data)))
    return found


@pytest.mark.parametrize("content", [b"not a file of numbers", bytes(5000)])
def test_files_of_another_kind_are_refused(tmp_path, content):
    (tmp_path / "run.nc").write_bytes(content)
    check_refused(tmp_path / "run.nc", "cannot be read")


def test_netcdf_files_of_another_program_are_refused(tmp_path):
    xr.Dataset({"friction": ("time", [0.1])}).to_netcdf(tmp_path / "other.nc")
    check_refused(tmp_path / "other.nc", "has no attribute run_status")
