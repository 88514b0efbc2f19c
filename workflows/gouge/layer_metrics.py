"""Metrics of the steady state of a sheared layer, with the bounds claimed for them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_estimate
from workflows.gouge.layer_parameters import LayerParams
from workflows.gouge.parameters import Params
from workflows.gouge.staged_metrics import stage_metrics
from workflows.protocol.stage_tables import RESERVED

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
STEADY = {"layer_thickness": "m", "porosity": "1", "coordination_number": "1", "sliding_fraction": "1"}  # units
NOTES = {
    "energy_residual": "greatest energy residual over the throughput of work",
    "sliding_fraction": "contacts at the limit of friction, or of rate-and-state friction at V_0 or faster",
}
PLAIN = str.maketrans("", "", "[]'")  # a list of labels as text
NO_STIFFNESS = "unknown: none of the effects has a stiffness"


def analyse(dataset: xarray.Dataset, params: Params) -> dict[str, Metric]:
    """Metrics of the steady state, as `docs/conventions.md` defines them.

    Parameters
    ----------
    dataset
        The file run.nc of a run.
    params
        Of that run.
    """
    sheared = sheared_rows(dataset)
    if params.staged:
        return stage_metrics(sheared) | quality_metrics(dataset, params)
    steady = sheared.isel(time=sheared.shear_strain.values >= params.steady_from)
    friction = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, params.steady_from)
    platen = lsm.statistics.steady_ratio(sheared.platen_shear_stress, sheared.platen_normal_stress, params.steady_from)
    target = float(steady.servo_stress.mean()) if "servo_stress" in steady else params.normal_stress
    normal = float(steady.platen_normal_stress.mean()) / target - 1.0
    rms = float(np.sqrt((steady.platen_normal_rms**2).mean())) / target
    apart = abs(platen.mean / friction.mean - 1.0)

    def estimate(name: str) -> lsm.statistics.Estimate:
        return lsm.statistics.steady_state(sheared[name], params.steady_from)

    metrics = {
        **metrics_of_estimate("friction_mean", "friction_se", friction),
        "friction_ess": Metric(friction.effective_samples, "1"),
        "platen_friction_mean": mean_metric(platen, "1"),
        "platen_bulk_difference": Metric(apart, "1"),
        "consolidation_share": Metric(float(sheared.time[0] / dataset.time[-1]), "1"),
        "inertial_number": Metric(float(steady.inertial_number.mean()), "1"),
        "stiffness_number": stiffness_metric(dataset),
        "energy_residual": residual_metric(sheared),
        "normal_stress_error": Metric(normal, "1"),
        "normal_stress_rms": Metric(rms, "1"),
        **{name: mean_metric(estimate(name), unit, NOTES.get(name)) for name, unit in STEADY.items()},
        "deepest_overlap": Metric(float(dataset.deepest_overlap.max()), "1"),
    }
    metrics |= _breakage(sheared) | _spring(params)
    return metrics | {name: claimed(name, metrics[name]) for name in BOUNDS}


def quality_metrics(dataset: xarray.Dataset, params: LayerParams) -> dict[str, Metric]:
    """What every run through stages tells beside its results: how far it went, its contacts, budget and spring."""
    sheared, cycles = sheared_rows(dataset), int(dataset.cycle.max())
    words = "repetitions of the stages that are repeated"
    return {
        **({"cycles": Metric(cycles, "1", note=words)} if cycles else {}),
        "shear_strain": Metric(float(sheared.shear_strain[-1]), "1", note="of all stages"),
        "stiffness_number": stiffness_metric(dataset),
        "energy_residual": claimed("energy_residual", residual_metric(sheared)),
        "deepest_overlap": Metric(float(dataset.deepest_overlap.max()), "1"),
        **_breakage(sheared),
        **_spring(params),
    }


def residual_metric(sheared: xarray.Dataset) -> Metric:
    """Greatest energy residual since shear began, over the throughput of work."""
    residual = np.abs(sheared.energy_residual - sheared.energy_residual[0]).max()
    return Metric(float(residual / sheared.work_throughput[-1]), "1")


def stiffness_metric(dataset: xarray.Dataset) -> Metric:
    """Stiffness number of the contacts, or why it is unknown."""
    number = float(dataset.stiffness_number)
    return Metric(number, "1", note=None if np.isfinite(number) else NO_STIFFNESS)


def claimed(
    name: str, metric: Metric, bounds: Mapping[str, float] = BOUNDS, remedies: Mapping[str, str] = REMEDIES
) -> Metric:
    """A metric with the bound that is claimed for it, and what to do where it does not hold."""
    value, bound = float(metric.value or 0.0), bounds[name]
    return Metric(value, "1", bound, abs(value) < bound, note=metric.note or NOTES.get(name), remedy=remedies[name])


def mean_metric(estimate: lsm.statistics.Estimate, unit: str, note: str | None = None) -> Metric:
    """A mean with its 95 % interval, or why that is unknown."""
    known = np.isfinite(estimate.standard_error)
    notes = (note or "", "" if known else f"interval unknown: {estimate.unknown}")
    said = "; ".join(filter(None, notes))
    return Metric(float(estimate.mean), unit, interval=estimate.interval if known else None, note=said)


def sheared_rows(dataset: xarray.Dataset) -> xarray.Dataset:
    """The rows of run.nc since shear began: of all stages but those of the start and the consolidation."""
    return dataset.isel(time=~np.isin(dataset.stage.values, RESERVED))


def worst_claims(runs: Mapping[str, Mapping[str, float]], names: Collection[str] = tuple(BOUNDS)) -> dict[str, Metric]:
    """What single runs claim, as metrics of their experiment: the values farthest from 0, and which runs have them.

    Parameters
    ----------
    runs
        Label of a run -> its values of these metrics; nan if it has none.
    names
        Of the metrics, some of those in BOUNDS.
    """
    found = {}
    for name, bound in ((name, BOUNDS[name]) for name in names):
        sizes = {label: abs(float(values[name])) for label, values in runs.items() if np.isfinite(values[name])}
        worst = max(sizes, key=lambda label: sizes[label], default=None)
        if worst is None:
            found[f"{name}_max"] = Metric(None, "1", note="no complete run")
            continue
        above = [label for label, size in sizes.items() if not size < bound]
        note = f"largest of all runs, of {worst}" if len(above) < 2 else f"largest of all runs; above in {above}"
        size = sizes[worst]
        remedy = f"run {', '.join(above)}: {REMEDIES[name]}"
        found[f"{name}_max"] = Metric(size, "1", bound, size < bound, note=note.translate(PLAIN), remedy=remedy)
    return found


def _breakage(sheared: xarray.Dataset) -> dict[str, Metric]:
    """What has become of breakable grains at the end; {} for whole ones."""
    if "bond_count" not in sheared:
        return {}
    bonds, fragments = sheared.bond_count.values, sheared.fragment_count.values
    return {
        "bonds": Metric(int(bonds[-1]), "1", note="that have not broken at the end"),
        "fragments": Metric(int(fragments[-1]), "1", note="grains, pieces and groups of bonded pieces at the end"),
        "bonds_broken": Metric(
            1.0 - float(bonds[-1]) / int(bonds[0]) if bonds[0] else float("nan"),
            "1",
            note="share since shear began" if bonds[0] else "unknown: no bond was left when shear began",
        ),
    }


def _spring(params: LayerParams) -> dict[str, Metric]:
    """The spring of the load point in its three units, beside the contacts and the area; {} at an imposed velocity."""
    p = params
    if p.spring is None:
        return {}
    return {
        "load_stiffness": Metric(p.spring, "N m-1", note="of the spring that pulls the top platen"),
        "load_stiffness_area": Metric(p.spring / p.area, "Pa m-1", note="the same over the area of the layer"),
        "load_stiffness_ratio": Metric(p.spring / p.shear_stiffness, "1", note="over the shear stiffness of the layer"),
        "spring_period": Metric(p.spring_period, "1", note="about, of the top platen on the spring, in inertial times"),
        "contact_stiffness": Metric(p.stiffness, "N m-1", note="normal stiffness of a contact"),
        "layer_area": Metric(p.area, "m2", note="along the shear"),
    }
