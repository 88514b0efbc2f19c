"""The table of an experiment that consists of many runs, one row each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import taichi_lsm as lsm
from workflows.common.parameters import Params, to_toml

if TYPE_CHECKING:
    import xarray

Rows = list[dict[str, Any]]  # of a table: one for each run, with equal keys


def attributes_of(params: Params, dt: float, title: str, summary: str) -> dict[str, Any]:
    """Global attributes of a file of the experiment with these parameters; dt [s]: its smallest time step."""
    return lsm.file_attributes(title, summary, to_toml(params), params.seed, dt, params.arch, params.precision)


def write_runs(
    path: Path,
    rows: Sequence[Mapping[str, Any]],
    variables: Sequence[Any],
    params: Params,
    dt: float,
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
    params, dt
        Of the experiment; its smallest time step [s].
    title, summary
        Of the file.
    options
        See `lsm.write_table`, also for what it refuses.
    """
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    lsm.write_table(path, columns, variables, attributes_of(params, dt, title, summary), **options)
    return lsm.open_run(path)
