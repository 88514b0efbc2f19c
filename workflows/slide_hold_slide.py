"""Slide a layer, hold it for ever longer times, slide again: how its strength grows with the time of the hold.

Layers of several seeds are run in. From the last state of each, the same to the bit, one run goes on for every hold:
the platen, or the load point of its spring, stands still for that time and then moves as before. One run goes on
without a hold: its peak is what noise alone gives.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.common.metrics import Metric, metrics_of_value, read_summary, write_summary
from workflows.common.parallel_runs import run_replicas
from workflows.common.parameter_coordinates import columns_of, parameter_coordinates
from workflows.common.refusals import derived
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost, of_replicas
from workflows.common.run_folder import Existing, run_folder
from workflows.common.run_table import write_runs
from workflows.common.stopwatch import Stopwatch
from workflows.gouge import layer_scene
from workflows.gouge.forks import fork
from workflows.gouge.hold_response import COLUMNS, HOLD, RELOAD, RUN_IN, Healing, healing_of, response_to_hold
from workflows.gouge.layer_cost import layer_cost, start_seconds
from workflows.gouge.layer_metrics import worst_claims
from workflows.gouge.layer_parameters import LayerParams
from workflows.plots.healing import plot_healing
from workflows.protocol.stage_tables import Interval, Sample, StageTable, Until

if TYPE_CHECKING:
    import xarray

NAME = "slide-hold-slide"
ROWS = 40  # of a hold, and of the slip after it, at most as wide
TEXTS = {"path": "folder of the run, relative to this file", "status": "how the run ended"}
NOT_OF_RUNS = ("seed",)  # options that differ between the runs


class Params(LayerParams):
    """Layers that are held for different times from the same states."""

    run_in: float = Field(default=1.0, ge=0.05, le=1e3, description="shear strain before the hold [1]")
    shortest_hold: float = Field(default=10.0, ge=0.1, le=1e9, description="shortest hold [t_i]")
    longest_hold: float = Field(default=3162.0, ge=0.1, le=1e9, description="longest hold [t_i]")
    holds: int = Field(default=6, ge=3, le=100, description="number of holds, evenly spaced in their logarithm [1]")
    reload_slip: float = Field(default=2.0, ge=0.1, le=1e3, description="slip after the hold [mean diameters]")
    peak_within: float = Field(
        default=0.3,
        ge=0.01,
        le=1e3,
        description="slip after the hold within which the peak is looked for [mean diameters]",
    )
    replicas: int = Field(
        default=6,
        ge=2,
        le=1000,
        description="layers, with the seeds seed, seed + 1, ...; each is held for all times [1]",
    )
    at_a_time: int = Field(default=2, ge=1, le=1024, description="runs at a time, each in a process of its own [1]")

    # Runs are kept going by this experiment, which says nothing of their inner times.
    keep_checkpoint: ClassVar[bool] = False  # pyright: ignore[reportIncompatibleVariableOverride]  as said above
    profile: ClassVar[bool] = False  # pyright: ignore[reportIncompatibleVariableOverride]  likewise

    without_result: ClassVar[frozenset[str]] = LayerParams.without_result | {"at_a_time"}

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "length": 16.0,
            "layer_thickness": 10.0,
            "width": 4.0,
            "inertial_number": 1e-2,
            "run_in": 0.3,
            "longest_hold": 100.0,
            "holds": 3,
            "reload_slip": 1.0,
            "replicas": 2,
            "step_safety": 0.6,
        },
        "demo": {"longest_hold": 1000.0, "holds": 5, "replicas": 2},
        "standard": {},
        "reference": {"length": 60.0, "inertial_number": 3e-4, "stiffness_number": 1e4, "holds": 8, "replicas": 10},
    }

    @model_validator(mode="after")
    def _holds_differ(self) -> Self:
        if self.peak_within > self.reload_slip:
            raise ValueError(f"--peak-within {self.peak_within:g}: must be at most --reload-slip {self.reload_slip:g}")
        if self.longest_hold < 2.0 * self.shortest_hold:
            raise ValueError(
                f"--longest-hold {self.longest_hold:g}: must be at least twice --shortest-hold {self.shortest_hold:g}"
            )
        if self.seed + self.replicas - 1 >= 2**31:
            raise ValueError(f"--seed {self.seed}, --replicas {self.replicas}: the last seed must be below {2**31}")
        return self

    def shear_tables(self) -> list[StageTable]:
        """The stages of the longest hold."""
        return stages_with(self, self.longest_hold)


def hold_times(params: Params) -> NDArray:
    """(holds,) times of the holds [t_i]."""
    return np.geomspace(params.shortest_hold, params.longest_hold, params.holds)


def stages_with(params: Params, hold: float | None) -> list[StageTable]:
    """Stages with a hold of a time [t_i]; 0: without one; None: the run-in alone."""
    p, tables = params, [StageTable(name=RUN_IN, velocity=1.0, until=Until(strain=params.run_in))]
    if hold:
        sample = Sample(time=0.5, growth=1.2, most=Interval(time=max(1.0, hold / ROWS)))
        tables.append(StageTable(name=HOLD, velocity=0.0, until=Until(time=hold), sample=sample))
    if hold is not None:
        sample = Sample(time=0.5, growth=1.1, most=Interval(slip=p.reload_slip / ROWS))
        tables.append(StageTable(name=RELOAD, velocity=1.0, until=Until(slip=p.reload_slip), sample=sample))
    return tables


check = layer_scene.check  # as of every layer


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of all runs; the run-in of each seed is made once, but every run starts anew."""
    trunk, start = layer_cost(_params_of(params, params.seed, None)), start_seconds(params)
    costs = [trunk]
    for hold in (0.0, *hold_times(params)):
        whole = layer_cost(_params_of(params, params.seed, float(hold)))
        costs.append(RunCost(whole.steps - trunk.steps, whole.seconds - trunk.seconds + start, whole.memory))
    return of_replicas(costs * params.replicas, params.at_a_time)


def _params_of(params: Params, seed: int, hold: float | None) -> shear_gouge.Params:
    """Parameters of one run: that of a seed until it is held, or on through a hold [t_i]."""
    return derived(
        shear_gouge.Params, params, seed=seed, stages=stages_with(params, hold), keep_checkpoint=hold is None
    )


def build(params: Params) -> tuple[dict[str, shear_gouge.Params], dict[str, tuple[str, float, shear_gouge.Params]]]:
    """({label: parameters} of the runs until the hold, {label: (label of that run, hold [t_i], parameters)})."""
    seeds = range(params.seed, params.seed + params.replicas)
    trunks = {f"seed-{seed}": _params_of(params, seed, None) for seed in seeds}
    holds = sorted((0.0, *hold_times(params)), reverse=True)  # the longest first, so that no core is idle at last
    branches = {
        f"seed-{seed}-hold-{hold:.4g}": (f"seed-{seed}", float(hold), _params_of(params, seed, float(hold)))
        for hold in holds
        for seed in seeds
    }
    return trunks, branches


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Hold all layers for all times; writes healing.nc, healing.png, summary.json and runs/; returns healing.nc.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed, or goes on.
    Raises InputError for a folder or a run in it that does not suit, SimulationError if a run failed.
    """
    check(params)
    with run_folder(params, NAME, out, existing) as folder:
        return _run(params, folder, progress, existing == "resume")


def _run(params: Params, out: Path, progress: Progress | None, resume: bool) -> xarray.Dataset:
    """The experiment in its folder."""
    watch, (trunks, branches), runs = Stopwatch(), build(params), out / "runs"
    module = shear_gouge.__name__
    run_replicas([(n, module, p, runs / n) for n, p in trunks.items()], params.at_a_time, progress, resume)
    for label, (trunk, _, _) in branches.items():
        fork(runs / trunk, runs / label)
    failure, status = None, "complete"
    try:
        jobs = [(label, module, of_run, runs / label) for label, (_, _, of_run) in branches.items()]
        run_replicas(jobs, params.at_a_time, progress, resume=True)
    except lsm.SimulationError as error:
        failure, status = error, "failed"
    table = collect(branches, params, out, status)
    found = healing_of(table)
    metrics = analyse(found, table, out)
    if found is not None:
        plot_healing(out / f"healing.{params.format}", out, table, found)
    write_summary(
        out, NAME, params.preset_name, metrics | watch.metrics(resume), quiet=progress is None, run_status=status
    )
    if failure:
        raise failure
    return table


def collect(
    branches: dict[str, tuple[str, float, shear_gouge.Params]], params: Params, out: Path, run_status: str
) -> xarray.Dataset:
    """Write healing.nc from the files of the runs, one row for each hold of each seed, and return it."""
    rows, shared = [], []
    for label, (_, hold, of_run) in branches.items():
        dataset = lsm.open_run(out / "runs" / label / "run.nc")
        shared = parameter_coordinates(of_run, without=NOT_OF_RUNS)
        row = {"seed": of_run.seed, "path": f"runs/{label}", "status": dataset.run_status}
        row |= {"hold_time": hold * params.inertial_time, "hold_inertial_times": hold}
        row |= response_to_hold(dataset, params.diameter, params.peak_within)
        rows.append(row | {scalar.name: scalar.value for scalar in shared})
    numbers, texts = columns_of(shared)
    return write_runs(
        out / "healing.nc",
        rows,
        [*COLUMNS, *numbers],
        params,
        "Strength of a layer after holds",
        f"One row per run: {params.replicas} seeds, each without a hold and with {params.holds} of different time.",
        parameters=("seed", "hold_time", "hold_inertial_times", *(scalar.name for scalar in shared)),
        text=TEXTS | texts,
        run_status=run_status,
    )


def analyse(found: Healing | None, table: xarray.Dataset, out: Path) -> dict[str, Metric]:
    """Metrics of the holds, in docs/slide-hold-slide.md."""
    complete = int((table.status == "complete").sum())
    metrics = {"runs": Metric(complete, "1", note=f"complete, of {table.sizes['run']}")}
    if found is None:
        return metrics
    line = found.line
    words = "of friction at the peak less the steady one, per factor of ten of the hold"
    metrics |= metrics_of_value("healing_per_decade", line.per_decade, "1", words)
    metrics |= metrics_of_value("healing_per_e_fold", line.per_e_fold, "1", "the same per factor of e")
    words = "about 1 if healing grows with the logarithm of the hold"
    metrics["healing_misfit"] = Metric(line.chi_square / line.degrees_of_freedom, "1", note=words)
    for name, (estimate, words) in found.others.items():
        metrics |= metrics_of_value(name, estimate, "1", words)
    residuals = {}
    for path in table.path.values:
        entry = (read_summary(out / path) or {"metrics": {}})["metrics"].get("energy_residual", {})
        residuals[str(path)] = {"energy_residual": np.nan if entry.get("value") is None else entry["value"]}
    return metrics | worst_claims(residuals, ("energy_residual",))
