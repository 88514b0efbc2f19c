"""Shapes in a file: bit for bit, and what is wrong with a file that is refused."""

from dataclasses import fields

import netCDF4
import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from tests.helpers.output_files import check_described


@pytest.fixture(scope="module")
def angular():
    return lsm.shapes.random_angular_shapes(1, 3)[0]


def assert_same(a, b):
    for field in fields(a):
        mine, other = getattr(a, field.name), getattr(b, field.name)
        if field.name == "members":
            for x, y in zip(mine, other, strict=True):
                assert_same(x, y)
        else:
            assert np.array_equal(mine, other), field.name


def test_shapes_come_back_from_a_file_bit_for_bit(tmp_path, angular):
    path = tmp_path / "shapes.nc"
    shapes = [
        lsm.disc(),
        lsm.sphere(),
        angular,
        lsm.shapes.regular_polyhedron(6),
        lsm.shapes.from_chain(angular, 0.01),
        lsm.shapes.crossed_bars(),
    ]
    lsm.shapes.save_shapes(path, shapes)
    for before, after in zip(shapes, lsm.shapes.load_shapes(path), strict=True):
        assert type(before) is type(after)
        assert_same(before, after)
    assert xr.open_dataset(path).attrs["title"] == "Grain shapes"
    check_described(path)
    with netCDF4.Dataset(path, "a") as file:
        file["shape_2"].variables["radius"][3] = np.nan
    with pytest.raises(InputError, match=r"shapes.nc: shape_2: radius"):
        lsm.shapes.load_shapes(path)
    (tmp_path / "text.nc").write_text("nothing")
    for name, words in (("text.nc", "cannot be read"), ("none.nc", "no such file")):
        with pytest.raises(InputError, match=words):
            lsm.shapes.load_shapes(tmp_path / name)


def test_a_file_that_cannot_be_written_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match=r"none.*cannot be written"):
        lsm.shapes.save_shapes(tmp_path / "none" / "shapes.nc", [lsm.disc()])
    with pytest.raises(InputError, match="'a disc' is not one of"):
        lsm.shapes.save_shapes(tmp_path / "shapes.nc", ["a disc"])
    assert not list(tmp_path.iterdir())


def less_than_no_face(file):
    """Of the 26 features of a cube."""
    for name, count in {"face_count": -1, "edge_count": 19, "vertex_count": 8}.items():
        file["shape_0"][name].assignValue(count)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda file: file.setncattr("shapes", "two"), "attribute shapes is 'two', must be 0 to 100000"),
        (lambda file: file.setncattr("shapes", 1e12), "attribute shapes is .*, must be 0 to 100000"),
        (lambda file: file["shape_0"].setncattr("class", np.arange(3)), "is of class"),
        (lambda file: file["shape_1"].setncattr("members", np.int64(10**12)), "attribute members is"),
        (lambda file: file["shape_0"]["first_bound"].__setitem__(2, 10**9), "first_bound: must begin with 0"),
        (less_than_no_face, "face_count, edge_count, vertex_count: must be >= 0"),
    ],
)
def test_altered_files_are_refused(tmp_path, change, words):
    path = tmp_path / "shapes.nc"
    lsm.shapes.save_shapes(path, [lsm.shapes.regular_polyhedron(6), lsm.shapes.crossed_bars()])
    with netCDF4.Dataset(path, "a") as file:
        change(file)
    with pytest.raises(InputError, match=rf"shapes\.nc: .*{words}"):
        lsm.shapes.load_shapes(path)


def test_a_text_in_place_of_numbers_is_refused(tmp_path):
    path = tmp_path / "shapes.nc"
    lsm.shapes.save_shapes(path, [lsm.disc()])
    with netCDF4.Dataset(path, "a") as file:
        file["shape_0"].renameVariable("measure", "former")
        file["shape_0"].createVariable("measure", str)[...] = "much"
    with pytest.raises(InputError, match=r"measure is of type .*, must be numbers"):
        lsm.shapes.load_shapes(path)
