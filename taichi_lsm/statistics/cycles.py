"""Repetitions of a stage of a run side by side, on common slips: what a stack of velocity steps is made of."""

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .run_parts import part_of

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

Array = npt.NDArray[np.float64]
ALONG = "slip_since_step"
LEAST_ROWS = 3  # of a passage through the stage
ROUNDING = 1e-9  # of slips, over their range


def stack_cycles(
    run: "Run",
    stage: str,
    before: float = 0.0,
    slips: npt.ArrayLike | None = None,
    of: Literal["platen", "load_point"] = "platen",
) -> "Dataset":
    """All passages through a stage of run.nc, one row each, on common slips since the stage began.

    `ds.friction.mean("cycle").plot()` of the result is the mean response to the step with which the stage begins.

    Parameters
    ----------
    run
        What `open_run` gives of the folder, or of the run.nc, of a run through stages.
    stage
        Name of the stage.
    before
        Slip [m] >= 0 before the stage from which rows are taken too, at negative slips: those of the stage before it.
    slips
        (n,) slips [m] on which the passages are put, rising; by default those of the rows of the last passage, as far
        as all passages have them.
    of
        Whose slip: that of the top platen, or of the load point whose spring pulls it.

    Returns
    -------
    Dataset
        Along `cycle` (number of the repetition, from 1 on, or of the passage where the stage is not repeated) and
        `slip_since_step` [m]: every time series of the run, `platen_friction`, and `time_since_step` [s].

    Raises
    ------
    InputError
        If the run has no such stage, or no slip within it.

    Notes
    -----
    A row is the mean since the row before, so it stands in the middle of the slip between the two. Slip counts in
    either direction. Between rows values are interpolated along a line, but not across the step.
    """
    import xarray

    run = part_of(run, "run")
    places = _places(run, stage)
    moved = np.asarray(run.displacement, float)
    if of == "load_point":
        if "spring_stretch" not in run:
            raise InputError("of: 'load_point', but the run has no spring_stretch; must be 'platen' without a spring")
        moved = moved + np.asarray(run.spring_stretch, float)
    slip = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(moved)))])
    middle = slip - 0.5 * np.diff(slip, prepend=slip[0])
    passages = [_rows(run, place, slip, middle, before) for place in places]
    grid = _grid(stage, [x for _, x, _ in passages], slips)
    cycles = np.asarray(run.cycle)[[begin + 1 for _, _, begin in passages]]
    number = cycles if np.all(cycles > 0) else np.arange(1, len(passages) + 1)
    return xarray.Dataset(
        _on_grid(run, passages, grid),
        {
            "cycle": ("cycle", number, {"long_name": f"repetition of the stage {stage}"}),
            ALONG: (ALONG, grid, {"units": "m", "long_name": "slip since the step"}),
        },
        {"title": f"Stage {stage}, one row for each time that it was gone through", "stage": stage},
    )


def _on_grid(run: "Dataset", passages: list[tuple[npt.NDArray[np.int64], Array, int]], grid: Array) -> dict[str, Any]:
    """{name: (dimensions, values (cycle, slip), attributes)} of all series, on common slips (n,) [m]."""
    time, series = np.asarray(run.time, float), _series(run)
    halfway = time - 0.5 * np.diff(time, prepend=time[0])
    data = {
        name: (("cycle", ALONG), np.stack([np.interp(grid, x, y[rows]) for rows, x, _ in passages]), attrs)
        for name, (y, attrs) in series.items()
    }
    since = [np.interp(grid, x, halfway[rows] - time[begin]) for rows, x, begin in passages]
    data["time_since_step"] = (("cycle", ALONG), np.stack(since), {"units": "s", "long_name": "time since the step"})
    return data


def _places(run: "Dataset", stage: str) -> npt.NDArray:
    """Places in the schedule of a stage; InputError if the run has none of this name."""
    missing = [name for name in ("stage", "stage_index", "cycle", "displacement") if name not in run.variables]
    if missing:
        raise InputError(f"run: has no {', '.join(missing)}, must be the run.nc of a layer that went through stages")
    names = np.asarray(run.stage)
    places = np.unique(np.asarray(run.stage_index)[names == stage])
    if not places.size:
        raise InputError(f"stage: {stage!r}, must be one of {', '.join(dict.fromkeys(names.tolist()))}")
    return places


def _rows(
    run: "Dataset", place: int, slip: Array, middle: Array, before: float
) -> tuple[npt.NDArray[np.int64], Array, int]:
    """(rows, their slips since the stage began [m], last row before it) of the stage at a place of the schedule."""
    own = np.flatnonzero(np.asarray(run.stage_index) == place)
    begin = int(own[0]) - 1
    if begin < 0 or own.size < LEAST_ROWS:
        raise InputError(f"run: {own.size} rows of stage {place} of the schedule, at least {LEAST_ROWS} are needed")
    earlier = np.flatnonzero(np.asarray(run.stage_index) == place - 1) if before > 0.0 else own[:0]
    rows = np.concatenate([earlier[middle[earlier] - slip[begin] >= -before], own])
    x = middle[rows] - slip[begin]
    return rows, x, begin


def _grid(stage: str, passages: list[Array], slips: npt.ArrayLike | None) -> Array:
    """Slips that all passages have [m]."""
    first, last = max(x[0] for x in passages), min(x[-1] for x in passages)
    grid = passages[-1] if slips is None else np.asarray(slips, float)
    # Nothing is interpolated between the last row before the step and the first one after it.
    low = min((float(x[x < 0.0].max()) for x in passages if (x < 0.0).any()), default=-np.inf)
    high = max(float(x[x >= 0.0].min()) for x in passages)
    if grid.ndim != 1 or not np.all(np.diff(grid) > 0.0):
        where = f"those of stage {stage}" if slips is None else f"{grid.size} values"
        raise InputError(f"slips: {where} do not rise from row to row; must be slips [m] of a layer that slides")
    margin = ROUNDING * (last - first)  # the passages differ by it
    apart = (grid <= low + margin) | (grid >= high - margin)
    return grid[apart & (grid >= first - margin) & (grid <= last + margin)]


def _series(run: "Dataset") -> dict[str, tuple[Array, dict]]:
    """(values (time,), attributes) of every time series of numbers, and the friction at the platen."""
    found = {
        str(name): (np.asarray(v, float), dict(v.attrs))
        for name, v in run.data_vars.items()
        if v.dims == ("time",) and v.dtype.kind == "f"
    }
    if {"platen_shear_stress", "platen_normal_stress"} <= found.keys():
        shear, normal = (found[f"platen_{name}_stress"][0] for name in ("shear", "normal"))
        ratio = np.divide(shear, normal, out=np.full_like(shear, np.nan), where=normal != 0.0)
        found["platen_friction"] = (ratio, {"units": "1", "long_name": "shear over normal stress on the top platen"})
    return found
