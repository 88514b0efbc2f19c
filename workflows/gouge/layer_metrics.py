"""Metrics of the steady state of a sheared layer, with the bounds claimed for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_estimate
from workflows.gouge.parameters import Params

if TYPE_CHECKING:
    import xarray

BOUNDS = {  # claimed for the absolute values of these metrics
    "platen_bulk_difference": 0.02,
    "energy_residual": 0.01,
    "normal_stress_error": 0.005,
    "normal_stress_rms": 0.05,
}
REMEDIES = {  # what it means if such a claim does not hold, and what to change
    "platen_bulk_difference": (
        "the layer is not steady, or too thin to have a bulk: raise --strain, --steady-from or --layer-thickness"
    ),
    "energy_residual": "work, storage and losses do not balance: lower --step-safety, or use --precision f64",
    "normal_stress_error": (
        "the servo did not hold the stress on average: lower --inertial-number, or raise --strain or --length"
    ),
    "normal_stress_rms": "the normal stress fluctuates: lower --inertial-number, or raise --length",
}


def analyse(dataset: xarray.Dataset, params: Params) -> dict[str, Metric]:
    """Metrics of the steady state, as `docs/conventions.md` defines them.

    Parameters
    ----------
    dataset
        The file run.nc of a run.
    params
        Of that run.
    """
    sheared = dataset.isel(time=dataset.stage.values == "shear")
    steady = sheared.isel(time=sheared.shear_strain.values >= params.steady_from)
    friction = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, params.steady_from)
    platen = lsm.statistics.steady_ratio(sheared.platen_shear_stress, sheared.platen_normal_stress, params.steady_from)
    residual = np.abs(sheared.energy_residual - sheared.energy_residual[0]).max() / sheared.work_throughput[-1]
    normal = float(steady.platen_normal_stress.mean()) / params.normal_stress - 1.0
    rms = float(np.sqrt((steady.platen_normal_rms**2).mean())) / params.normal_stress
    apart = abs(platen.mean / friction.mean - 1.0)
    metrics = {
        **metrics_of_estimate("friction_mean", "friction_se", friction),
        "friction_ess": Metric(friction.effective_samples, "1"),
        "platen_friction_mean": Metric(platen.mean, "1"),
        "platen_bulk_difference": Metric(apart, "1"),
        "consolidation_share": Metric(float(sheared.time[0] / dataset.time[-1]), "1"),
        "inertial_number": Metric(float(steady.inertial_number.mean()), "1"),
        "stiffness_number": Metric(float(dataset.stiffness_number), "1"),
        "energy_residual": Metric(float(residual), "1"),
        "normal_stress_error": Metric(normal, "1"),
        "normal_stress_rms": Metric(rms, "1"),
        "layer_thickness": Metric(float(steady.layer_thickness.mean()), "m"),
        "porosity": Metric(float(steady.porosity.mean()), "1"),
        "coordination_number": Metric(float(steady.coordination_number.mean()), "1"),
        "sliding_fraction": Metric(float(steady.sliding_fraction.mean()), "1"),
        "deepest_overlap": Metric(float(dataset.deepest_overlap.max()), "1"),
    }
    for name, bound in BOUNDS.items():
        value = float(metrics[name].value or 0.0)
        metrics[name] = Metric(value, "1", bound, abs(value) < bound, remedy=REMEDIES[name])
    return metrics
