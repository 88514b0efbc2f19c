"""What parameters are to give: values of metrics with their errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from taichi_lsm.core.errors import InputError, finite, shown
from workflows.common.parameter_problems import as_written, nearest

KEYS = ("value", "error", "runs")
GREATEST, LEAST_ERROR = 1e30, 1e-30  # beyond which the squares of misfits overflow
MOST_TARGETS = 20
METRIC = "a metric of summary.json, such as friction_mean"


@dataclass(frozen=True)
class Target:
    """The value that a metric is to have.

    Attributes
    ----------
    metric
        Its name in summary.json.
    value
        In the unit that it has there.
    error
        Standard error of the value: the expected deviation from what infinitely many repetitions would give on average.
        None for that of single runs, where `runs` is given.
    runs
        Number of simulated runs of which the value is the mean: the scatter between them is added to the error. None
        for a value whose error holds all that differs between repetitions, as of a laboratory.
    model_error
        Standard deviation by which the model may differ from what was measured, at its best parameters.
    freedom
        Degrees of freedom from which the error itself is known, by Student's t; infinite if it is certain.
    """

    metric: str
    value: float
    error: float | None
    runs: int | None = None
    model_error: float = 0.0
    freedom: float = math.inf


def targets_of(table: Any) -> tuple[Target, ...]:
    """Read the table `[calibrate.targets]`: {metric: {value, error, runs}}.

    Raises
    ------
    InputError
        With the key, its value, what is allowed and what to do.
    """
    if not isinstance(table, Mapping) or not table:
        raise InputError(
            f"calibrate.targets = {shown(table)}: must be a table of {{value = ..., error = ...}} by {METRIC}"
        )
    if len(table) > MOST_TARGETS:
        raise InputError(f"calibrate.targets: {len(table)} metrics, must be at most {MOST_TARGETS}")
    return tuple(_target(str(metric), given) for metric, given in table.items())


def _target(metric: str, given: Any) -> Target:
    key = f"calibrate.targets.{as_written(metric)}"
    if not isinstance(given, Mapping):
        raise InputError(f"{key} = {shown(given)}: must be {{value = ..., error = ...}}")
    if unknown := sorted(set(given) - set(KEYS)):
        hint = nearest(unknown[0], KEYS)
        raise InputError(f"{key}.{as_written(unknown[0])}: unknown, must be one of {', '.join(KEYS)}.{hint}")
    value, error, runs = given.get("value"), given.get("error"), given.get("runs")
    if value is None or not finite(value) or abs(value) > GREATEST:
        raise InputError(
            f"{key}.value = {shown(value)}: must be a number up to {GREATEST:g}, in the unit of summary.json"
        )
    if runs is not None and (isinstance(runs, bool) or not isinstance(runs, int) or not 1 <= runs <= 10**6):
        raise InputError(f"{key}.runs = {shown(runs)}: must be a whole number of simulated runs from 1 on")
    if error is None and runs is None:
        raise InputError(f"{key}.error: must be given, the standard error of the value; or runs, for simulated ones")
    if error is not None and not (finite(error) and (error >= LEAST_ERROR or (error == 0.0 and runs is not None))):
        raise InputError(
            f"{key}.error = {shown(error)}: must be > 0 ({LEAST_ERROR:g}), the standard error of the value"
        )
    return Target(metric, float(value), None if error is None else float(error), runs)


def with_model_errors(targets: tuple[Target, ...], table: Any) -> tuple[Target, ...]:
    """Targets with the discrepancies of `[calibrate.model_error]`, {metric: deviation}; InputError if wrong."""
    if not isinstance(table, Mapping):
        raise InputError(f"calibrate.model_error = {shown(table)}: must be a table of a number by metric")
    names = [target.metric for target in targets]
    for metric, size in table.items():
        key = f"calibrate.model_error.{as_written(metric)}"
        if metric not in names:
            raise InputError(f"{key}: is no target, must be one of {', '.join(names)}.{nearest(metric, names)}")
        if not (finite(size) and size >= 0.0):
            raise InputError(f"{key} = {shown(size)}: must be a number >= 0, in the unit of the metric")
    return tuple(replace(t, model_error=float(table.get(t.metric, t.model_error))) for t in targets)
