"""Opens the files of a run."""

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import InputError

if TYPE_CHECKING:
    from xarray import Dataset

EXPECTED = "must be a NetCDF file that this package wrote, such as run.nc, grains.nc or compare.nc"


def open_run(path: str | PathLike[str]) -> "Dataset":
    """A file of this package as an xarray.Dataset in memory: a run that goes on may rewrite it meanwhile.

    Parameters
    ----------
    path
        A file of a run, such as run.nc or grains.nc, or a table such as compare.nc.

    Returns
    -------
    xarray.Dataset
        All variables, with units and long_name; `run_status` among the attributes tells how the run ended.

    Raises
    ------
    InputError
        If the file is missing, truncated or damaged, no NetCDF file, or not written by this package.
    """
    import xarray  # takes long to load

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}, {EXPECTED}")
    try:
        dataset = xarray.load_dataset(path, engine="netcdf4")
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}), {EXPECTED}; it may be truncated or damaged") from None
    if "run_status" not in dataset.attrs:
        raise InputError(f"{path}: has no attribute run_status, {EXPECTED}")
    return dataset
