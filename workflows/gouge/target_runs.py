"""Runs of a sheared layer until the mean friction is known to a wanted error."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.common.metrics import Metric, number, read_summary, write_summary
from workflows.common.parallel_runs import run_replicas
from workflows.common.parameter_coordinates import columns_of, parameter_coordinates
from workflows.common.refusals import derived
from workflows.common.reports import Progress
from workflows.common.run_folder import Existing, run_folder
from workflows.common.run_table import TIME_STEP, write_runs
from workflows.common.stopwatch import Stopwatch
from workflows.gouge import target_error
from workflows.gouge.layer_metrics import BOUNDS, worst_claims
from workflows.gouge.parameters import Params
from workflows.gouge.target_error import Plan
from workflows.plots import run_plots

if TYPE_CHECKING:
    import xarray

COLUMNS = [
    lsm.Variable("seed", ("run",), "i32", "1", "seed of the packing"),
    lsm.Variable("friction_mean", ("run",), "f64", "1", "mean friction of steady shear, in the bulk of the layer"),
    lsm.Variable("friction_se", ("run",), "f64", "1", "standard error of friction_mean within the run, nan if unknown"),
]
TEXTS = {"path": "folder of the run, relative to this file"}
HALF_WIDTH = "half-width of the 95 % interval of friction_mean"
UNKNOWN = "unknown: the runs have too few independent samples to tell their errors"
NOT_TOLD = "the runs are too few and too short to tell their own error: lower --target-error, which makes more of them"
SCATTER = "the runs scatter more than was foreseen from other layers: lower --target-error, or raise --length"


def runs_of(params: Params, plan: Plan) -> dict[str, Params]:
    """{label: parameters} of the runs of a plan."""
    changes = {"target_error": None, "strain": plan.strain, "step_safety": plan.step_safety}
    seeds = range(params.seed, params.seed + plan.seeds)
    return {f"seed-{s}": derived(type(params), params, **changes, seed=s) for s in seeds}


def run_to_target(
    params: Params,
    out: str | os.PathLike[str],
    progress: Progress | None,
    workflow: str,
    analyse: Callable[[xarray.Dataset, Params], dict[str, Metric]],
    existing: Existing = "refuse",
) -> xarray.Dataset:
    """Plan and carry out the runs; writes target.nc, summary.json and runs/ to `out`, returns target.nc.

    workflow: name of the module that makes the runs; analyse(dataset, params) -> metrics of one of them; existing: as
    `run_folder` takes it.
    """
    with run_folder(params, "shear-gouge", out, existing) as folder:
        return _run_to_target(params, folder, progress, workflow, analyse, existing == "resume")


def _run_to_target(
    params: Params,
    out: Path,
    progress: Progress | None,
    workflow: str,
    analyse: Callable[[xarray.Dataset, Params], dict[str, Metric]],
    resume: bool,
) -> xarray.Dataset:
    """The runs in their folder."""
    row = target_error.table_of(params.shape, params.dim)
    target = params.target_error or 0.0
    plan = target_error.plan(params, target)
    if progress:
        print(
            f"target {target:g}: {plan.seeds} runs to strain {plan.strain:g}, {plan.step_safety:g} of the "
            f"stable step; expected error {plan.expected_error:.2g}, time {plan.expected_seconds:.0f} s",
            flush=True,
        )
    watch, runs = Stopwatch(), runs_of(params, plan)
    jobs = [(label, workflow, of_run, out / "runs" / label) for label, of_run in runs.items()]
    run_replicas(jobs, 2, progress, resume)
    table = collect(runs, params, out, analyse)
    means, errors = (table[name].values.tolist() for name in ("friction_mean", "friction_se"))
    as_run = params.model_copy(update={"strain": plan.strain})
    error = target_error.reached(row, as_run, means, errors, f"{plan.step_safety:g}")
    run_plots.plot_target(out, error, params.format)
    mean, known = float(np.mean(means)), bool(np.isfinite(error))
    metrics = {
        "friction_mean": Metric(mean, "1", interval=(mean - error, mean + error) if known else None),
        "friction_error": Metric(
            error,
            "1",
            target,
            error <= target,
            note=HALF_WIDTH if known else UNKNOWN,
            remedy=SCATTER if known else NOT_TOLD,
        ),
        "expected_error": Metric(plan.expected_error, "1"),
        "seeds": Metric(plan.seeds, "1"),
        "strain": Metric(plan.strain, "1"),
        "step_safety": Metric(plan.step_safety, "1"),
        "expected_seconds": Metric(plan.expected_seconds, "s", note="wall-clock time on idle cores"),
        **worst_claims({label: _claimed(out / "runs" / label) for label in runs}),
        **watch.metrics(resume),
    }
    write_summary(out, "shear-gouge", params.preset_name, metrics, quiet=progress is None)
    return table


def _claimed(folder: Path) -> dict[str, float]:
    """Values of what the run in a folder claims, from its summary; nan if they are not there."""
    entries = (read_summary(folder) or {"metrics": {}})["metrics"]
    values = {name: entries.get(name, {}).get("value") for name in BOUNDS}
    return {name: np.nan if value is None else float(value) for name, value in values.items()}


def collect(
    runs: dict[str, Params], params: Params, out: Path, analyse: Callable[[xarray.Dataset, Params], dict[str, Metric]]
) -> xarray.Dataset:
    """Write target.nc from the files of the runs, one row each with its parameters, and return it.

    The target error is that of the experiment: the runs themselves have none.
    """
    rows = []
    wanted = [scalar for scalar in parameter_coordinates(params) if scalar.name == "target_error"]
    shared = wanted
    for label, of_run in runs.items():
        dataset = lsm.open_run(out / "runs" / label / "run.nc")
        metrics = analyse(dataset, of_run)
        shared = parameter_coordinates(of_run, without=("seed", "target_error")) + wanted
        row = {"seed": of_run.seed, "path": f"runs/{label}", "time_step": dataset.dt} | {
            scalar.name: scalar.value for scalar in shared
        }
        rows.append(row | {name: number(metrics[name]) for name in ("friction_mean", "friction_se")})
    numbers, texts = columns_of(shared)
    return write_runs(
        out / "target.nc",
        rows,
        [*COLUMNS, TIME_STEP, *numbers],
        params,
        "Friction of a layer to a wanted error",
        f"Runs that were planned for an error of {params.target_error:g} of the mean friction.",
        parameters=("seed", *(scalar.name for scalar in shared)),
        text=TEXTS | texts,
    )
