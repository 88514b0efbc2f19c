"""Opens the table of a sweep as a cube."""

import json
import math
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import InputError
from .open_run import open_file

if TYPE_CHECKING:
    from xarray import Dataset

EXPECTED = "must be the sweep.nc of lsm sweep, or the folder with it"


def open_sweep(path: str | PathLike[str]) -> "Dataset":
    """The runs of a sweep as an xarray.Dataset with one dimension for each parameter that varies.

    Parameters
    ----------
    path
        sweep.nc, or the folder of the sweep.

    Returns
    -------
    xarray.Dataset
        Parameters of a grid, and the seeds of replicas, are dimensions with their values; those that were drawn or went
        together vary along `sample` or `together`. Metrics are nan where a run gave none: `status` and `note` say why.

    Raises
    ------
    InputError
        If it is no such file.
    """
    path = Path(path) / "sweep.nc" if Path(path).is_dir() else Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file, {EXPECTED}")
    table = open_file(path)
    try:
        factors = [(f["dim"], list(f["names"]), int(f["size"])) for f in json.loads(table.attrs["factors"])]
        sizes = {dim: size for dim, _, size in factors}
        if math.prod(sizes.values()) != table.sizes["run"] or len(sizes) < len(factors):
            raise ValueError("another number of runs")
        return _cube(table, factors, sizes)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: has no factors of a sweep ({error}), {EXPECTED}") from None


def _cube(table: "Dataset", factors: list[tuple[str, list[str], int]], sizes: dict[str, int]) -> "Dataset":
    """The rows of a table, whose last factor varies fastest, along one dimension for each factor."""
    import xarray

    shape, dims = tuple(sizes.values()), tuple(sizes)
    along = {name: dim for dim, names, _ in factors for name in names}
    cubes = {}
    for name, variable in table.variables.items():
        cube = xarray.Variable(dims, variable.values.reshape(shape), variable.attrs)
        if name in along:  # the same wherever else one goes
            cube = cube.isel({dim: 0 for dim in dims if dim != along[name]})
        cubes[name] = cube
    kept = {name: cube for name, cube in cubes.items() if name in table.data_vars}
    coordinates = {name: cube for name, cube in cubes.items() if name in table.coords}
    return xarray.Dataset(kept, coordinates, table.attrs)
