"""Strain and number of seeds that a wanted error of the friction needs, from measured variances."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.run_cost import of_replicas
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.parameters import Params

TABLE = "friction_errors.json"
NORMAL = 1.96  # standard errors in the half-width of a 95 % interval
CAUTION = 1.25  # factor on the measured width, as the table rests on few runs
STRAINS = np.round(np.geomspace(0.3, 40.0, 40), 2)  # of steady shear, to choose from
MOST_SEEDS = 32


@dataclass(frozen=True)
class Plan:
    """Runs that are planned for a target error.

    Attributes
    ----------
    step_safety
        Time step over the largest stable one [1].
    strain, seeds
        Strain of each run [1], number of runs.
    expected_error
        Half-width of the 95 % interval of the mean friction [1].
    expected_seconds
        Wall-clock time, at most two runs at a time, one core each [s].
    """

    step_safety: float
    strain: float
    seeds: int
    expected_error: float
    expected_seconds: float


def table_of(shape: str, dim: int) -> dict[str, Any]:
    """The row of the measured table for this shape and dimension; InputError if there is none."""
    rows = json.loads(lsm.data_path(TABLE).read_text(encoding="utf-8"))["rows"]
    for row in rows:
        if row["shape"] == shape and row["dim"] == dim:
            return row
    known = ", ".join(f"--shape {row['shape']} --dim {row['dim']}" for row in rows)
    raise lsm.InputError(f"--target-error: errors were not measured for --shape {shape} --dim {dim}, only for {known}")


def area_of(params: Params) -> float:
    """Area (2D) or volume of the layer in mean diameters."""
    thickness, lengths = params.layer
    return float(thickness * np.prod(lengths) / params.diameter ** (1 + len(lengths)))


def half_width(row: dict[str, Any], params: Params, steady: float, seeds: int, step: str) -> float:
    """Half-width of the 95 % interval of the mean over `seeds` runs of the steady strain `steady`, for this layer.

    The variance falls with the area of the layer, as distant regions fluctuate independently. step: a key of the table.
    """
    variance = (row["between_seeds"] + row["times_strain"] / steady) * row["area"] / area_of(params)
    return float(CAUTION * NORMAL * np.sqrt(variance / seeds) + row["bias_of_step"][step])


def seconds(params: Params, strain: float, seeds: int, step: str) -> float:
    """Seconds of `seeds` runs to this strain, two at a time; step: a key of the table."""
    run = params.model_copy(update={"strain": strain, "step_safety": float(step)})
    return of_replicas([layer_cost(run)] * seeds, 2).seconds


def check(params: Params, target_error: float) -> None:
    """Refuse a target error [1] that no Plan reaches: the error falls with the strain and with the number of seeds.

    Raises
    ------
    InputError
        With the least error that can be asked for.
    """
    row = table_of(params.shape, params.dim)
    least = min(half_width(row, params, STRAINS[-1], MOST_SEEDS, step) for step in row["bias_of_step"])
    if least > target_error:
        raise lsm.InputError(
            f"--target-error {target_error:g}: must be >= {least:.2g}, the error of {MOST_SEEDS} runs to a strain of "
            f"{STRAINS[-1]:g}; a larger layer has smaller errors"
        )


def plan(params: Params, target_error: float) -> Plan:
    """The cheapest Plan whose 95 % half-width is at most `target_error` [1]; InputError as `check`."""
    check(params, target_error)
    row = table_of(params.shape, params.dim)
    plans = []
    long_enough = STRAINS[params.least_steady <= STRAINS]
    for step in row["bias_of_step"]:
        for seeds in range(1, MOST_SEEDS + 1):
            enough = (s for s in long_enough if half_width(row, params, s, seeds, step) <= target_error)
            steady = next(enough, None)
            if steady is not None:
                error = half_width(row, params, steady, seeds, step)
                strain = round(params.steady_from + float(steady), 2)
                plans.append(Plan(float(step), strain, seeds, error, seconds(params, strain, seeds, step)))
    return min(plans, key=lambda p: p.expected_seconds)


def expected(params: Params) -> tuple[float, float]:
    """(half-width of the 95 % interval, seconds) of one run with these parameters, by the table."""
    row = table_of(params.shape, params.dim)
    step = min(row["bias_of_step"], key=lambda s: abs(float(s) - params.step_safety))
    steady = params.strain - params.steady_from
    return half_width(row, params, steady, 1, step), layer_cost(params).seconds


def reached(row: dict[str, Any], params: Params, means: Sequence[float], errors: Sequence[float], step: str) -> float:
    """Half-width of the 95 % interval that runs with these means and standard errors have reached.

    The scatter of few seeds is poorly known: the variance between seeds of the table is added to that within runs, or
    to that of the table if no run knows its own error (nan). Where three or more runs scatter by more than this,
    Student's interval of their scatter counts, and where two differ by more than 95 % of such pairs. It is not a number
    if fewer than three runs know no error of their own: then nothing but the plan speaks for it.
    """
    count, share = len(means), row["area"] / area_of(params)
    known = np.square([error for error in errors if np.isfinite(error)])
    of_table = row["times_strain"] * share / (params.strain - params.steady_from)
    variance = (float(known.mean()) if known.size else of_table) + row["between_seeds"] * share
    reached = CAUTION * NORMAL * np.sqrt(variance / count)
    if not known.size and count < 3:
        return float("nan")
    allowed = variance if count > 2 else variance * NORMAL**2
    if count > 1 and np.var(means, ddof=1) > allowed:
        reached = max(reached, lsm.statistics.combine_replicas(means).half_width)
    return float(reached + row["bias_of_step"][step])
