"""Step the velocity of a sheared layer up and down, and fit rate-and-state friction to the stacked response.

The layer is run in at the velocity V of the inertial number, then sheared at r V and V in turn. Friction after each
step is stacked over the cycles against slip; a, b and D_c of the ageing and of the slip law come from the stack, a - b
from steady states as well, and the dilatancy coefficient from the porosity.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
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
from workflows.gouge.step_cycles import (
    DOWN,
    UP,
    StepParams,
    mean_over_cycles,
    stacks_of,
    steady_changes,
    velocities_of,
    write_cycles,
)
from workflows.plots.run_plots import plot_run
from workflows.plots.velocity_steps import plot_velocity_steps
from workflows.protocol.stage_tables import StageTable

if TYPE_CHECKING:
    import xarray


PERIODS = 3.0  # periods of the platen on its spring, which the relaxation of the layer must outlast


class Params(StepParams):
    """A layer whose velocity is stepped up and down."""

    velocity_ratio: float = Field(
        default=3.0, ge=1.05, le=1e3, description="velocity after a step up over that before it [1]"
    )

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "length": 16.0,
            "layer_thickness": 10.0,
            "width": 4.0,
            "inertial_number": 3e-3,
            "run_in": 0.3,
            "cycles": 8,
            "step_slip": 1.0,
            "step_safety": 0.6,
        },
        "demo": {"cycles": 10},
        "standard": {},
        "reference": {"length": 60.0, "inertial_number": 3e-4, "stiffness_number": 1e4, "cycles": 60},
    }

    @property
    def fastest(self) -> float:
        """Velocity of the fastest stage over V [1]."""
        return self.velocity_ratio

    def shear_tables(self) -> list[StageTable]:
        """Run-in, then steps up and down."""
        return self.step_tables({"velocity": self.velocity_ratio}, {"velocity": 1.0})

    def problems_of_shear(self) -> Iterator[str]:
        """A velocity beyond what a layer is sheared at, or slips too short to show a step."""
        yield from super().problems_of_shear()
        fastest = self.velocity_ratio * self.inertial_number
        if fastest > 0.3:
            yield (
                f"--velocity-ratio {self.velocity_ratio:g}, --inertial-number {self.inertial_number:g}: the inertial "
                f"number after a step would be {fastest:.2g}, must be <= 0.3; lower one of the two"
            )


@dataclass(frozen=True)
class Response:
    """What the steps of a run show.

    Attributes
    ----------
    stacks
        Stage -> its cycles along slip.
    velocities
        Stage -> velocity of the drive [m s-1].
    laws
        Fits of both laws of state to both kinds of steps.
    steady
        a - b from the steady states [1], mean over the cycles.
    dilatancy
        d phi / d ln V [1] likewise.
    """

    stacks: dict[str, xarray.Dataset]
    velocities: dict[str, float]
    laws: lsm.statistics.LawComparison
    steady: lsm.statistics.Estimate
    dilatancy: lsm.statistics.Estimate


def response_of(dataset: xarray.Dataset, params: Params) -> Response:
    """Stacks, fits and steady changes of the steps in run.nc."""
    stacks, v = stacks_of(dataset, params), velocities_of(dataset)
    friction = np.stack([stacks[stage].platen_friction.values for stage in (UP, DOWN)], axis=1)
    slip = stacks[UP].slip_since_step.values
    laws = lsm.statistics.compare_laws(
        slip, friction, [v[DOWN], v[UP]], [v[UP], v[DOWN]], stiffness=spring_over_force(params)
    )
    logarithm = math.log(v[UP] / v[DOWN])
    return Response(
        stacks,
        v,
        laws,
        mean_over_cycles(steady_changes(stacks, "platen_friction", params) / logarithm),
        mean_over_cycles(steady_changes(stacks, "porosity", params) / logarithm),
    )


def spring_over_force(params: Params) -> float:
    """The spring over the normal force on the layer [m-1]; inf at an imposed velocity."""
    return params.spring / (params.normal_stress * params.area) if params.spring else math.inf


def analyse(response: Response, params: Params) -> dict[str, Metric]:
    """Metrics of the steps, of the law that fits better and of both, in docs/velocity-steps.md."""
    laws, metrics = response.laws, {}
    best = laws.ageing if laws.better == "ageing" else laws.slip
    per_time = response.velocities[UP] * params.inertial_time
    oscillates = _oscillates(best.slip_distance.value / per_time, params)
    for suffix, fit in (("", best), ("_ageing", laws.ageing), ("_slip", laws.slip)):
        of = f"of the {fit.law} law" + (", which fits better" if not suffix else "")
        metrics |= metrics_of_value(f"direct_effect{suffix}", fit.a, "1", f"a {of}{oscillates}")
        metrics |= metrics_of_value(f"evolution_effect{suffix}", fit.b, "1", f"b {of}{oscillates}")
        metrics |= metrics_of_value(f"slip_distance{suffix}", fit.slip_distance, "m", f"D_c {of}{oscillates}")
        metrics |= metrics_of_value(f"rate_dependence{suffix}", fit.rate_dependence, "1", f"a - b {of}")
        words = f"chi square {of} over its degrees of freedom"
        metrics[f"misfit{suffix}"] = Metric(fit.chi_square / fit.degrees_of_freedom, "1", note=words)
    told = laws.unknown or "told apart"
    metrics["law_share"] = Metric(
        laws.share, "1", note=f"share of the resampled stacks that the {laws.better} law fits better; {told}"
    )
    metrics |= metrics_of_value(
        "rate_dependence_steady", response.steady, "1", "a - b from the steady states, without a law"
    )
    metrics |= metrics_of_value("dilatancy_coefficient", response.dilatancy, "1", "change of porosity per ln V")
    distance, size = best.slip_distance, params.diameter
    for name, unit, words in (
        ("slip_distance_diameters", size, "D_c over the mean diameter"),
        ("relaxation_time", per_time, "D_c/(r V) in inertial times"),
    ):
        interval = None if distance.unknown else (distance.low / unit, distance.high / unit)
        why = f"{words}; interval unknown: {distance.unknown}" if distance.unknown else words
        metrics[name] = Metric(distance.value / unit, "1", interval=interval, note=why)
    return metrics


def _oscillates(relaxation: float, params: Params) -> str:
    """That within a relaxation time [t_i] the platen oscillates on its spring, unknown to the fit; "" if not."""
    period = params.spring_period
    if period is None or relaxation > PERIODS * period:
        return ""
    return (
        f"; not of the layer alone: the platen oscillates on its spring with a period of {period:.2g} inertial times, "
        f"and D_c/(r V) is {relaxation:.2g}"
    )


def _conclude(dataset: xarray.Dataset, params: Params, out: Path) -> dict[str, Metric]:
    """Stacks, fits, files and pictures of a run whose rows are all written."""
    response = response_of(dataset, params)
    write_cycles(out, response.stacks, params, "Velocity steps of a sheared layer, cycle by cycle")
    plot_run(out, params.format)
    plot_velocity_steps(
        out / f"steps.{params.format}",
        dataset,
        response.stacks,
        response.laws,
        response.velocities,
        spring_over_force(params),
    )
    return analyse(response, params) | quality_metrics(dataset, params)


STEPS = LayerExperiment("velocity-steps", _conclude, longer=frozenset({"cycles"}))
RESUMABLE = STEPS.resumable  # parameters that may change in a run that goes on
check, estimate = layer_scene.check, layer_cost  # as of every layer


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """As `shear_gouge.run`; writes run.nc, grains.nc, cycles.nc, run.png, steps.png, summary.json; returns run.nc."""
    check(params)
    return run_layer(STEPS, None, params, out, progress, existing)
