"""Metrics of a layer that goes through stages: friction stage by stage, with the scatter of their repetitions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_estimate

if TYPE_CHECKING:
    import xarray

LEAST_PASSAGES = 3  # through a stage, whose scatter is taken for its error
ALONE = "a single passage: give the stage a repeat, or more seeds"


def stage_metrics(sheared: xarray.Dataset) -> dict[str, Metric]:
    """{metric: value} of every stage, by its name: mean friction over time and its standard error.

    The error is that of the means of its repetitions, of which three are needed: rows of a stage are neither evenly
    spaced nor of a steady state, and their own scatter says nothing.

    Parameters
    ----------
    sheared
        Rows of run.nc since shear began, with their `stage` and `stage_index`.
    """
    metrics, index = {}, sheared.stage_index.values
    time = np.concatenate([[np.nan], np.diff(sheared.time.values)])
    time[0] = time[1] if len(time) > 1 else 1.0
    for name in dict.fromkeys(sheared.stage.values.tolist()):
        own = sheared.stage.values == name
        passages = np.unique(index[own])  # places in the schedule
        means = np.array([_friction(sheared, time, index == place) for place in passages])
        key = f"friction_{name.replace('-', '_')}"
        if len(means) < LEAST_PASSAGES:
            reason = ALONE if len(means) == 1 else f"{len(means)} passages, at least {LEAST_PASSAGES} are needed"
            found = lsm.statistics.Estimate(float(means.mean()), np.nan, unknown=reason)
        else:
            found = lsm.statistics.combine_replicas(means)
        metrics |= metrics_of_estimate(f"{key}_mean", f"{key}_se", found)
    return metrics


def _friction(sheared: xarray.Dataset, time: NDArray, rows: NDArray) -> float:
    """Shear stress over normal stress, each a mean over the time that these rows stand for."""
    shear, normal = (np.sum(time[rows] * sheared[name].values[rows]) for name in ("shear_stress", "normal_stress"))
    return float(shear / normal) if normal > 0.0 else float("nan")
