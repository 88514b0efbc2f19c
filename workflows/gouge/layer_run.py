"""One run of grains through their stages, in its folder: what all experiments on a layer or a cell share.

Stages: generate, consolidate, then those of the shear, which each experiment gives; see `subject.Subject`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.metrics import Metric, read_summary, write_summary
from workflows.common.parameter_coordinates import parameter_coordinates
from workflows.common.parameters import option_name, to_toml
from workflows.common.reports import Progress
from workflows.common.run_folder import (
    Existing,
    begin_run,
    check_unchanged,
    former_parameters,
    run_folder,
    write_config,
)
from workflows.common.stopwatch import Stopwatch
from workflows.gouge.expected_shear import expected
from workflows.gouge.fragments import conclude_fragments
from workflows.gouge.grain_parameters import GrainParams
from workflows.gouge.layer_cost import start_seconds
from workflows.gouge.layer_parameters import LayerParams
from workflows.gouge.layer_schedule import CONSOLIDATE
from workflows.gouge.subject import LAYER, Subject
from workflows.plots import run_plots
from workflows.protocol.conditions import LOADED
from workflows.protocol.resume import Start, start_of
from workflows.protocol.run_loop import RunLoop
from workflows.protocol.schedule import Stage
from workflows.protocol.stage_tables import continues, planned

if TYPE_CHECKING:
    import xarray

Conclude = Callable[["xarray.Dataset", Any, Path], dict[str, Metric]]


@dataclass(frozen=True)
class LayerExperiment:
    """What tells an experiment on a layer from the others.

    Attributes
    ----------
    name
        Of the command.
    conclude
        Takes run.nc, the parameters and the folder once all rows are written: draws, writes what the experiment has
        beside run.nc and grains.nc, and returns the metrics.
    longer
        Parameters that may grow in a run that goes on, which makes it longer.
    analysed
        Parameters that may change in it, as rows and snapshots do not depend on them.
    subject
        What is sheared.
    """

    name: str
    conclude: Conclude
    longer: frozenset[str] = frozenset()
    analysed: frozenset[str] = frozenset()
    subject: Subject = LAYER

    @property
    def resumable(self) -> frozenset[str]:
        """Parameters that may change in a run that goes on."""
        return self.longer | self.analysed


def run_layer(
    experiment: LayerExperiment,
    scene: lsm.Scene | None,
    params: GrainParams,
    out: str | os.PathLike[str],
    progress: Progress | None = None,
    existing: Existing = "refuse",
    watch: Stopwatch | None = None,
) -> xarray.Dataset:
    """Take a layer through its stages; writes run.nc, grains.nc and summary.json to `out`, returns run.nc.

    Parameters
    ----------
    experiment, params
        Which experiment, with which parameters; they are checked already.
    scene
        The layer, which may have been changed after `build`; None: as built.
    out, progress
        Folder of the run; takes reports.
    existing
        What becomes of a run that is there: it makes this refuse the folder, is removed, or goes on, to the same bits
        as if it had not been stopped.
    watch
        With which the times of the run begin.

    Raises
    ------
    InputError
        Before anything is computed, if the folder or the run in it do not suit.
    SimulationError
        If the run has to be stopped; the files written so far are kept.
    """
    resume, watch = existing == "resume", watch or Stopwatch()
    if resume:
        check_resume(experiment, params, Path(out))
    with run_folder(params, experiment.name, out, existing, experiment.resumable, begin=not resume) as folder:
        if resume and _is_finished(folder):
            return _analyse_again(experiment, params, folder, progress, watch)
        layer = scene or experiment.subject.build(params, progress)
        return _simulate(experiment, layer, params, folder, progress, watch, resume)


def check_resume(experiment: LayerExperiment, params: GrainParams, out: Path) -> None:
    """Refuse to go on with the run in a folder with parameters that it cannot take.

    Raises
    ------
    InputError
        For other parameters than may change; stages that do not begin with those of the run; a longer run, if this one
        is complete and has kept no checkpoint.
    """
    check_unchanged(params, out, experiment.resumable)
    former = former_parameters(params, out)
    for name in sorted(experiment.longer):
        value, reached = getattr(params, name), getattr(former, name)
        if isinstance(value, int | float) and value < reached:
            raise lsm.InputError(f"{option_name(name)} {value:g}: must be >= {reached:g}, that of the run in {out}")
    before, now = planned(former.shear_tables()), planned(params.shear_tables())
    if params.pushed and not former.pushed:
        raise lsm.InputError(
            f"stages: shear_stress cannot come into the run in {out}, whose platen was made to follow velocities "
            "alone; begin a new run with all of its stages"
        )
    if not continues(now, before):
        raise lsm.InputError(
            f"stages: must begin with those of the run in {out}, the last of which may become longer (config.toml)"
        )
    if now != before and _is_finished(out):
        changed = ", ".join(option_name(name) for name in sorted(experiment.longer)) or "stages"
        raise lsm.InputError(
            f"{changed}: the run in {out} is complete and has kept no checkpoint from which to go on; begin a new one, "
            "with --keep-checkpoint if it may have to be made longer"
        )


def can_go_on(experiment: LayerExperiment, params: GrainParams, out: Path) -> bool:
    """Whether the run in a folder can go on with these parameters."""
    try:
        check_resume(experiment, params, out)
    except lsm.InputError:
        return False
    return True


def _is_finished(out: Path) -> bool:
    """Whether the run in a folder has written all its rows and kept no checkpoint."""
    path = out / "run.nc"
    return path.is_file() and not lsm.checkpoints.has_checkpoint(out) and lsm.open_run(path).run_status == "complete"


def _simulate(
    experiment: LayerExperiment,
    scene: lsm.Scene,
    params: GrainParams,
    out: Path,
    progress: Progress | None,
    watch: Stopwatch,
    resume: bool,
) -> xarray.Dataset:
    """The run in its folder."""
    if progress:
        progress({"stage": f"compiling, up to {start_seconds(params):.0f} s the first time"})
    scene.track_contacts = len(params.contacts) > 0
    sim = lsm.Simulation(scene, params.arch, params.precision, params.threads)
    layer = experiment.subject.measured(sim, params)
    sim.keep_checkpoints(out, seconds=np.inf)  # by the run loop, which knows when
    schedule = experiment.subject.schedule(params, sim.dt, layer.thickness)
    start = Start()
    if resume and lsm.checkpoints.has_checkpoint(out):
        start, damage = start_of(layer, schedule, out, watch, identity_of(experiment, params))
        sim.keep_checkpoints(out, seconds=np.inf, last=out / lsm.checkpoints.LAST)
        if progress:
            before = f" before the last one, as {damage}" if damage else ""
            progress({"state": f"resuming from the checkpoint{before}, at step {sim.step}"})
    elif resume and progress:
        progress({"state": "no checkpoint is there: beginning anew"})
    try:
        loop = _record(experiment, layer, schedule, out, params, progress, watch, start, resume)
    except lsm.SimulationError as error:
        try:
            run_plots.plot_stopped(out, error, params.format)
        except (OSError, lsm.InputError) as failure:  # as of a full disk, which may be what ended the run
            error.add_note(f"no picture of it could be drawn: {failure}")
        raise
    if params.profile:
        print(lsm.runtime_profile_text(sim))
    dataset = _conclude(experiment, params, out, progress, watch, loop.grain_steps_per_second)
    if not params.keep_checkpoint:  # last: with them times and speed of the run would be lost
        lsm.checkpoints.remove_checkpoints(out)
    return dataset


def _analyse_again(
    experiment: LayerExperiment, params: GrainParams, out: Path, progress: Progress | None, watch: Stopwatch
) -> xarray.Dataset:
    """Analysis, picture and summary of a run that was complete; what it took is kept."""
    former, rate = (read_summary(out) or {}).get("metrics", {}), None
    write_config(params, experiment.name, out)  # the summary stays until the new one takes its place
    if {"seconds", "cpu_seconds", "grain_steps_per_second"} <= former.keys():
        watch.add(former["seconds"]["value"], former["cpu_seconds"]["value"])
        rate = former["grain_steps_per_second"]["value"]
    return _conclude(experiment, params, out, progress, watch, np.nan if rate is None else rate)


def _conclude(
    experiment: LayerExperiment,
    params: GrainParams,
    out: Path,
    progress: Progress | None,
    watch: Stopwatch,
    rate: float,
) -> xarray.Dataset:
    """Analysis, picture and summary of a run whose files are complete; rate: grain steps per second [s-1]."""
    dataset = lsm.open_run(out / "run.nc")
    if progress:
        progress({"stage": "analysing and drawing"})
    metrics = experiment.conclude(dataset, params, out)
    if isinstance(params, LayerParams) and params.breakable:
        metrics |= conclude_fragments(dataset, params, out)
    metrics["grain_steps_per_second"] = Metric(rate, "s-1", note=None if rate == rate else "unknown: too few rows")
    metrics |= watch.metrics()
    write_summary(out, experiment.name, params.preset_name, metrics, quiet=progress is None)
    return dataset


def identity_of(experiment: LayerExperiment, params: GrainParams) -> dict[str, Any]:
    """{name: value} of the parameters that a run that goes on must share with the one that was stopped."""
    kept = set(type(params).model_fields) - params.without_result - experiment.resumable - params.idle().keys()
    return {name: value for name, value in params.model_dump(mode="json").items() if name in kept}


def _record(
    experiment: LayerExperiment,
    layer: Any,
    schedule: list[Stage],
    out: Path,
    params: GrainParams,
    progress: Progress | None,
    watch: Stopwatch,
    start: Start,
    resume: bool,
) -> RunLoop:
    """All stages of the run, with their files; returns the loop, which is at its end."""
    sim, subject = layer.sim, experiment.subject
    title, summary = subject.title(sim.scene), subject.summary(params, sim)
    scalars = [lsm.Scalar("run", out.resolve().name, "name of the run, that of its folder")]
    scalars += parameter_coordinates(params, without=("stiffness_number",))  # the recorder has that of the scene
    first: list[tuple[float, int, float]] = []
    strain, shear_time = expected(params)
    whole = shear_time * params.inertial_time

    def report(stage: Stage, row: dict[str, Any]) -> None:
        if not progress:
            return
        if stage.name == CONSOLIDATE:
            loaded = abs(row[subject.normal_stress] / params.normal_stress - 1.0) < LOADED
            height = {"height": layer.thickness, "height_goal": params.layer[0]}
            stress = {"normal_stress": row[subject.normal_stress]}
            progress({"stage": "settling" if loaded else "consolidating", **height, **stress})
            return
        elapsed = row["time"] - (loop.position.shear_since or 0.0)
        now = time.perf_counter(), sim.step, elapsed / whole
        first.append(now)
        shown = stage.name if params.staged else "shearing"
        report = {"stage": shown + f" {stage.cycle}" * (stage.cycle > 0), "strain": row["shear_strain"]}
        report |= {"share": min(1.0, now[2])} if params.staged else {"strain_total": strain}
        report |= {"normal_stress": row[subject.normal_stress]}
        progress(report | _progress(row, layer, first[0], now))

    with lsm.LayerRecorder(
        out, layer, title, summary, to_toml(params, experiment.name), params.seed, scalars, start.keep, params.staged
    ) as recorder:
        if resume:  # now that the files and the checkpoint are known to belong together
            begin_run(params, experiment.name, out)
        loop = RunLoop(
            layer,
            recorder,
            schedule,
            subject.drives(params, sim),
            report,
            watch,
            start,
            identity_of(experiment, params),
            checkpoint_seconds=params.checkpoint_seconds,
        )
        loop.run()
    return loop


def _progress(
    row: dict[str, Any], layer: Any, first: tuple[float, int, float], last: tuple[float, int, float]
) -> dict[str, Any]:
    """What is measured, for the progress line; speed and remaining time are known from the second row on.

    first, last: clock [s], step and share of the shear [1] of the first row and of this one.
    """
    report = {
        "friction": row["friction"],
        "energy_residual": layer.residual_fraction(),
    }
    spent, steps, share = (b - a for a, b in zip(first, last))
    if share > 0:
        report["steps_per_second_grain"] = steps * len(layer.sim) / spent
        report["eta"] = spent / share * max(0.0, 1.0 - last[2])
    return report
