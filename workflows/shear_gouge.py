"""Shear a layer of gouge between rough platens at constant normal stress, and measure its friction.

Stages: generate (a packing of grains that do not touch, between two platens of glued grains), consolidate (the servo
presses the top platen down to the normal stress), shear (the top platen moves at a constant velocity).
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import taichi_lsm as lsm
from workflows.common.metrics import Metric, write_summary
from workflows.common.parallel_runs import Progress
from workflows.common.parameter_coordinates import parameter_coordinates
from workflows.common.parameters import to_toml
from workflows.common.run_cost import RunCost, of_replicas
from workflows.common.run_folder import begin_run, check_folder
from workflows.common.stopwatch import Stopwatch
from workflows.gouge import layer_scene, target_error
from workflows.gouge.labels import grain_words
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.layer_metrics import BOUNDS, REMEDIES, analyse
from workflows.gouge.layer_scene import build, effects_of
from workflows.gouge.parameters import Params
from workflows.gouge.stages import consolidate, shear
from workflows.gouge.target_runs import run_to_target, runs_of
from workflows.plots import run_plots

if TYPE_CHECKING:
    import xarray

__all__ = ["BOUNDS", "REMEDIES", "Params", "analyse", "build", "check", "effects_of", "estimate", "run", "simulate"]


def check(params: Params) -> None:
    """Refuse parameters that are sure to fail, before any grain is made.

    Raises
    ------
    InputError
        With the option, its value, what is allowed and what to do.
    """
    layer_scene.check(params)
    if params.target_error is not None:
        target_error.plan(params, params.target_error)


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of the run, or of the runs that a target error needs."""
    if params.target_error is None:
        return layer_cost(params)
    plan = target_error.plan(params, params.target_error)
    return of_replicas([layer_cost(of_run) for of_run in runs_of(params, plan).values()], 2)


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, overwrite: bool = False
) -> xarray.Dataset:
    """Run the experiment; writes run.nc, grains.nc, run.png and summary.json to `out`, returns run.nc.

    With a target error it makes as many runs as that needs, in `out`/runs, and returns target.nc.

    Raises
    ------
    InputError
        Before anything is computed, if the parameters give no layer, or if the folder is not empty. With `overwrite`
        what former runs left in it is removed.
    SimulationError
        If the run has to be stopped; the files written so far are kept.
    """
    check(params)
    if params.target_error is not None:
        return run_to_target(params, out, progress, __name__, analyse, overwrite)
    check_folder(out, overwrite)
    watch = Stopwatch()
    return simulate(build(params, progress), params, out, progress, watch, overwrite)


def simulate(
    scene: lsm.Scene,
    params: Params,
    out: str | os.PathLike[str],
    progress: Progress | None = None,
    watch: Stopwatch | None = None,
    overwrite: bool = False,
) -> xarray.Dataset:
    """As `run`, for a scene that may have been changed after `build`; its times begin with `watch`, or here."""
    out = begin_run(params, out, overwrite)
    watch = watch or Stopwatch()
    if progress:
        progress({"stage": "compiling"})
    sim = lsm.Simulation(scene, params.arch, params.precision, params.threads)
    layer = lsm.ShearedLayer(sim, params.normal_stress, params.diameter)
    progress_from: list[tuple[float, int, float]] = []

    def report(row: dict[str, Any]) -> None:
        if progress:
            progress_from.append((time.perf_counter(), sim.step, row["shear_strain"]))
            progress(_progress(row, params, layer, progress_from[0], progress_from[-1]))

    try:
        rate = _record(sim, layer, out, params, report, progress)
    except lsm.SimulationError as error:
        run_plots.plot_stopped(out, error, params.format)
        raise
    if params.profile:
        print(lsm.runtime_profile_text(sim))
    dataset = lsm.open_run(out / "run.nc")
    metrics = analyse(dataset, params)
    metrics["grain_steps_per_second"] = Metric(rate, "s-1", note=None if rate == rate else "unknown: one row")
    run_plots.plot_run(out, params.format)
    metrics |= watch.metrics()
    write_summary(out, "shear-gouge", params.preset_name, metrics, quiet=progress is None)
    return dataset


def _record(
    sim: lsm.Simulation,
    layer: lsm.ShearedLayer,
    out: Path,
    params: Params,
    report: Progress,
    progress: Progress | None,
) -> float:
    """All stages of the run, with their files; returns grain steps per second of the shear."""
    scene = sim.scene
    title = f"Shear of a layer of {grain_words(scene)} in {scene.dim}D"
    pulled = isinstance(sim.platens.drives[1][0], lsm.SpringLoadPoint)
    drive = "by a load point on a spring" if pulled else "at constant velocity"
    summary = f"Generated {params.start}, consolidated under servo-controlled normal stress, sheared {drive}."
    scalars = [lsm.Scalar("run", out.resolve().name, "name of the run, that of its folder")]
    scalars += parameter_coordinates(params, without=("stiffness_number",))  # the recorder has that of the scene
    with lsm.LayerRecorder(out, layer, title, summary, to_toml(params), params.seed, scalars) as recorder:
        recorder.row(0)
        recorder.snapshot()
        consolidate(sim, layer, recorder, params, progress)
        recorder.snapshot()
        recorder.run.flush()
        return shear(sim, layer, recorder, params, report)


def _progress(
    row: dict[str, Any],
    params: Params,
    layer: lsm.ShearedLayer,
    first: tuple[float, int, float],
    last: tuple[float, int, float],
) -> dict[str, Any]:
    """Report for the progress line; speed and remaining time are known from the second row on."""
    report = {
        "stage": "shearing",
        "strain": row["shear_strain"],
        "strain_total": params.strain,
        "friction": row["friction"],
        "normal_stress": row["platen_normal_stress"],
        "energy_residual": layer.residual_fraction(),
    }
    spent, steps, strain = (b - a for a, b in zip(first, last))
    if strain > 0:
        report["steps_per_second_grain"] = steps * len(layer.sim) / spent
        report["eta"] = spent / strain * (params.strain - row["shear_strain"])
    return report
