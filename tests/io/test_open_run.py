"""Opening files of runs beside other readers of the same process."""

import numpy as np
import xarray

import taichi_lsm as lsm
from tests.helpers.output_files import run_row, run_writer


def test_a_file_that_xarray_has_open_is_opened_again_and_again(tmp_path):
    """The library below crashes the process if it opens such a file by its name a third time."""
    path = tmp_path / "run.nc"
    writer = run_writer(path)
    for i in range(5):
        writer.append(run_row(i))
    writer.close("complete")
    lazily = xarray.open_dataset(path)
    for _ in range(3):
        dataset = lsm.open_run(path)
    name = next(name for name, variable in dataset.data_vars.items() if variable.dims == ("time",))
    assert np.array_equal(lazily[name].values, dataset[name].values)
