"""Compress a layer without shear, level by level, and measure where its grains yield: the oedometer test.

The layer is periodic along its platens, so that it cannot widen. It is consolidated under the normal stress P, which
then rises in equal ratios. Void ratio against the logarithm of the stress is flat until grains break, and falls then.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from taichi_lsm.statistics import Estimate
from workflows.common.metrics import Metric, metrics_of_value
from workflows.common.reports import Progress
from workflows.common.run_folder import Existing
from workflows.gouge import layer_scene
from workflows.gouge.compression import NeverYields, levels_of, write_levels, yield_of
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.layer_metrics import quality_metrics
from workflows.gouge.layer_parameters import SPRINGS, LayerParams
from workflows.gouge.layer_run import LayerExperiment, run_layer
from workflows.plots.oedometer import plot_oedometer
from workflows.plots.run_plots import plot_run
from workflows.protocol.stage_tables import Sample, StageTable, Until

if TYPE_CHECKING:
    import xarray

LEAST_ROWS = 4  # of a level
BREAKABLE = {"shape": "angular", "breakable": True, "bond_strength": 60.0, "stiffness_number": 1e4}


class Params(LayerParams):
    """A layer that is compressed level by level."""

    stress_ratio: float = Field(
        default=30.0, ge=2, le=1e3, description="normal stress of the last level over P, that of the consolidation [1]"
    )
    levels: int = Field(
        default=12, ge=3, le=200, description="levels of the normal stress above P, in equal ratios [1]"
    )
    level_time: float = Field(
        default=20.0, ge=1, le=1e6, description="time of a level, in the first half of which the stress rises [t_i]"
    )
    row_time: float = Field(default=1.0, ge=0.01, le=1e4, description="time from row to row of run.nc [t_i]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            **BREAKABLE,
            "length": 8.0,
            "layer_thickness": 8.0,
            "width": 4.0,
            "pieces": 4,
            "levels": 7,
            "level_time": 6.0,
            "step_safety": 0.6,
        },
        "demo": {**BREAKABLE, "length": 16.0, "layer_thickness": 10.0, "levels": 8, "level_time": 10.0},
        "standard": {**BREAKABLE},
        "reference": {**BREAKABLE, "length": 60.0, "pieces": 20, "stiffness_number": 3e4, "levels": 24},
    }

    def shear_tables(self) -> list[StageTable]:
        """The levels; nothing is sheared."""
        rise = {"ramp": 0.5 * self.level_time, "velocity": 0.0}
        rows = {"until": Until(time=self.level_time), "sample": Sample(time=self.row_time)}
        stresses = self.stress_ratio ** (np.arange(1, self.levels + 1) / self.levels)
        return [
            StageTable(name=f"level-{k}", normal_stress=float(stress), **rise, **rows)
            for k, stress in enumerate(stresses, start=1)
        ]

    def problems_of_shear(self) -> Iterator[str]:
        """Contacts too soft for the last level, a spring behind the servo, and too few rows."""
        least = self.least_stiffness_number * self.stress_ratio
        if self.shape == "angular" and self.stiffness_number < least and not self.effects:
            yield (
                f"--stiffness-number {self.stiffness_number:g} must be >= {least:.4g} with --stress-ratio "
                f"{self.stress_ratio:g} and --corner-radius {self.corner_radius:g}, or overlaps exceed a tenth of what "
                "corners can carry; raise it, or lower --stress-ratio"
            )
        if self.normal_stiffness:
            yield f"--normal-stiffness {self.normal_stiffness:g}: would keep the stress from its levels; leave it out"
        if self.level_time < LEAST_ROWS * self.row_time:
            yield (
                f"--row-time {self.row_time:g}: must be <= {self.level_time / LEAST_ROWS:g}, a quarter of --level-time "
                f"{self.level_time:g}; lower it"
            )

    def idle(self) -> dict[str, str]:
        """As of the layer; and what belongs to shear."""
        shear = (*SPRINGS, "inertial_number", "rows_per_strain")
        found = super().idle() | dict.fromkeys(shear, "in an oedometer, where nothing is sheared")
        return found | {"snapshots": "in an oedometer, where each level ends with a snapshot"}

    @property
    def sheared(self) -> bool:
        """No."""
        return False


def analyse(levels: xarray.Dataset, params: Params) -> dict[str, Metric]:
    """Metrics of the levels, in docs/breakable-grains.md."""
    stress, ratio = levels.normal_stress.values, levels.void_ratio.values
    metrics = {
        "void_ratio_before": Metric(float(ratio[0]), "1", note="after the consolidation"),
        "void_ratio_after": Metric(float(ratio[-1]), "1", note=f"under {stress[-1] / 1e6:.3g} MPa"),
    }
    words = "two straight lines of the void ratio against the decimal logarithm of the stress"
    try:
        found = yield_of(levels)
    except NeverYields as error:
        return metrics | {"yield_stress": Metric(None, "Pa", note=f"unknown: {error}")}
    yields = 10.0**found.meeting.mean
    at_yield = found.meeting._replace(mean=yields, standard_error=np.log(10.0) * yields * found.meeting.standard_error)
    words_beyond = "fall of the void ratio per decade of the stress, beyond yield"
    return {
        **metrics,
        **metrics_of_value("yield_stress", at_yield, "Pa", f"where {words} meet"),
        **metrics_of_value(
            "yield_ratio",
            scaled(at_yield, 1.0 / (params.bond_strength * params.normal_stress)),
            "1",
            "the same over the strength of bonds",
        ),
        **metrics_of_value("compression_index", scaled(found.after, -1.0), "1", words_beyond),
        **metrics_of_value("elastic_index", scaled(found.before, -1.0), "1", "the same before yield"),
    }


def scaled(found: Estimate, factor: float) -> Estimate:
    """The estimate of a multiple."""
    return found._replace(mean=factor * found.mean, standard_error=abs(factor) * found.standard_error)


def _conclude(dataset: xarray.Dataset, params: Params, out: Path) -> dict[str, Metric]:
    """Levels, files and pictures of a run whose rows are all written."""
    levels = levels_of(dataset)
    write_levels(out, levels, params)
    plot_run(out, params.format)
    plot_oedometer(out / f"compression.{params.format}", dataset, levels)
    return analyse(levels, params) | quality_metrics(dataset, params)


OEDOMETER = LayerExperiment("oedometer", _conclude)
RESUMABLE = OEDOMETER.resumable  # parameters that may change in a run that goes on
check, estimate = layer_scene.check, layer_cost  # as of every layer


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """As `shear_gouge.run`; writes run.nc, grains.nc, compression.nc, their pictures, summary.json; returns run.nc."""
    check(params)
    return run_layer(OEDOMETER, None, params, out, progress, existing)
