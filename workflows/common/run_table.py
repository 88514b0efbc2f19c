"""Files of what an experiment found: the result of one run, and the table of many runs, one row each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import taichi_lsm as lsm
from workflows.common.parameters import Params, to_toml

if TYPE_CHECKING:
    import xarray

Rows = list[dict[str, Any]]  # of a table: one for each run, with equal keys
TIME_STEP = lsm.Variable("time_step", ("run",), "f64", "s", "time step of the run")


def attributes_of(
    params: Params, title: str, summary: str, seed: int | None = None, dt: float | None = None
) -> dict[str, Any]:
    """Global attributes of a file of the experiment with these parameters; seed and dt [s] where all has the same."""
    return lsm.file_attributes(title, summary, to_toml(params), seed, dt, params.arch, params.precision)


def write_result(
    path: Path,
    result: xarray.Dataset | xarray.DataTree,
    params: Params,
    title: str,
    summary: str,
    dt: float | None = None,
) -> None:
    """Write what a complete run came to, one group or several, to the NetCDF file `path`; dt: time step [s]."""
    import xarray

    whole = result.copy()
    whole.attrs |= attributes_of(params, title, summary, params.seed, dt) | {"run_status": "complete"}
    encoding: Any = _without_fill_values(whole)
    if isinstance(whole, xarray.DataTree):
        encoding = {group.path: _without_fill_values(group) for group in whole.subtree}
    with lsm.replacing(path) as new:
        whole.to_netcdf(new, engine="netcdf4", encoding=encoding)


def _without_fill_values(group: xarray.Dataset | xarray.DataTree) -> dict[Any, dict[str, None]]:
    """Encoding of the variables of a group: no value is missing, and nan is nan to every reader."""
    return {name: {"_FillValue": None} for name in group.variables}


def write_runs(
    path: Path,
    rows: Sequence[Mapping[str, Any]],
    variables: Sequence[Any],
    params: Params,
    title: str,
    summary: str,
    **options: Any,
) -> xarray.Dataset:
    """Write a table of runs to the NetCDF file `path`; returns it opened.

    Parameters
    ----------
    path
        File to write.
    rows
        One mapping per run, with equal keys.
    variables
        Schema rows of the numbers.
    params
        Of the experiment.
    title, summary
        Of the file.
    options
        See `lsm.write_table`, also for what it refuses.
    """
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    seed = None if "seed" in columns else params.seed
    lsm.write_table(path, columns, variables, attributes_of(params, title, summary, seed), **options)
    return lsm.open_run(path)
