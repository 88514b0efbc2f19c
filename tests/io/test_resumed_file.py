"""A file taken over by a run that goes on: its rows to the bit, its identity, and what is refused."""

import os
import re

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.atomic_netcdf import write_atomically
from taichi_lsm.core.schema import Variable
from taichi_lsm.io import global_attributes, resumed_file
from taichi_lsm.io.grains_file import GrainsWriter, snapshot_rows, static_rows
from taichi_lsm.io.netcdf_variables import Scalar
from taichi_lsm.io.run_file import RunWriter
from tests.helpers.output_files import (
    LABELS,
    PIECE,
    RUN,
    SCALARS,
    STAGE,
    attributes,
    effects,
    grains,
    grains_writer,
    run_row,
    run_writer,
)

CLOCK = "2026-11-27T18:00:{:02d}Z"


def run(path, **options):
    return run_writer(path, effects=effects(), **options)


def snapshots(path, **options):
    return grains_writer(path, grains(3)[0], 3, **options)


def append(writer, i):
    """Row or snapshot number i, whose texts have different lengths and whose numbers hold nan."""
    stage = ("settle", "a much longer stage")[i % 2]
    if isinstance(writer, RunWriter):
        writer.append(run_row(i) | {"stage": stage, "friction": np.nan if i == 2 else 0.1 * i})
        return
    rng = np.random.default_rng(i)
    arrays = {name: rng.standard_normal(np.shape(array)) for name, array in grains(3)[1].items()}
    writer.append(0.5 * i, arrays | {"stage": stage, "shear_strain": np.nan if i == 2 else 0.1 * i})


WRITERS = pytest.mark.parametrize("begin", [run, snapshots])


def bits(path):
    """Every variable: type, dimensions, and values, as bytes but for texts."""
    with netCDF4.Dataset(path) as dataset:
        dataset.set_auto_mask(False)
        values = {name: np.asarray(v[...]) for name, v in dataset.variables.items()}
        return {
            name: (v.dtype, v.dimensions, values[name].tolist() if v.dtype is str else values[name].tobytes())
            for name, v in dataset.variables.items()
        }


@WRITERS
@pytest.mark.parametrize("keep", [0, 1, 3])
def test_rows_behind_those_kept_are_those_of_a_file_written_in_one_go(tmp_path, begin, keep):
    """Four rows, the last `4 - keep` of which are dropped and made again after others were there."""
    whole, resumed = tmp_path / "whole.nc", tmp_path / "resumed.nc"
    writer = begin(whole)
    for i in range(5):
        append(writer, i)
    writer.close("complete")
    writer = begin(resumed)
    for i in (*range(keep), 7, 8, 9):
        append(writer, i)
    writer.close("failed")
    writer = begin(resumed, keep=keep)
    on_file = lsm.open_run(resumed)
    assert on_file.sizes["time"] == keep and on_file.run_status == "running"
    for i in range(keep, 5):
        append(writer, i)
    writer.close("complete")
    assert bits(resumed) == bits(whole)
    assert lsm.open_run(resumed).run_status == "complete"
    assert sorted(os.listdir(tmp_path)) == ["resumed.nc", "whole.nc"]


@WRITERS
def test_a_resumed_file_keeps_its_identity(tmp_path, begin, monkeypatch):
    """Its parameters and its other attributes are those of the run that goes on."""
    path, seconds = tmp_path / "file.nc", iter(range(60))
    for module in (global_attributes, resumed_file):
        monkeypatch.setattr(module, "utc_now", lambda: CLOCK.format(next(seconds)))
    writer = begin(path)
    append(writer, 0)
    first = lsm.open_run(path)
    for _ in range(2):
        longer = [Scalar("run", "a longer name of the run", "name of the run"), SCALARS[1], SCALARS[2]]
        begin(path, keep=0, scalars=longer)
    now = lsm.open_run(path)
    assert (now.id, now.date_created) == (first.id, first.date_created)
    lines = now.history.split("\n")
    assert lines[0] == first.history and len(lines) == 3
    assert all(re.fullmatch(r"2026-11-27T18:00:\d\dZ resumed by taichi_lsm \S+", line) for line in lines[1:])
    assert now.date_modified > first.date_modified and str(now.coords["run"].values) == "a longer name of the run"


@WRITERS
def test_time_goes_on_from_the_last_row_kept(tmp_path, begin):
    writer = begin(tmp_path / "file.nc")
    for i in range(3):
        append(writer, i)
    writer.close("interrupted")
    writer = begin(tmp_path / "file.nc", keep=2)
    with pytest.raises(lsm.InputError, match=r"must be finite and above the last (row|snapshot)'s 0\.5 s"):
        append(writer, 1)


def check_refused(path, begin, message, **options):
    """The message names the file and what to do; the file stays as it was."""
    before = path.read_bytes() if path.exists() else None
    with pytest.raises(lsm.InputError, match=rf"{re.escape(str(path))}: .*{message}"):
        begin(path, **options)
    assert (path.read_bytes() if path.exists() else None) == before
    assert os.listdir(path.parent) == [path.name] * path.exists()


@WRITERS
def test_a_file_that_cannot_be_continued_is_refused(tmp_path, begin):
    path = tmp_path / "file.nc"
    check_refused(path, begin, "there is no such file; resume in", keep=0)
    path.write_bytes(b"CDF\x02 and no more")
    check_refused(path, begin, "it is damaged .*resume in", keep=0)
    path.unlink()
    writer = begin(path)
    for i in range(2):
        append(writer, i)
    writer.close("complete")
    check_refused(path, begin, r"holds 2 (rows|whole snapshots), fewer than the 3 to keep; resume in", keep=3)
    for wrong in (-1, 1.5, True, "1"):
        check_refused(path, begin, rf"keep = {wrong!r}, must be a whole number", keep=wrong)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    check_refused(path, begin, "it is damaged .*resume in", keep=1)


def test_snapshots_that_were_cut_off_are_not_kept(tmp_path):
    path = tmp_path / "grains.nc"
    writer = snapshots(path)
    for i in range(2):
        append(writer, i)
    path.write_bytes(path.read_bytes()[:-5])
    check_refused(path, snapshots, "holds 1 whole snapshots, fewer than the 2 to keep", keep=2)
    append(snapshots(path, keep=1), 1)
    assert lsm.open_run(path).sizes["time"] == 2


def other_rows(path, keep):
    rows = [v for v in RUN if v.name != "friction"] + [Variable("work", ("time",), "f64", "J", "work")]
    options = {"auxiliary": ("shear_strain",), "text": STAGE, "scalars": SCALARS, "effects": effects()}
    RunWriter(path, rows, attributes(), LABELS, **options, keep=keep)


def fewer_effects(path, keep):
    run_writer(path, effects=effects()[:2], keep=keep)


def without_flags(path, keep):
    run(path, extra_attributes={}, keep=keep)


def other_labels(path, keep):
    labels = LABELS | {"platen": ["lower", "top"]}
    options = {"auxiliary": ("shear_strain",), "extra_attributes": PIECE, "text": STAGE, "scalars": SCALARS}
    RunWriter(path, RUN, attributes(), labels, **options, effects=effects(), keep=keep)


def heavier_grains(path, keep):
    static, _ = grains(3)
    grains_writer(path, static | {"mass": static["mass"] + 1e-16 * (np.arange(5) == 3)}, 3, keep=keep)


def more_grains(path, keep):
    grains_writer(path, grains(3, count=6)[0], 3, keep=keep)


def without_stage(path, keep):
    grains_writer(path, grains(3)[0], 3, text={}, keep=keep)


@pytest.mark.parametrize(
    ("begin", "resume", "message"),
    [
        (run, other_rows, "it lacks work; it has friction, this run has not; the attribute flag_meanings of piece"),
        (run, fewer_effects, r"parameter_effect has the shape \(10,\), not \(8,\); .*; and 1 differences more"),
        (run, without_flags, "the attribute flag_meanings of piece is left right, not missing"),
        (run, other_labels, r"platen_name\[1\] is upper, not top"),
        (snapshots, heavier_grains, r"mass\[3\] is 0\.\d+, not 0\.\d+"),
        (snapshots, more_grains, r"mass has the shape \(5,\), not \(6,\)"),
        (snapshots, without_stage, "it has stage, this run has not"),
    ],
)
def test_a_file_of_another_declaration_is_refused(tmp_path, begin, resume, message):
    path = tmp_path / "file.nc"
    append(begin(path), 0)
    check_refused(path, resume, rf"cannot be continued, .*{message}.*; resume in the folder of that run", keep=0)


def test_snapshots_of_another_layout_are_refused(tmp_path):
    """A file of HDF5, as earlier versions wrote it, and one whose variables lie in another order."""
    path, static, rows = tmp_path / "g.nc", grains(3)[0], snapshot_rows(3)
    write_atomically(path, lambda dataset: dataset.setncattr("title", "old"))
    check_refused(
        path, snapshots, "cannot be continued, it is no file of records, as this version writes; resume in", keep=0
    )
    GrainsWriter(path, static, static_rows(3), rows, attributes())

    def resume(path, keep):
        GrainsWriter(path, static, static_rows(3), rows[::-1], attributes(), keep=keep)

    check_refused(path, resume, "cannot be continued, its variables lie in another order; resume in", keep=0)


def test_precision_is_a_part_of_the_declaration(tmp_path):
    rows = [Variable("force", ("grain", "space"), "real", "N", "force")]
    path, static = tmp_path / "g.nc", grains(2)[0]
    GrainsWriter(path, static, static_rows(2), rows, attributes(), precision="f32")

    def resume(path, keep):
        GrainsWriter(path, static, static_rows(2), rows, attributes(), precision="f64", keep=keep)

    check_refused(path, resume, "force is of type float32, not float64", keep=0)
