"""Targets from the series of a laboratory: friction of the steady state, with an error that its correlation allows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError, finite, shown
from workflows.calibrate.laboratory_csv import read_columns
from workflows.calibrate.targets import Target
from workflows.calibrate.units import size_of
from workflows.common.parameter_problems import as_written, nearest

if TYPE_CHECKING:
    import xarray

KEYS = ("file", "columns", "steady_from")
KINDS = {  # what columns may be, and the kind of their units
    "displacement": "length",
    "shear_strain": "number",
    "layer_thickness": "length",
    "shear_stress": "stress",
    "normal_stress": "stress",
    "friction": "number",
}
NEEDED = "friction, or shear_stress and normal_stress"
UNEVEN = 0.01  # of the mean spacing of rows, beyond which they are put on even spacing


def laboratory_targets(table: Any, folder: Path) -> tuple[Target, ...]:
    """Read the table `[calibrate.laboratory]` and the file that it names.

    Parameters
    ----------
    table
        `file`; `columns`, {what: {column, unit}} for KINDS; `steady_from`, the shear strain from which the state is
        steady, or {value, unit} of a displacement.
    folder
        That from which `file` counts.

    Returns
    -------
    tuple
        friction_mean, whose error respects autocorrelation (`lsm.statistics`).

    Raises
    ------
    InputError
        With the key or the file, row and column, the value, and what to do.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"calibrate.laboratory = {shown(table)}: must be a table")
    if unknown := sorted(set(table) - set(KEYS)):
        hint = nearest(unknown[0], KEYS)
        raise InputError(
            f"calibrate.laboratory.{as_written(unknown[0])}: unknown, must be one of {', '.join(KEYS)}.{hint}"
        )
    file = table.get("file")
    if not isinstance(file, str) or not file:
        raise InputError(f"calibrate.laboratory.file = {shown(file)}: must be the path of a CSV file")
    path, (headers, sizes) = folder / file, _columns(table.get("columns"))
    columns = {what: sizes[what] * values for what, values in read_columns(path, headers).items()}
    _check_rows(path, columns, headers)
    along, start = _along(table.get("steady_from"), columns, path)
    friction = _friction(path, _even(along, columns, path), start)
    if math.isnan(friction.standard_error):
        raise InputError(
            f"{path}: the error of the mean friction is unknown: {friction.unknown}; take more rows of the steady "
            "state, or give calibrate.targets.friction_mean with an error"
        )
    return (Target("friction_mean", friction.mean, friction.standard_error, freedom=friction.degrees_of_freedom),)


def _columns(given: Any) -> tuple[dict[str, str], dict[str, float]]:
    """(header, size of the unit in SI) of each column."""
    key = "calibrate.laboratory.columns"
    if not isinstance(given, Mapping) or not given:
        raise InputError(
            f"{key} = {shown(given)}: must be a table of {{column = ..., unit = ...}} by {', '.join(KINDS)}"
        )
    if unknown := sorted(set(given) - set(KINDS)):
        raise InputError(
            f"{key}.{as_written(unknown[0])}: unknown, must be one of {', '.join(KINDS)}.{nearest(unknown[0], KINDS)}"
        )
    for what, entry in given.items():
        if (
            not isinstance(entry, Mapping)
            or set(entry) - {"column", "unit"}
            or not isinstance(entry.get("column"), str)
        ):
            raise InputError(f'{key}.{what} = {shown(entry)}: must be {{column = "HEADER", unit = "UNIT"}}')
    if not ("friction" in given or {"shear_stress", "normal_stress"} <= set(given)):
        raise InputError(f"{key}: must have {NEEDED}")
    if not {"displacement", "shear_strain"} & set(given):
        raise InputError(f"{key}: must have displacement or shear_strain, by which rows follow each other")
    sizes = {what: size_of(entry.get("unit", "1"), KINDS[what], f"{key}.{what}.unit") for what, entry in given.items()}
    return {what: entry["column"] for what, entry in given.items()}, sizes


def _check_rows(path: Path, columns: Mapping[str, NDArray], headers: Mapping[str, str]) -> None:
    """Refuse values that no measurement has, by row and column."""
    for what in ("normal_stress", "layer_thickness"):
        wrong = np.flatnonzero(columns[what] <= 0.0) if what in columns else []
        if len(wrong):
            value = columns[what][wrong[0]]
            raise InputError(
                f"{path}, row {wrong[0] + 1} after the header, column {as_written(headers[what])}: {value:g} in SI "
                "units, must be > 0; compression is positive"
            )


def _along(steady: Any, columns: Mapping[str, NDArray], path: Path) -> tuple[NDArray, float]:
    """(what rows are ordered by, its value from which the state is steady): shear strain, or displacement [m]."""
    key = "calibrate.laboratory.steady_from"
    if isinstance(steady, Mapping):
        size = size_of(steady.get("unit"), "length", f"{key}.unit")
        if not finite(steady.get("value")):
            raise InputError(f"{key}.value = {shown(steady.get('value'))}: must be a number")
        if "displacement" not in columns:
            raise InputError(
                f"{key}: is a displacement, but calibrate.laboratory.columns has none; give a shear strain"
            )
        return columns["displacement"], size * float(steady["value"])
    if not finite(steady):
        raise InputError(
            f'{key} = {shown(steady)}: must be a shear strain, or {{value = ..., unit = "mm"}} of a displacement'
        )
    if "shear_strain" in columns:
        return columns["shear_strain"], float(steady)
    if "layer_thickness" not in columns:
        raise InputError(f"{key} = {steady:g}: is a shear strain, which needs layer_thickness beside displacement")
    # Sum of dD/h with the thickness of the moment, that between two rows by their mean.
    displacement, thickness = columns["displacement"], columns["layer_thickness"]
    steps = 2.0 * np.diff(displacement) / (thickness[1:] + thickness[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)]), float(steady)


def _even(along: NDArray, columns: Mapping[str, NDArray], path: Path) -> xarray.Dataset:
    """Rows as a dataset whose shear_strain is `along`, at even spacing: by lines between the rows if they are not."""
    import xarray

    steps = np.diff(along)
    if not len(steps):
        raise InputError(
            f"{path}: has {len(along)} rows of numbers, must have many, of a displacement or strain that grows"
        )
    if not (steps > 0.0).all():
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 2
        raise InputError(
            f"{path}, row {row} after the header: displacement or strain must grow from row to row; sort the rows, and "
            "remove those that repeat"
        )
    if np.abs(steps / steps.mean() - 1.0).max() > UNEVEN:
        even = np.linspace(along[0], along[-1], len(along))
        columns = {what: np.interp(even, along, values) for what, values in columns.items()}
        along = even
    time = ("time", np.arange(len(along), dtype=float))
    return xarray.Dataset(
        {what: ("time", values) for what, values in columns.items() if what != "shear_strain"},
        {"shear_strain": ("time", along), "time": time},
    )


def _friction(path: Path, rows: xarray.Dataset, start: float) -> lsm.statistics.Estimate:
    """Mean friction of the steady state: of its own column, or the ratio of the mean stresses."""
    try:
        if "friction" in rows:
            return lsm.statistics.steady_state(rows.friction, start)
        return lsm.statistics.steady_ratio(rows.shear_stress, rows.normal_stress, start)
    except InputError as error:
        raise InputError(f"{path}: {error}; or lower calibrate.laboratory.steady_from") from None
