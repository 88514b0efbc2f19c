"""Metrics of the steady state of a sheared cell, with the bounds claimed for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.cell.parameters import CellParams
from workflows.common.metrics import Metric, metrics_of_estimate
from workflows.gouge.layer_metrics import NOTES, claimed, mean_metric, residual_metric, sheared_rows, stiffness_metric

if TYPE_CHECKING:
    import xarray

BOUNDS = {  # claimed for the absolute values of these metrics
    "energy_residual": 1e-3,
    "normal_stress_error": 0.01,
    "normal_stress_rms": 0.05,
}
OF_STRESS = ("normal_stress_error", "normal_stress_rms")  # of cells whose normal stress is held
REMEDIES = {  # what it means if such a claim does not hold, and what to change
    "energy_residual": "work, storage and losses do not balance: lower --step-safety, or use --precision f64",
    "normal_stress_error": "the height did not keep the stress on average: lower --inertial-number, or raise --strain",
    "normal_stress_rms": "the normal stress fluctuates: lower --inertial-number, or raise --length",
}
STEADY = {"cell_height": "m", "porosity": "1", "coordination_number": "1", "sliding_fraction": "1"}  # units


def analyse(dataset: xarray.Dataset, params: CellParams) -> dict[str, Metric]:
    """Metrics of the steady state, as `docs/shear-cell.md` defines them.

    Parameters
    ----------
    dataset
        The file run.nc of a run.
    params
        Of that run.
    """
    sheared = sheared_rows(dataset)
    steady = sheared.isel(time=sheared.shear_strain.values >= params.steady_from)
    friction = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, params.steady_from)
    normal = float(steady.cell_normal_stress.mean())
    # The inertial number of the stress that there was: that of constant volume is what the grains make it.
    rate = float(steady.inertial_number.mean()) * float(np.sqrt(params.normal_stress / normal))

    def estimate(name: str) -> lsm.statistics.Estimate:
        return lsm.statistics.steady_state(sheared[name], params.steady_from)

    filled = estimate("porosity")
    metrics = {
        **metrics_of_estimate("friction_mean", "friction_se", friction),
        "friction_ess": Metric(friction.effective_samples, "1"),
        "solid_fraction": Metric(1.0 - float(filled.mean), "1", note="share of the cell filled by grains"),
        "normal_stress_ratio": Metric(
            float(steady.normal_stress_along.mean()) / float(steady.normal_stress.mean()),
            "1",
            note="normal stress along the shear over that across it",
        ),
        "consolidation_share": Metric(float(sheared.time[0] / dataset.time[-1]), "1"),
        "inertial_number": Metric(rate, "1", note="of the mean normal stress"),
        "stiffness_number": stiffness_metric(dataset),
        "energy_residual": residual_metric(sheared),
        **{name: mean_metric(estimate(name), unit, NOTES.get(name)) for name, unit in STEADY.items()},
        "deepest_overlap": Metric(float(dataset.deepest_overlap.max()), "1"),
    }
    if params.solid_fraction:
        metrics["normal_stress"] = mean_metric(estimate("cell_normal_stress"), "Pa", "that the grains bear")
    else:
        rms = float(np.sqrt((steady.cell_normal_rms**2).mean())) / params.normal_stress
        metrics["normal_stress_error"] = Metric(normal / params.normal_stress - 1.0, "1")
        metrics["normal_stress_rms"] = Metric(rms, "1", note="of every step")
    return metrics | {name: claimed(name, metrics[name], BOUNDS, REMEDIES) for name in BOUNDS if name in metrics}
