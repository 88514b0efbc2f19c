"""Pull a layer slowly by a soft spring, find its slip events, and follow the energy of each.

A layer that is weaker in fast than in slow shear, or whose strength fluctuates, slips in events where the spring is
softer than a critical stiffness. The events are found by the velocity of the platen; each has its drop of stress, its
slip and duration, and the budget of the energy that the spring released.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_value
from workflows.common.reports import Progress
from workflows.common.run_folder import Existing
from workflows.common.run_table import write_result
from workflows.gouge import layer_scene
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.layer_metrics import quality_metrics, sheared_rows
from workflows.gouge.layer_parameters import SPRINGS, LayerParams
from workflows.gouge.layer_run import LayerExperiment, run_layer
from workflows.plots.run_plots import plot_run
from workflows.plots.stick_slip import plot_stick_slip
from workflows.protocol.stage_tables import Sample, StageTable, Until

if TYPE_CHECKING:
    import xarray

FILE = "events.nc"
SLIDE = "slide"  # the stage in which events are looked for
LEAST_ROWS = 100  # in it
CLOSED = 1e-3  # claimed of the energy residual of every event, over what the spring released


class Params(LayerParams):
    """A layer that a spring pulls until it has slipped many times."""

    run_in: float = Field(default=0.5, ge=0.01, le=1e3, description="shear strain before events are looked for [1]")
    strain: float = Field(default=3.0, gt=0, le=1e4, description="shear strain after that [1]")
    row_time: float = Field(
        default=2.0, ge=0.1, le=1e4, description="time from row to row of run.nc, by which events are resolved [t_i]"
    )

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "length": 16.0,
            "layer_thickness": 10.0,
            "width": 4.0,
            "inertial_number": 1e-3,
            "load_stiffness_ratio": 0.005,  # so soft that a short run has some events
            "run_in": 0.2,
            "strain": 0.5,
            "step_safety": 0.3,
        },
        # A quarter of the usual step: the energy of the smallest events closes too.
        "demo": {"load_stiffness_ratio": 0.02, "inertial_number": 3e-4, "strain": 0.5, "step_safety": 0.1},
        "standard": {"load_stiffness_ratio": 0.02, "inertial_number": 1e-4, "strain": 1.5, "step_safety": 0.1},
        "reference": {
            "load_stiffness_ratio": 0.02,
            "step_safety": 0.1,
            "length": 60.0,
            "inertial_number": 3e-5,
            "stiffness_number": 1e4,
        },
    }

    def shear_tables(self) -> list[StageTable]:
        """Run-in, and the stage whose events count."""
        return [
            StageTable(name="run-in", velocity=1.0, until=Until(strain=self.run_in)),
            StageTable(name=SLIDE, until=Until(strain=self.strain), sample=Sample(time=self.row_time)),
        ]

    def problems_of_shear(self) -> Iterator[str]:
        """A layer without a spring."""
        if self.spring is None:
            options = ", ".join("--" + name.replace("_", "-") for name in SPRINGS)
            yield f"{options}: one of them must be given, the spring of which pulls the layer"
        rows = self.strain / (self.inertial_number * self.row_time)
        if rows < LEAST_ROWS:
            yield (
                f"--strain {self.strain:g}, --row-time {self.row_time:g}: about {rows:.0f} rows would be written, "
                f"must be >= {LEAST_ROWS} for events to be found; raise --strain, or lower --row-time or "
                f"--inertial-number"
            )


def events_of(dataset: xarray.Dataset, params: Params) -> xarray.Dataset:
    """The slip events of run.nc with their energies; stresses are those of the spring over the area of the layer."""
    run, spring = sheared_rows(dataset), params.spring or 0.0
    run = run.isel(time=run.stage.values == SLIDE)
    stress = spring * run.spring_stretch.values / params.area
    load = float(np.median(run.load_point_velocity.values))
    events = lsm.statistics.detect_events(run.time.values, stress, run.plate_velocity.values, load)
    return lsm.statistics.event_energies(run, events, spring).assign_attrs(load_velocity=load)


def analyse(events: xarray.Dataset, params: Params) -> dict[str, Metric]:
    """Metrics of the events, in docs/stick-slip.md."""
    count = events.sizes["event"]
    threshold = float(events.attrs["onset_velocity"]) / float(events.attrs["load_velocity"])
    metrics = {
        "events": Metric(count, "1", note="slip events"),
        "onset_velocity": Metric(
            threshold, "1", note="that the platen must exceed in an event, over the load point's; slower slips are none"
        ),
    }
    if count < 2:
        return metrics
    found, p = lsm.statistics.catalogue_statistics(events), params
    for name, estimate, unit, words in (
        ("stress_drop", found.stress_drop, p.normal_stress, "mean drop of the stress over the normal stress"),
        ("slip", found.slip, p.diameter, "mean slip of an event in mean diameters"),
        ("duration", found.duration, p.inertial_time, "mean duration in inertial times, in whole rows"),
        ("recurrence", found.recurrence, p.inertial_time, "mean time from onset to onset in inertial times"),
    ):
        scaled = estimate._replace(mean=estimate.mean / unit, standard_error=estimate.standard_error / unit)
        metrics |= metrics_of_value(f"event_{name}", scaled, "1", words)
    metrics["recurrence_variation"] = Metric(
        found.recurrence_variation, "1", note="deviation of that time over its mean: 0 for a clock, 1 at random"
    )
    metrics |= _sizes(events)
    released = events.released_energy.values
    closed = float(np.max(np.abs(events.energy_residual.values / released)))
    remedy = "work, storage and losses of an event do not balance: lower --step-safety"
    metrics["event_energy_residual"] = Metric(
        closed, "1", CLOSED, closed < CLOSED, note="greatest, over what the spring released", remedy=remedy
    )
    share = events.dissipated_energy.sum("event") / events.dissipated_energy.sum()
    for effect, value in zip(share.effect.values, share.values, strict=True):
        metrics[f"dissipated_by_{effect}"] = Metric(float(value), "1", note="share of what the events dissipated")
    kinetic = float(np.mean(events.peak_kinetic_energy.values / released))
    metrics["peak_kinetic_share"] = Metric(kinetic, "1", note="mean greatest kinetic energy over what was released")
    return metrics


def _sizes(events: xarray.Dataset) -> dict[str, Metric]:
    """The b-value of the drops, where there are enough events of different size."""
    try:
        found = lsm.statistics.b_value(np.log10(events.stress_drop.values))
    except lsm.InputError as error:
        return {"b_value": Metric(None, "1", note=f"unknown, of log10 of the drops in Pa: {error}")}
    words = "slope of the numbers of events against the decimal logarithm of their drop"
    return metrics_of_value("b_value", found.b, "1", words)


def write_events(out: Path, events: xarray.Dataset, params: Params) -> None:
    """Write events.nc."""
    title = "Slip events of a layer that a spring pulls"
    summary = "One row per event: times, drop, slip, and where the energy went that the spring released."
    write_result(out / FILE, events, params, title, summary)


def _conclude(dataset: xarray.Dataset, params: Params, out: Path) -> dict[str, Metric]:
    """Events, files and pictures of a run whose rows are all written."""
    events = events_of(dataset, params)
    write_events(out, events, params)
    plot_run(out, params.format)
    plot_stick_slip(out / f"events.{params.format}", dataset, events, params.spring or 0.0, params.area)
    return analyse(events, params) | quality_metrics(dataset, params)


STICK_SLIP = LayerExperiment("stick-slip", _conclude, longer=frozenset({"strain"}))
RESUMABLE = STICK_SLIP.resumable  # parameters that may change in a run that goes on
check, estimate = layer_scene.check, layer_cost  # as of every layer


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """As `shear_gouge.run`; writes run.nc, grains.nc, events.nc, run.png, events.png, summary.json; returns run.nc."""
    check(params)
    return run_layer(STICK_SLIP, None, params, out, progress, existing)
