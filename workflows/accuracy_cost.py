"""What accuracy costs in time: error and cost of every choice that trades one for the other.

Integrators and time steps, precision, force law, neighbour skin; patches and discs per grain, corner radius; stiffness
and inertial number, size of the layer, strain and seeds, roughness of the walls. Costs are relative to those of
discs at the default settings, timed in rotation with nothing else running.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import Field, model_validator

from workflows import shear_gouge
from workflows.accuracy import Trial, collisions, gas, gouge, outlines
from workflows.accuracy.curves import curves
from workflows.accuracy.total_cost import total_cost
from workflows.accuracy.trials_file import write_trials
from workflows.common.fresh_processes import fresh_processes, in_fresh_process
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameter_problems import BrokenRules
from workflows.common.parameters import Params as BaseParams
from workflows.common.refusals import check_idle
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost
from workflows.common.run_folder import Existing
from workflows.common.run_table import attributes_of
from workflows.gouge.grain_parameters import Shape, round_grains
from workflows.plots.tenfold import plot_summary
from workflows.plots.work_precision import plot_work_precision
from workflows.protocol.finished_parts import FinishedParts, folder_of_parts

if TYPE_CHECKING:
    import xarray

Parameter = Literal[
    "stiffness_number", "inertial_number", "layer_thickness", "length", "step_safety", "platen_roughness"
]
LEAST_LONG = 3.0  # strain
# What to change where a claim does not hold.
UNRESOLVED = "the errors measured here do not show the order of the scheme: use --preset standard on an idle machine"
MISSED = "the neighbour list missed a pair: the skin is a fault of the code, please report it"


Report = Callable[[str, str], None]  # takes label and state


class Params(BaseParams):
    """Extent of the measurements."""

    # No options: times are compared on one thread of the CPU, and both precisions are measured.
    arch: ClassVar[str] = "cpu"  # pyright: ignore[reportIncompatibleVariableOverride]  as said above
    threads: ClassVar[int] = 1  # pyright: ignore[reportIncompatibleVariableOverride]  likewise
    precision: ClassVar[str] = "f64"  # pyright: ignore[reportIncompatibleVariableOverride]  likewise

    phases: int = Field(
        default=64,
        ge=8,
        le=100_000,
        description="pairs of discs in a measurement of collisions, each at another phase of the step [1]",
    )
    replicas: int = Field(default=4, ge=2, le=1000, description="measurements of each collision and gas [1]")
    gas_grains: int = Field(default=225, ge=16, le=1_000_000, description="grains of the gas, a square number [1]")
    contacts: float = Field(
        default=100.0, ge=1, le=1e6, description="time over which the gas is simulated [contact durations]"
    )
    timed_steps: int = Field(default=3000, ge=30, le=1_000_000_000, description="steps of each timed run [1]")
    turns: int = Field(default=5, ge=1, le=1000, description="number of measurements of each cost [1]")
    shape_turns: int = Field(
        default=3, ge=1, le=1000, description="number of times that the layer of each shape is sheared [1]"
    )
    impacts: int = Field(default=48, ge=4, le=100_000, description="impacts of ellipses at random orientations [1]")
    patches: list[Annotated[int, Field(ge=12, le=1200, multiple_of=6)]] = Field(
        default=[12, 18, 30, 60, 120], min_length=1, description="patches per grain [1]"
    )
    discs: list[Annotated[int, Field(ge=3, le=1000)]] = Field(default=[12, 30, 60], description="discs per clump [1]")
    corners: list[Annotated[float, Field(ge=0.02, le=0.25)]] = Field(
        default=[0.2, 0.1, 0.05, 0.03], description="corner radii [diameters]"
    )
    shapes: list[Shape] = Field(
        default=["round"], min_length=1, description="grains of the layers in which all parameters are varied"
    )
    long_shapes: list[Shape] = Field(
        default=["round", "angular"],
        description="grains of the layers in which step, strain and seeds are varied",
    )
    parameters: list[Parameter] = Field(
        default=list(get_args(Parameter)), min_length=1, description="parameters of the layer to measure"
    )
    most_settings: int = Field(
        default=4, ge=3, le=4, description="settings of each of these parameters, including the default [1]"
    )
    seeds: int = Field(default=4, ge=2, le=1000, description="runs of each setting of a layer [1]")
    strain: float = Field(default=3.0, gt=1.2, le=1e4, description="shear strain of the layers [1]")
    long_strain: float = Field(
        default=33.0, ge=0, le=1e4, description="strain of the runs that measure strain and seeds; 0: none [1]"
    )
    long_runs: int = Field(default=6, ge=2, le=1000, description="number of these long runs [1]")
    lists: bool = Field(default=True, description="measure the neighbour skin")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "phases": 16,
            "replicas": 2,
            "contacts": 10.0,
            "timed_steps": 300,
            "turns": 1,
            "shape_turns": 1,
            "impacts": 4,
            "patches": [12, 30],
            "discs": [],
            "corners": [],
            "long_shapes": ["round"],
            "parameters": ["stiffness_number"],
            "most_settings": 3,
            "seeds": 2,
            "strain": 1.5,
            "long_strain": 0.0,
            "lists": False,
        },
        "demo": {
            "turns": 3,
            "shape_turns": 2,
            "patches": [12, 30, 60],
            "discs": [12, 30],
            "corners": [],
            "long_shapes": ["round"],
            "parameters": ["stiffness_number"],
            "most_settings": 3,
            "seeds": 4,
            "strain": 3.0,
            "long_strain": 9.0,
            "long_runs": 4,
            "lists": False,
        },
        "standard": {},
        "reference": {"seeds": 16, "long_strain": 65.0, "long_runs": 16, "replicas": 16},
    }

    def idle(self) -> dict[str, str]:
        """Fields that have no effect: of long runs that are not made."""
        if not self.long_shapes:
            return dict.fromkeys(("long_strain", "long_runs"), "without --long-shapes")
        return {} if self.long_strain else {"long_runs": "with --long-strain 0"}

    def read_as(self, name: str, word: str) -> str | None:
        """That a word for spheres means discs: the layers are those of two dimensions."""
        return round_grains(word, 2) if name in ("shapes", "long_shapes") else None

    @model_validator(mode="after")
    def _measurable(self) -> Self:
        problems = []
        if math.isqrt(self.gas_grains) ** 2 != self.gas_grains:
            near = round(math.sqrt(self.gas_grains)) ** 2
            problems.append(f"--gas-grains {self.gas_grains}: must be a square number, such as {near}")
        if self.long_shapes and 0.0 < self.long_strain < LEAST_LONG:
            problems.append(
                f"--long-strain {self.long_strain:g}: must be 0, for no such runs, or >= {LEAST_LONG:g}, so that "
                "windows of several widths fit into the steady state"
            )
        more = max(self.seeds, self.long_runs, self.replicas) - 1
        if self.seed + more >= 2**31:
            problems.append(f"--seed {self.seed}: must be <= {2**31 - 1 - more}, for the last of so many runs")
        if problems:
            raise BrokenRules(problems)
        return self


def check(params: Params) -> None:
    """Refuse parameters that are sure to fail, before any layer is made.

    Raises
    ------
    InputError
        With the option, its value, what is allowed and what to do.
    """
    check_idle(params)
    last = params.seed + max(params.seeds, params.long_runs, params.replicas) - 1
    for shape in dict.fromkeys(params.shapes + params.long_shapes):
        for seed in (params.seed, last):
            shear_gouge.check(gouge.layer(params, shape, seed))


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of all measurements."""
    return total_cost(params)


def numerical(params: Params, report: Report) -> list[Trial]:
    """Trials of integrators, steps, precision, force law and skin."""
    trials = []
    with fresh_processes(2) as pool:  # side by side, as they are not timed
        of_pairs = {law: pool.submit(collisions.measure_collisions, params, law) for law in collisions.FORCE_LAWS}
        of_rack = pool.submit(collisions.measure_rack, params)
        for force_law, future in of_pairs.items():
            trials += future.result()
            report("collisions", f"{force_law} force law")
        trials += of_rack.result()
        report("rack", "ten discs")
    of_gas = in_fresh_process(gas.measure_gas, params, "first") + in_fresh_process(gas.measure_gas, params, "second")
    report("gas", f"{params.gas_grains} grains of arcs")
    of_f32 = in_fresh_process(gas.measure_gas, params, "single", "f32")
    usual = of_gas[0].cost / of_gas[0].relative
    of_gas += [replace(t, relative=t.cost / usual) for t in of_f32]
    report("gas", "f32")
    per_step = {t.parameter: t.relative / t.value for t in of_gas}
    discs = {parameter: rate / per_step["onset_verlet"] for parameter, rate in per_step.items()}
    default = in_fresh_process(gas.default_steps_per_contact, params)
    for i, t in enumerate(trials):  # collisions of discs: number of steps times the cost of a step of the scheme
        scheme = t.parameter.split(",")[0]
        trials[i] = replace(t, relative=t.value / default * discs[scheme])
    if params.lists:
        trials += in_fresh_process(gas.measure_lists, params)
        report("skin", "gas of discs")
    return trials + of_gas


def of_shapes(params: Params, report: Report) -> list[Trial]:
    """Trials of patches, discs per clump and corner radius."""
    wanted = [("round", 0)] + [("patches", n) for n in params.patches] + [("discs", n) for n in params.discs]
    wanted += [("corner", r) for r in params.corners]
    rows = {key: [] for key in wanted}
    for _ in range(params.shape_turns):
        for kind, count in wanted:
            rows[kind, count].append(in_fresh_process(outlines.measure_layer, params, kind, count))
            report("shapes", f"{kind} {count:g}")
    trials = outlines.trials_of(rows)
    relative = {t.value: t.relative for t in trials if t.parameter == "patches"}
    if params.corners:
        trials += in_fresh_process(outlines.measure_parts, params)
        report("shapes", "convex parts")
    moved = in_fresh_process(outlines.measure_impacts, params)
    return trials + [replace(t, relative=relative.get(t.value, np.nan)) for t in moved if t.value in relative]


def physical(params: Params, out: Path, report: Report) -> tuple[list[Trial], list[dict[str, Any]]]:
    """(trials of the physical choices, rows of the table for target errors)."""
    trials, rows, usual = [], [], None
    for shape in dict.fromkeys(params.shapes + params.long_shapes):
        parameters = params.parameters if shape in params.shapes else ["step_safety"]
        of_shape, found, usual = gouge.measure_parameters(params, shape, parameters, out / "runs", usual)
        trials += of_shape
        report("layers", f"{shape}, {', '.join(parameters)}")
        if params.long_strain and shape in params.long_shapes:
            of_strain, row = gouge.measure_strain(params, shape, out / "runs", usual)
            trials += of_strain
            rows.append(row | gouge.of_steps(params, found))
            report("layers", f"{shape}, strain and seeds")
    return trials, rows


def analyse(trials: Sequence[Trial]) -> dict[str, Metric]:
    """Metrics of the trials."""
    found = curves(trials)

    def order(scheme, quantity):
        return found[scheme, quantity].order()

    after, during, drift = "energy after a collision", "energy during a collision", "energy drift of a gas"
    explicit, symplectic = order("explicit_euler", drift), order("symplectic_euler", during)
    verlet, onset = order("velocity_verlet", after), order("onset_verlet", after)
    reference = found["onset_verlet", drift]
    at = int(np.argmin(np.abs(reference.value - 48)))
    of_paper = found["symplectic_euler", drift].cost_at(reference.error[at]) / reference.relative[at]
    metrics = {
        name: Metric(value, "1", bound, holds, remedy=UNRESOLVED)
        for name, value, bound, holds in (
            ("order_explicit_euler", explicit, "below 0.5: the drift does not fall", explicit < 0.5),
            ("order_symplectic_euler", symplectic, "1 within 0.2", abs(symplectic - 1.0) <= 0.2),
            ("order_verlet", verlet, "2 within 0.2", abs(verlet - 2.0) <= 0.2),
            ("order_onset_verlet", onset, "at least 3", onset >= 3.0),
        )
    }
    metrics |= {
        "order_forest_ruth": Metric(order("forest_ruth", after), "1"),
        "least_drift_explicit_euler": Metric(float(found["explicit_euler", drift].error.min()), "1"),
        "cost_ratio_paper_scheme": Metric(of_paper, "1"),
    }
    patches, clumps = found.get(("patches", "shape error")), found.get(("discs of a clump", "shape error"))
    if patches and clumps and 30 in patches.value and len(clumps.value) > 1:
        chosen = list(patches.value).index(30)
        ratio = clumps.cost_at(patches.error[chosen]) / patches.relative[chosen]
        metrics["cost_ratio_clumps"] = Metric(ratio, "1")
    skins = [t for t in trials if t.parameter == "skin"]
    if skins:
        differ = max(t.error for t in skins)
        metrics["skin_difference"] = Metric(differ, "m", "0: no pair may be missed", differ == 0.0, remedy=MISSED)
    for parameter, name in (("skin", "cost_of_skin"), ("convex parts", "cost_of_parts")):
        metrics |= {f"{name}_{t.value:g}": Metric(t.relative, "1") for t in trials if t.parameter == parameter}
    for (parameter, quantity), curve in found.items():
        if quantity in (drift, "shape error", "friction", "statistical error of friction"):
            name = f"tenfold_{parameter}_{quantity}".replace(", ", "_").replace(" ", "_")
            metrics[name] = Metric(curve.tenfold(), "1")
    return metrics


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Make all measurements; writes accuracy.nc, work_precision.png, tenfold.png, runs/ and summary.json to `out`.

    Returns accuracy.nc. With long layers it also writes friction_errors.json, from which target errors are planned.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed but for complete runs of
    layers, which are not repeated, or goes on. Raises InputError for a folder or a run in it that does not suit.
    """
    check(params)
    with folder_of_parts(params, "accuracy-cost", out, existing, keep_runs=True) as (folder, parts):
        return _run(params, folder, parts, progress)


def _run(params: Params, out: Path, parts: FinishedParts, progress: Progress | None) -> xarray.Dataset:
    """The experiment in its folder."""

    def report(label, state):
        if progress:
            progress({"label": label, "state": f"{state}, {parts.watch.seconds:.0f} s"})

    trials = []
    for name, measure in (("numerical", numerical), ("shapes", of_shapes)):
        found = parts.made(name, lambda measure=measure: [asdict(trial) for trial in measure(params, report)])
        trials += [Trial(**values) for values in found]
    of_layers, rows = physical(params, out, report)
    trials += of_layers
    title, summary = "Accuracy against cost", "Errors and costs of settings, by parameter."
    attributes = attributes_of(params, title, summary, params.seed)
    table = write_trials(out / "accuracy.nc", trials, attributes)
    if rows:
        made_by = {"made_by": f"lsm accuracy-cost --preset {params.preset_name}", "rows": rows}
        (out / "friction_errors.json").write_text(json.dumps(made_by, indent=2) + "\n", encoding="utf-8")
    found = curves(trials)
    plot_work_precision(out / f"work_precision.{params.format}", found)
    plot_summary(out / f"tenfold.{params.format}", found)
    metrics = analyse(trials)
    metrics |= parts.watch.metrics()
    write_summary(out, "accuracy-cost", params.preset_name, metrics, quiet=progress is None)
    parts.clear()
    return table
