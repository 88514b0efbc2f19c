"""Shear a layer of gouge between rough platens at constant normal stress, and measure its friction.

Stages: generate (a packing of grains that do not touch, between two platens of glued grains), consolidate (the servo
presses the top platen down to the normal stress), shear (the top platen moves at a constant velocity).
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.metrics import Metric, read_summary, write_summary
from workflows.common.parameter_coordinates import parameter_coordinates
from workflows.common.parameters import to_toml
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost, of_replicas
from workflows.common.run_folder import (
    Existing,
    begin_run,
    check_unchanged,
    former_parameters,
    run_folder,
    write_config,
)
from workflows.common.stopwatch import Stopwatch
from workflows.gouge import layer_scene, target_error
from workflows.gouge.labels import grain_words
from workflows.gouge.layer_cost import layer_cost, start_seconds
from workflows.gouge.layer_drives import LayerDrives
from workflows.gouge.layer_metrics import BOUNDS, REMEDIES, analyse
from workflows.gouge.layer_scene import build, effects_of
from workflows.gouge.layer_schedule import CONSOLIDATE, layer_schedule
from workflows.gouge.parameters import Params
from workflows.gouge.shear_stages import expected
from workflows.gouge.target_runs import run_to_target, runs_of
from workflows.plots import run_plots
from workflows.protocol.conditions import LOADED
from workflows.protocol.resume import Start, start_of
from workflows.protocol.run_loop import RunLoop
from workflows.protocol.schedule import Stage

if TYPE_CHECKING:
    import xarray

__all__ = ["BOUNDS", "REMEDIES", "Params", "analyse", "build", "check", "effects_of", "estimate", "run", "simulate"]

NAME = "shear-gouge"
RESUMABLE = frozenset({"strain", "steady_from"})  # parameters that may change in a run that goes on


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
    resume, watch = existing == "resume", watch or Stopwatch()
    if resume:
        check_resume(params, Path(out))
    with run_folder(params, NAME, out, existing, RESUMABLE, begin=not resume) as folder:
        if resume and _is_finished(folder):
            return _analyse_again(params, folder, progress, watch)
        return _simulate(scene or build(params, progress), params, folder, progress, watch, resume)


def check_resume(params: Params, out: Path) -> None:
    """Refuse to go on with the run in a folder with parameters that it cannot take.

    Raises
    ------
    InputError
        For other parameters than RESUMABLE that differ; a strain below that of the run; a strain above it if the run is
        complete and has kept no checkpoint.
    """
    check_unchanged(params, out, RESUMABLE)
    reached = former_parameters(params, out).strain
    if params.strain < reached:
        raise lsm.InputError(f"--strain {params.strain:g}: must be >= {reached:g}, that of the run in {out}")
    if params.strain > reached and _is_finished(out):
        raise lsm.InputError(
            f"--strain {params.strain:g}: the run in {out} is complete at {reached:g} and has kept no checkpoint from "
            "which to go on; begin a new one, with --keep-checkpoint if it may have to be made longer"
        )


def can_go_on(params: Params, out: Path) -> bool:
    """Whether the run in a folder can go on with these parameters."""
    try:
        check_resume(params, out)
    except lsm.InputError:
        return False
    return True


def _is_finished(out: Path) -> bool:
    """Whether the run in a folder has written all its rows and kept no checkpoint."""
    path = out / "run.nc"
    return path.is_file() and not lsm.checkpoints.has_checkpoint(out) and lsm.open_run(path).run_status == "complete"


def _simulate(
    scene: lsm.Scene, params: Params, out: Path, progress: Progress | None, watch: Stopwatch, resume: bool
) -> xarray.Dataset:
    """The run in its folder."""
    if progress:
        progress({"stage": f"compiling, up to {start_seconds(params):.0f} s the first time"})
    sim = lsm.Simulation(scene, params.arch, params.precision, params.threads)
    layer = lsm.ShearedLayer(sim, params.normal_stress, params.diameter)
    sim.keep_checkpoints(out, seconds=np.inf)  # by the run loop, which knows when
    schedule = layer_schedule(params, sim.dt, layer.thickness)
    start = Start()
    if resume and lsm.checkpoints.has_checkpoint(out):
        start, damage = start_of(layer, schedule, out, watch, identity_of(params))
        sim.keep_checkpoints(out, seconds=np.inf, last=out / lsm.checkpoints.LAST)
        if progress:
            before = f" before the last one, as {damage}" if damage else ""
            progress({"state": f"resuming from the checkpoint{before}, at step {sim.step}"})
    elif resume and progress:
        progress({"state": "no checkpoint is there: beginning anew"})
    try:
        loop = _record(layer, schedule, out, params, progress, watch, start, resume)
    except lsm.SimulationError as error:
        try:
            run_plots.plot_stopped(out, error, params.format)
        except (OSError, lsm.InputError) as failure:  # as of a full disk, which may be what ended the run
            error.add_note(f"no picture of it could be drawn: {failure}")
        raise
    if params.profile:
        print(lsm.runtime_profile_text(sim))
    dataset = _conclude(params, out, progress, watch, loop.grain_steps_per_second)
    if not params.keep_checkpoint:  # last: with them times and speed of the run would be lost
        lsm.checkpoints.remove_checkpoints(out)
    return dataset


def _analyse_again(params: Params, out: Path, progress: Progress | None, watch: Stopwatch) -> xarray.Dataset:
    """Analysis, picture and summary of a run that was complete; what it took is kept."""
    former, rate = (read_summary(out) or {}).get("metrics", {}), None
    write_config(params, NAME, out)  # the summary stays until the new one takes its place
    if {"seconds", "cpu_seconds", "grain_steps_per_second"} <= former.keys():
        watch.add(former["seconds"]["value"], former["cpu_seconds"]["value"])
        rate = former["grain_steps_per_second"]["value"]
    return _conclude(params, out, progress, watch, np.nan if rate is None else rate)


def _conclude(params: Params, out: Path, progress: Progress | None, watch: Stopwatch, rate: float) -> xarray.Dataset:
    """Analysis, picture and summary of a run whose files are complete; rate: grain steps per second [s-1]."""
    dataset = lsm.open_run(out / "run.nc")
    metrics = analyse(dataset, params)
    metrics["grain_steps_per_second"] = Metric(rate, "s-1", note=None if rate == rate else "unknown: too few rows")
    if progress:
        progress({"stage": "drawing the picture"})
    run_plots.plot_run(out, params.format)
    metrics |= watch.metrics()
    write_summary(out, NAME, params.preset_name, metrics, quiet=progress is None)
    return dataset


def identity_of(params: Params) -> dict[str, Any]:
    """{name: value} of the parameters that a run that goes on must share with the one that was stopped."""
    kept = set(type(params).model_fields) - params.without_result - RESUMABLE - params.idle().keys()
    return {name: value for name, value in params.model_dump(mode="json").items() if name in kept}


def _record(
    layer: lsm.ShearedLayer,
    schedule: list[Stage],
    out: Path,
    params: Params,
    progress: Progress | None,
    watch: Stopwatch,
    start: Start,
    resume: bool,
) -> RunLoop:
    """All stages of the run, with their files; returns the loop, which is at its end."""
    sim = layer.sim
    scene = sim.scene
    title = f"Shear of a layer of {grain_words(scene)} in {scene.dim}D"
    pulled = isinstance(sim.platens.drives[1][0], lsm.SpringLoadPoint)
    drive = "by a load point on a spring" if pulled else "in stages" if params.stages else "at constant velocity"
    summary = f"Generated {params.start}, consolidated under servo-controlled normal stress, sheared {drive}."
    scalars = [lsm.Scalar("run", out.resolve().name, "name of the run, that of its folder")]
    scalars += parameter_coordinates(params, without=("stiffness_number",))  # the recorder has that of the scene
    first: list[tuple[float, int, float]] = []
    goal = expected(params)[0]

    def report(stage: Stage, row: dict[str, Any]) -> None:
        if not progress:
            return
        if stage.name == CONSOLIDATE:
            loaded = abs(row["platen_normal_stress"] / params.normal_stress - 1.0) < LOADED
            height = {"height": layer.thickness, "height_goal": params.layer[0]}
            stress = {"normal_stress": row["platen_normal_stress"]}
            progress({"stage": "settling" if loaded else "consolidating", **height, **stress})
            return
        now = time.perf_counter(), sim.step, row["shear_strain"]
        first.append(now)
        shown = stage.name if params.stages else "shearing"
        progress(_progress(row, shown + f" {stage.cycle}" * (stage.cycle > 0), goal, layer, first[0], now))

    with lsm.LayerRecorder(
        out, layer, title, summary, to_toml(params, NAME), params.seed, scalars, start.keep, bool(params.stages)
    ) as recorder:
        if resume:  # now that the files and the checkpoint are known to belong together
            begin_run(params, NAME, out)
        loop = RunLoop(
            layer,
            recorder,
            schedule,
            LayerDrives(params, sim),
            report,
            watch,
            start,
            identity_of(params),
            checkpoint_seconds=params.checkpoint_seconds,
        )
        loop.run()
    return loop


def _progress(
    row: dict[str, Any],
    stage: str,
    goal: float,
    layer: lsm.ShearedLayer,
    first: tuple[float, int, float],
    last: tuple[float, int, float],
) -> dict[str, Any]:
    """Report for the progress line, to a strain [1]; speed and remaining time are known from the second row on."""
    report = {
        "stage": stage,
        "strain": row["shear_strain"],
        "strain_total": goal,
        "friction": row["friction"],
        "normal_stress": row["platen_normal_stress"],
        "energy_residual": layer.residual_fraction(),
    }
    spent, steps, strain = (b - a for a, b in zip(first, last))
    if strain > 0:
        report["steps_per_second_grain"] = steps * len(layer.sim) / spent
        report["eta"] = spent / strain * (goal - row["shear_strain"])
    return report
