"""Damaged files, and those that declare more than they hold, are refused before the library below reads them."""

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.netcdf_input import HEAP, HEAP_HEADER, opened_netcdf
from tests.helpers.output_files import table


@pytest.mark.parametrize("filling", [b"\0", b"\xff"])
def test_a_damaged_heap_of_texts_is_refused(tmp_path, filling):
    """HDF5 2.2 never returns from opening the one with zeros."""
    path = tmp_path / "compare.nc"
    table(path)
    data = path.read_bytes()
    first = data.index(HEAP) + HEAP_HEADER
    for at, words in ((first + 8, "damaged at byte"), (first - 8, "more than the file")):
        path.write_bytes(data[:at] + 8 * filling + data[at + 8 :])
        with pytest.raises(lsm.InputError, match=rf"compare\.nc: cannot be read \(.*({words}|has 0 bytes)"):
            lsm.open_run(path)
    path.write_bytes(data)
    assert lsm.open_run(path)["shape"].values.tolist() == ["sphere", "angular"]


@pytest.mark.parametrize("length", [10**9, 10**12, 2**48])
def test_what_a_file_declares_is_bounded_by_its_size(tmp_path, length):
    path = tmp_path / "shapes.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.shapes = np.int64(1)
        group = file.createGroup("shape_0")
        group.setncattr("class", "PatchGrain")
        group.createDimension("patches", length)
        group.createVariable("radius", "f8", ("patches",), zlib=True)
    with pytest.raises(lsm.InputError, match=r"shapes\.nc: cannot be read as NetCDF \(it declares .* bytes of values"):
        lsm.shapes.load_shapes(path)
    with pytest.raises(ValueError, match="it declares"), opened_netcdf(path):
        pass


def test_a_full_variable_that_is_packed_well_is_read(tmp_path):
    path = tmp_path / "packed.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("row", 4_000_000)
        file.createVariable("zero", "f8", ("row",), zlib=True, complevel=9)[:] = 0.0
    assert 32e6 / path.stat().st_size > 100.0
    with opened_netcdf(path) as file:
        assert len(file["zero"][:]) == 4_000_000
