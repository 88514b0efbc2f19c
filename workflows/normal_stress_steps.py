"""Step the normal stress on a sheared layer up and down, and measure how friction and porosity follow.

The layer is run in under the normal stress P, then sheared under r P and P in turn at one velocity. Friction, shear
stress and porosity after each step are stacked over the cycles against slip.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_value
from workflows.common.reports import Progress
from workflows.common.run_folder import Existing
from workflows.gouge import layer_scene
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.layer_metrics import quality_metrics
from workflows.gouge.layer_run import LayerExperiment, run_layer
from workflows.gouge.step_cycles import DOWN, UP, StepParams, mean_over_cycles, stacks_of, steady_changes, write_cycles
from workflows.plots.normal_stress_steps import plot_normal_stress_steps
from workflows.plots.run_plots import plot_run
from workflows.protocol.stage_tables import StageTable

if TYPE_CHECKING:
    import xarray

WINDOW = 0.25  # of the slip of a stage, within which the transient is looked for
NAMES = {UP: "up", DOWN: "down"}


class Params(StepParams):
    """A layer whose normal stress is stepped up and down."""

    stress_ratio: float = Field(default=1.2, ge=1.01, le=100, description="normal stress after a step up over P [1]")
    ramp: float = Field(default=0.0, ge=0, le=1e6, description="time in which the stress changes; 0: at once [t_i]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "length": 16.0,
            "layer_thickness": 10.0,
            "width": 4.0,
            "inertial_number": 1e-2,
            "run_in": 0.3,
            "cycles": 8,
            "step_slip": 1.0,
            "step_safety": 0.6,
        },
        "demo": {"cycles": 10},
        "standard": {},
        "reference": {"length": 60.0, "inertial_number": 3e-4, "stiffness_number": 1e4, "cycles": 60},
    }

    def shear_tables(self) -> list[StageTable]:
        """Run-in, then steps up and down."""
        steps = ({"normal_stress": stress, "ramp": self.ramp} for stress in (self.stress_ratio, 1.0))
        return self.step_tables(*steps)


def analyse(stacks: Mapping[str, xarray.Dataset], params: Params) -> dict[str, Metric]:
    """Metrics of the steps, in docs/normal-stress-steps.md."""
    logarithm, metrics = math.log(params.stress_ratio), {}
    for name, words in (("friction", "platen_friction"), ("porosity", "porosity")):
        found = mean_over_cycles(steady_changes(stacks, words, params) / logarithm)
        note = f"steady change of the {name} per ln of the normal stress"
        metrics |= metrics_of_value(f"{name}_change", found, "1", note)
    for stage, stack in stacks.items():
        metrics |= _transient(stack, NAMES[stage], params)
    return metrics


def _transient(stack: xarray.Dataset, name: str, params: Params) -> dict[str, Metric]:
    """Greatest departure of the mean friction from that before the step, soon after it, and where it lies."""
    slip, values = stack.slip_since_step.values, stack.platen_friction.values
    before = np.average(values[:, slip < 0.0], 1, np.gradient(slip)[slip < 0.0])
    near = (slip >= 0.0) & (slip <= WINDOW * params.step_slip * params.diameter)
    departures = values[:, near] - before[:, None]
    at = int(np.argmax(np.abs(departures.mean(axis=0))))
    here = departures[:, at]
    found = lsm.statistics.combine_replicas(here)
    note = f"greatest departure of the friction from that before the step {name}, within a quarter of its slip"
    place = Metric(
        float(slip[near][at]) / params.diameter, "1", note=f"slip at which that of the step {name} lies, in diameters"
    )
    return metrics_of_value(f"transient_{name}", found, "1", note) | {f"transient_slip_{name}": place}


def _conclude(dataset: xarray.Dataset, params: Params, out: Path) -> dict[str, Metric]:
    """Stacks, files and pictures of a run whose rows are all written."""
    stacks = stacks_of(dataset, params)
    write_cycles(out, stacks, params, "Steps of the normal stress on a sheared layer, cycle by cycle")
    plot_run(out, params.format)
    plot_normal_stress_steps(out / f"steps.{params.format}", dataset, stacks, params.stress_ratio)
    return analyse(stacks, params) | quality_metrics(dataset, params)


STEPS = LayerExperiment("normal-stress-steps", _conclude, longer=frozenset({"cycles"}))
RESUMABLE = STEPS.resumable  # parameters that may change in a run that goes on
check, estimate = layer_scene.check, layer_cost  # as of every layer


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """As `shear_gouge.run`; writes run.nc, grains.nc, cycles.nc, run.png, steps.png, summary.json; returns run.nc."""
    check(params)
    return run_layer(STEPS, None, params, out, progress, existing)
