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
TIME_STEP = lsm.Variable("time_step", ("run",), "f64", "s", "time step of the run")


def attributes_of(
    params: Params, title: str, summary: str, seed: int | None = None, dt: float | None = None
) -> dict[str, Any]:
    """Global attributes of a file of the experiment with these parameters; seed and dt [s] where all has the same."""
    return lsm.file_attributes(title, summary, to_toml(params), seed, dt, params.arch, params.precision)


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
