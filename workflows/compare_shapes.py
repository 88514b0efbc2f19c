"""Shear gouge of round and of angular grains under the same conditions, and compare their friction.

Every shape is sheared `replicas` times, with the seeds seed, seed + 1, ...; standard errors and 95 % intervals of the
two means and of their difference follow from the scatter of the replicas and from the errors within them.

compare.nc, its picture and summary.json are of the runs as this experiment left them. One that is made longer by
itself (lsm resume DIR/runs/angular-1 --strain 10) leaves them as they were; lsm resume DIR --strain 10, of runs
begun with --keep-checkpoint, makes all longer and the table anew.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.common import signals
from workflows.common.metrics import Metric, metrics_of_estimate, number, shown, write_summary
from workflows.common.parallel_runs import run_replicas
from workflows.common.parameter_coordinates import columns_of, parameter_coordinates
from workflows.common.refusals import check_idle, derived
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost, of_replicas
from workflows.common.run_folder import Existing, is_begun, run_folder
from workflows.common.run_table import TIME_STEP, write_runs
from workflows.common.stopwatch import Stopwatch
from workflows.gouge.layer_metrics import worst_claims
from workflows.plots import run_plots

if TYPE_CHECKING:
    import xarray

SHAPES = ("round", "angular")

# Columns of compare.nc that are metrics of a run, by the names that `shear_gouge.analyse` gives them.
COLUMNS = [
    lsm.Variable("friction_mean", ("run",), "f64", "1", "mean friction of steady shear, in the bulk of the layer"),
    lsm.Variable("friction_se", ("run",), "f64", "1", "standard error of friction_mean within the run, nan if unknown"),
    lsm.Variable("friction_ess", ("run",), "f64", "1", "number of independent samples in friction_mean"),
    lsm.Variable("platen_friction_mean", ("run",), "f64", "1", "mean friction of steady shear, at the top platen"),
    lsm.Variable(
        "platen_bulk_difference", ("run",), "f64", "1", "platen friction over bulk friction, less 1, unsigned"
    ),
    lsm.Variable("inertial_number", ("run",), "f64", "1", "shear rate times diameter times sqrt(density over stress)"),
    lsm.Variable("stiffness_number", ("run",), "f64", "1", "contact stiffness over stress and out-of-plane thickness"),
    lsm.Variable("energy_residual", ("run",), "f64", "1", "greatest energy residual over the work throughput of shear"),
    lsm.Variable(
        "normal_stress_error", ("run",), "f64", "1", "mean normal stress on the platen over its target, less 1"
    ),
    lsm.Variable(
        "normal_stress_rms", ("run",), "f64", "1", "rms deviation of the platen's stress from its target, every step"
    ),
    lsm.Variable("layer_thickness", ("run",), "f64", "m", "mean distance of the platens' reference planes"),
    lsm.Variable("porosity", ("run",), "f64", "1", "mean share of the layer not filled by mobile grains"),
    lsm.Variable("coordination_number", ("run",), "f64", "1", "mean number of contacts of a mobile grain"),
    lsm.Variable(
        "sliding_fraction", ("run",), "f64", "1", "mean share of the contacts that slide, by their friction law"
    ),
]
SEED = lsm.Variable("seed", ("run",), "i32", "1", "seed of the packing")
TEXTS = {
    "shape": "shape of the mobile grains",
    "status": "how the run ended: complete, failed or interrupted",
    "path": "folder of the run, relative to this file",
    "note": "why friction_se is unknown; empty where it is known, and for runs that are not complete",
}


class Params(shear_gouge.Params):
    """The conditions that both shapes share."""

    # No option here, since both shapes are run; the checks of angular grains are the stricter ones.
    shape: ClassVar[str] = "angular"  # pyright: ignore[reportIncompatibleVariableOverride]  as said above
    target_error: ClassVar[None] = None  # pyright: ignore[reportIncompatibleVariableOverride]  replicas are given
    breakable: ClassVar[bool] = False  # pyright: ignore[reportIncompatibleVariableOverride]  spheres do not break
    pieces: ClassVar[int] = 7  # pyright: ignore[reportIncompatibleVariableOverride]  likewise
    bond_strength: ClassVar[float] = 20.0  # pyright: ignore[reportIncompatibleVariableOverride]  likewise
    weibull_modulus: ClassVar[None] = None  # pyright: ignore[reportIncompatibleVariableOverride]  likewise
    stages: ClassVar[list] = []  # pyright: ignore[reportIncompatibleVariableOverride]  one steady state is compared
    profile: ClassVar[bool] = False  # pyright: ignore[reportIncompatibleVariableOverride]  what runs print is not shown

    replicas: int = Field(
        default=3, ge=1, le=1000, description="runs per shape, with the seeds seed, seed + 1, ... [1]"
    )
    without_result: ClassVar[frozenset[str]] = shear_gouge.Params.without_result | {"at_a_time"}

    at_a_time: int = Field(default=2, ge=1, le=1024, description="runs at a time, each in a process of its own [1]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "layer_thickness": 10.0,
            "length": 16.0,
            "inertial_number": 1e-2,
            "strain": 2.0,
            "steady_from": 0.5,
            "replicas": 2,
        },
        "demo": {"layer_thickness": 20.0, "length": 28.0, "inertial_number": 2.5e-3, "strain": 3.0},
        "standard": {"replicas": 5},
        "reference": {
            "length": 60.0,
            "inertial_number": 3e-4,
            "stiffness_number": 1e4,
            "strain": 10.0,
            "replicas": 5,
        },
    }

    @model_validator(mode="after")
    def _seeds_fit_their_column(self) -> Self:
        last = self.seed + self.replicas - 1
        if last >= 2**31:
            raise ValueError(
                f"--seed {self.seed}, --replicas {self.replicas}: the last seed {last} must be at most {2**31 - 1}; "
                "lower the seed"
            )
        return self


# Parameters that may change in a run that goes on.
RESUMABLE = shear_gouge.RESUMABLE


def check(params: Params) -> None:
    """Refuse parameters that are sure to fail for one of the shapes, as `shear_gouge.check` does.

    Raises
    ------
    InputError
        With the option, its value, what is allowed and what to do.
    """
    check_idle(params)
    for of_run in build(params).values():
        if of_run.seed == params.seed:  # no check depends on the seed
            shear_gouge.check(of_run)


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of all runs."""
    return of_replicas([shear_gouge.estimate(of_run) for of_run in build(params).values()], params.at_a_time)


def build(params: Params) -> dict[str, shear_gouge.Params]:
    """Label -> parameters of every run, round grains first; the label is also the name of the run's folder."""
    seeds = range(params.seed, params.seed + params.replicas)
    return {
        f"{shape}-{seed}": derived(shear_gouge.Params, params, shape=shape, seed=seed)
        for shape in SHAPES
        for seed in seeds
    }


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Shear both shapes; writes compare.nc, friction.png, summary.json and runs/ to `out`.

    Returns compare.nc as a Dataset (dimension run). Runs that fail do not stop the others: the files are
    written with the results there are and the run_status "failed" before SimulationError is raised.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed, or goes on.
    Raises InputError for a folder or a run in it that does not suit.
    """
    check(params)
    if existing == "resume":
        for label, of_run in build(params).items():
            child = Path(out) / "runs" / label
            if is_begun(child):  # before anything is changed
                shear_gouge.check_resume(of_run, child)
    with run_folder(params, "compare-shapes", out, existing, RESUMABLE) as folder:
        return _run(params, folder, progress, existing == "resume")


def _run(params: Params, out: Path, progress: Progress | None, resume: bool) -> xarray.Dataset:
    """The experiment in its folder."""
    runs, watch = build(params), Stopwatch()
    # Angular grains take longer: started first, they do not leave a processor idle at the end.
    jobs = [(label, shear_gouge.__name__, runs[label], out / "runs" / label) for label in reversed(runs)]
    failure, status = None, "complete"
    try:
        run_replicas(jobs, params.at_a_time, progress, resume)
    except lsm.SimulationError as error:
        failure, status = error, "failed"
    except signals.Interrupted as stop:
        failure, status = stop, "interrupted"
    table = collect(runs, params, out, status)
    if status != "interrupted":
        run_plots.plot_comparison(out, params.format)
    metrics = analyse(table)
    metrics |= watch.metrics(resume)
    if progress:
        print(table_text(table))
    write_summary(out, "compare-shapes", params.preset_name, metrics, quiet=progress is None, run_status=status)
    if failure:
        raise failure
    return table


def collect(runs: dict[str, shear_gouge.Params], params: Params, out: Path, run_status: str) -> xarray.Dataset:
    """Write compare.nc from the files of the runs, and return it; missing values are NaN."""
    rows, shared = [], []
    for label, of_run in runs.items():
        path = out / "runs" / label / "run.nc"
        dataset = lsm.open_run(path) if path.exists() else None
        status = dataset.run_status if dataset is not None else "running"
        if status == "running":  # killed before it wrote how it ended, or never started
            status = "failed" if run_status == "complete" else run_status
        row = {"shape": of_run.shape, "seed": of_run.seed, "path": f"runs/{label}", "status": status}
        metrics = shear_gouge.analyse(dataset, of_run) if dataset is not None and status == "complete" else {}
        row |= {v.name: number(metrics[v.name]) if metrics else np.nan for v in COLUMNS}
        row["time_step"] = dataset.dt if dataset is not None else np.nan
        row["note"] = (metrics["friction_se"].note or "") if metrics else ""
        shared = parameter_coordinates(of_run, without=("shape", "seed", "stiffness_number"))  # the last is measured
        row |= {scalar.name: scalar.value for scalar in shared}
        rows.append(row)
    title = "Friction of gouge of round and of angular grains"
    text = (
        f"One row per run of shear-gouge, {params.replicas} seeds for each shape, otherwise under the same conditions."
    )
    numbers, texts = columns_of(shared)
    return write_runs(
        out / "compare.nc",
        rows,
        [SEED, *COLUMNS, TIME_STEP, *numbers],
        params,
        title,
        text,
        parameters=("shape", "seed", *(scalar.name for scalar in shared)),
        text=TEXTS | texts,
        run_status=run_status,
    )


def estimates(table: xarray.Dataset) -> dict[str, Any]:
    """Shape -> friction from the means of its complete runs; shapes without such runs are left out."""
    found = {}
    for shape in SHAPES:
        own = table.isel(run=(table["shape"].values == shape) & (table.status.values == "complete"))
        if own.sizes["run"]:
            columns = (own.friction_mean.values, own.friction_se.values, own.friction_ess.values)
            found[shape] = lsm.statistics.combine_replicas(*columns)
    return found


def analyse(table: xarray.Dataset) -> dict[str, Metric]:
    """Metrics of the comparison; None where no run gives a value."""
    found, metrics = estimates(table), {}
    for shape in SHAPES:
        metrics |= metrics_of_estimate(f"friction_{shape}_mean", f"friction_{shape}_se", found.get(shape))
    apart = lsm.statistics.difference(found["angular"], found["round"]) if len(found) == 2 else None
    metrics |= metrics_of_estimate("friction_difference", "friction_difference_se", apart)
    labels = [f"{shape}-{seed}" for shape, seed in zip(table["shape"].values, table.seed.values, strict=True)]
    columns = {name: table[name].values for name in shear_gouge.BOUNDS}
    return metrics | worst_claims({run: {n: c[i] for n, c in columns.items()} for i, run in enumerate(labels)})


def table_text(table: xarray.Dataset) -> str:
    """The runs as plain text, one line each below the titles; "unknown" with the reason at the end of the line."""
    titles = ("shape", "seed", "status", "friction", "error", "samples", "at platen", "I", "energy residual")
    lines: list[tuple[str, ...]] = [titles]
    notes = [""]
    for row in (table.isel(run=i) for i in range(table.sizes["run"])):
        text = (row["shape"].item(), str(row.seed.item()), row.status.item())
        names = ("friction_mean", "friction_se", "friction_ess", "platen_friction_mean", "inertial_number")
        numbers = [row[name].item() for name in (*names, "energy_residual")]
        formats = (".3f", ".3f", ".0f", ".3f", ".2g", ".2g")
        complete = row.status.item() == "complete"  # other runs have no results at all
        lines.append((*text, *(shown(n, f) if complete else "-" for n, f in zip(numbers, formats, strict=True))))
        notes.append(row.note.item().removeprefix("unknown: "))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    aligned = ("  ".join(c.rjust(w) for c, w in zip(line, widths, strict=True)) for line in lines)
    return "\n".join(f"{line}  {note}".rstrip() for line, note in zip(aligned, notes, strict=True))
