"""Wrong rows, declarations, snapshots and tables are refused by name and leave no trace."""

import os

import numpy as np
import pytest
import xarray as xr

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
    with pytest.raises(ValueError, match=message):
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
    with pytest.raises(ValueError, match=message):
        RunWriter(tmp_path / "run.nc", attributes=attributes(), **options)
    assert not os.listdir(tmp_path)


def test_closed_writer_refuses_rows(tmp_path):
    writer = run_writer(tmp_path / "run.nc")
    with pytest.raises(ValueError, match="run_status 'done'"):
        writer.close("done")
    writer.close("failed")
    with pytest.raises(ValueError, match=r"closed \(failed\)"):
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
    with pytest.raises(ValueError, match=message):
        grains_writer(tmp_path / "g.nc", {**static, **change}, 2)
    assert not os.listdir(tmp_path)


def test_wrong_snapshot_is_refused(tmp_path):
    static, snapshot = grains(3)
    writer = grains_writer(tmp_path / "g.nc", static, 3)
    with pytest.raises(ValueError, match="missing velocity"):
        writer.append(0.0, {k: v for k, v in snapshot.items() if k != "velocity"})
    with pytest.raises(ValueError, match="position: shape"):
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
    with pytest.raises(ValueError, match=message):
        table(tmp_path / "compare.nc", **change)
    assert not os.listdir(tmp_path)
