"""Shear a layer of gouge between rough platens at constant normal stress, and measure its friction.

The layer is generated, consolidated under the normal stress, and sheared at a constant velocity, by a load point on a
spring, or through the stages that a TOML file gives.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import taichi_lsm as lsm
from workflows.common.metrics import Metric
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost, of_replicas
from workflows.common.run_folder import Existing
from workflows.common.stopwatch import Stopwatch
from workflows.gouge import layer_run, layer_scene, target_error
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.layer_metrics import BOUNDS, REMEDIES, analyse
from workflows.gouge.layer_run import LayerExperiment, run_layer
from workflows.gouge.layer_scene import build, effects_of
from workflows.gouge.parameters import Params
from workflows.gouge.target_runs import run_to_target, runs_of
from workflows.plots import run_plots

if TYPE_CHECKING:
    import xarray

__all__ = ["BOUNDS", "REMEDIES", "Params", "analyse", "build", "check", "effects_of", "estimate", "run", "simulate"]


def _conclude(dataset: xarray.Dataset, params: Params, out: Path) -> dict[str, Metric]:
    """Metrics and picture of a run whose rows are all written."""
    metrics = analyse(dataset, params)
    run_plots.plot_run(out, params.format)
    return metrics


SHEAR = LayerExperiment("shear-gouge", _conclude, frozenset({"strain", "stages"}), frozenset({"steady_from"}))
RESUMABLE = SHEAR.resumable  # parameters that may change in a run that goes on


def check(params: Params) -> None:
    """Refuse parameters that are sure to fail, before any grain is made.

    Raises
    ------
    InputError
        With the option, its value, what is allowed and what to do.
    """
    layer_scene.check(params)
    if params.target_error is not None:
        target_error.check(params, params.target_error)


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of the run, or of the runs that a target error needs."""
    if params.target_error is None:
        return layer_cost(params)
    plan = target_error.plan(params, params.target_error)
    return of_replicas([layer_cost(of_run) for of_run in runs_of(params, plan).values()], 2)


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Run the experiment; writes run.nc, grains.nc, run.png and summary.json to `out`, returns run.nc.

    With a target error it makes as many runs as that needs, in `out`/runs, and returns target.nc.

    Parameters
    ----------
    params, out, progress
        Of the run; its folder; takes reports.
    existing
        What becomes of a run that is there: it makes `run` refuse the folder, is removed, or goes on, to the same bits
        as if it had not been stopped. Of its parameters only RESUMABLE may differ then.

    Raises
    ------
    InputError
        Before anything is computed, if the parameters give no layer, or the folder or the run in it do not suit.
    SimulationError
        If the run has to be stopped; the files written so far are kept.
    """
    check(params)
    if params.target_error is not None:
        return run_to_target(params, out, progress, __name__, analyse, existing)
    return simulate(None, params, out, progress, existing=existing)


def simulate(
    scene: lsm.Scene | None,
    params: Params,
    out: str | os.PathLike[str],
    progress: Progress | None = None,
    watch: Stopwatch | None = None,
    existing: Existing = "refuse",
) -> xarray.Dataset:
    """As `run`, of a scene that may have been changed after `build` (None: as built); times begin with `watch`."""
    return run_layer(SHEAR, scene, params, out, progress, existing, watch)


def check_resume(params: Params, out: Path) -> None:
    """Refuse to go on with the run in a folder with parameters that it cannot take; see `layer_run.check_resume`."""
    layer_run.check_resume(SHEAR, params, out)


def can_go_on(params: Params, out: Path) -> bool:
    """Whether the run in a folder can go on with these parameters."""
    return layer_run.can_go_on(SHEAR, params, out)
