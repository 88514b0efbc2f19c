"""summary.json of a calibration: parameters with their errors, and how far each target is from what they give."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from workflows.calibrate.loop import Calibration
from workflows.calibrate.posterior import misfits_of, variances_of
from workflows.calibrate.study import Study
from workflows.common.metrics import Metric
from workflows.common.parameter_coordinates import RENAMED, unit_and_name

LEVEL = 0.95  # of intervals


def metrics_of(study: Study, found: Calibration) -> dict[str, Metric]:
    """Metrics of a calibration.

    Of each parameter `NAME`, the mean of its posterior with the interval that leaves 2.5 % on either side, and
    `NAME_error`, its standard deviation. Of each target `METRIC_fitted`, what the likeliest parameters give, and
    `METRIC_misfit`, the target less that over their errors together.
    """
    posterior, problem = found.posterior, study.problem
    metrics: dict[str, Metric] = {}
    for i, prior in enumerate(problem.priors):
        values = prior.at(posterior.shares[:, i])
        unit, _ = unit_and_name(type(study.base), prior.name)
        mean, deviation = posterior.mean_and_deviation(values)
        name = RENAMED.get(prior.name, prior.name)  # as in all files: friction is a measured quantity
        metrics[name] = Metric(mean, unit, interval=interval_of(values, posterior.weights))
        metrics[f"{name}_error"] = Metric(deviation, unit)
    own, apart = variances_of(found.emulators, problem.targets)
    units = {name: unit for sample in found.samples for name, unit in sample.units.items()}
    best = posterior.best
    for i, target in enumerate(problem.targets):
        fitted, variance = posterior.predicted.mean[best, i], posterior.predicted.variance[best, i]
        unit = units.get(target.metric, "1")
        metrics[f"{target.metric}_target"] = Metric(target.value, unit)
        metrics[f"{target.metric}_fitted"] = Metric(float(fitted), unit, note="at the likeliest parameters")
        misfit = (target.value - fitted) / math.sqrt(variance + own[i] + apart[i])
        metrics[f"{target.metric}_misfit"] = Metric(float(misfit), "1", note="target less that, in errors")
        scatter = float(found.emulators.scatter[i])
        metrics[f"{target.metric}_scatter"] = Metric(scatter, unit, note="between seeds, beyond the errors of runs")
        missed = float(np.sqrt(np.mean(found.emulators.residuals[:, i] ** 2)))
        metrics[f"{target.metric}_emulator_check"] = Metric(
            missed, "1", note="of runs from what the others predict, in predicted deviations: about 1"
        )
    squares, _ = misfits_of(posterior.predicted, found.emulators, problem.targets)
    metrics["misfit"] = Metric(float(np.sqrt(squares.min())), "1", note="of all targets together, in errors")
    given = sum(sample.has(problem.metrics) for sample in found.samples)
    metrics["runs"] = Metric(len(found.samples), "1")
    metrics["used"] = Metric(given, "1", note="runs that gave all targets")
    metrics["effective_draws"] = Metric(posterior.effective, "1", note="independent points of the posterior")
    return metrics


def interval_of(values: NDArray, weights: NDArray) -> tuple[float, float]:
    """(least, greatest) of the interval that leaves 2.5 % of weighted values (n,) on either side."""
    order = np.argsort(values)
    mass = np.cumsum(weights[order])
    ends = np.searchsorted(mass, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0]).clip(0, len(values) - 1)
    low, high = values[order][ends]
    return float(low), float(high)
