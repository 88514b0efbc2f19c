"""Emulators: Gaussian processes that give the metrics of runs that were not made, with what is not known of them.

A metric y of a run at parameters u (in the unit cube of the prior) is f(u) + e. The mean f over all seeds is a Gaussian
process of Matern's kernel with smoothness 5/2 and one length per parameter; e has the variance of the run's own
standard error, which is known, and a scatter between runs, which is learned (Rasmussen and Williams 2006, chapter 2 and
section 5.4; Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294, for calibration with them).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_lsm.core.errors import SimulationError
from workflows.calibrate.samples import Sample, variances_within
from workflows.common.libraries import library

SHORTEST = 2.0  # length of the kernel over the distance between runs: what is finer than they are is scatter to them
LONGEST = 20.0  # length, in widths of the prior
SIZES = (0.05, 50.0)  # variance of f over that of the metrics of all runs
SCATTERS = (1e-6, 2.0)  # variance between runs, likewise
RESTARTS = 4  # of the search for the likeliest kernel
AT_ONCE = 2**14  # points that are predicted together, which bounds the memory


@dataclass(frozen=True)
class Predicted:
    """What emulators give at points.

    Attributes
    ----------
    mean
        (n, m) means over all seeds.
    variance
        (n, m) variances of these means: what the emulators do not know.
    """

    mean: NDArray
    variance: NDArray


@dataclass(frozen=True)
class Emulators:
    """One emulator for each metric, from the same runs.

    Attributes
    ----------
    metrics
        Their names, in the order of all columns.
    processes
        Fitted regressors of scikit-learn, of metrics that are moved to the mean 0 and the deviation 1.
    centre, width
        (m,) mean and deviation of the metrics of the runs.
    scatter
        (m,) standard deviation between runs of the same parameters, beyond their own errors.
    within
        (m,) root mean square of the standard errors within the runs; 0 where none is known.
    correlation
        (m, m) of what differs between a run and the emulators, see `correlation_of`.
    freedom
        (m,) degrees of freedom from which the scatter is known: runs less those that the surface takes up.
    residuals
        (runs, m) of each run from what the emulators of the others predict, in predicted deviations.
    """

    metrics: tuple[str, ...]
    processes: tuple[Any, ...]
    centre: NDArray
    width: NDArray
    scatter: NDArray
    within: NDArray
    correlation: NDArray
    freedom: NDArray
    residuals: NDArray

    def predict(self, shares: NDArray) -> Predicted:
        """Means and variances at points (n, d) of the unit cube."""
        mean, variance = np.empty((2, len(shares), len(self.metrics)))
        for column, process in enumerate(self.processes):
            noise = _noise(process)
            for start in range(0, len(shares), AT_ONCE):
                rows = slice(start, start + AT_ONCE)
                means, deviations = process.predict(shares[rows], return_std=True)
                mean[rows, column] = means
                # The regressor adds the scatter of one run to its variance; a mean over seeds has none.
                variance[rows, column] = np.maximum(deviations**2 - noise, 0.0)
        return Predicted(self.centre + self.width * mean, self.width**2 * variance)

    def covariance(self, column: int, shares: NDArray) -> NDArray:
        """(n, n) covariance of the mean of one metric between points (n, d)."""
        process = self.processes[column]
        _, covariance = process.predict(shares, return_cov=True)
        return self.width[column] ** 2 * (covariance - _noise(process) * np.eye(len(shares)))


def emulators_of(shares: NDArray, samples: Sequence[Sample], metrics: Sequence[str], seed: int) -> Emulators:
    """Emulators of these metrics.

    Parameters
    ----------
    shares, samples
        (n, d) points of the unit cube, and the run at each, which has all the metrics.
    metrics
        Names.
    seed
        Of the starts of the search.

    Raises
    ------
    InputError
        If scikit-learn is not installed.
    SimulationError
        If there are fewer runs than 2 d + 2.
    """
    least = 2 * shares.shape[1] + 2
    if len(samples) < least:
        raise SimulationError(
            f"calibrate: {len(samples)} runs gave all targets, at least {least} are needed for {shares.shape[1]} "
            "parameters; raise calibrate.runs, or see why the others gave none"
        )
    values = np.array([[sample.metrics[name] for name in metrics] for sample in samples])
    errors = np.stack([variances_within(samples, name) for name in metrics], axis=1)
    centre, width = values.mean(axis=0), values.std(axis=0)
    width = np.where(width > 0.0, width, 1.0)  # a metric that is the same in all runs has no width
    known = errors / width**2
    standard = (values - centre) / width
    processes = tuple(_fitted(shares, standard[:, i], known[:, i], seed) for i in range(len(metrics)))
    residuals = np.stack([_left_out(p, shares, standard[:, i], known[:, i]) for i, p in enumerate(processes)], axis=1)
    scatter = width * np.sqrt([_noise(process) for process in processes])
    within = np.sqrt(errors.mean(axis=0))
    freedom = np.array([_freedom(p, shares, known[:, i]) for i, p in enumerate(processes)])
    correlation = correlation_of(residuals)
    return Emulators(tuple(metrics), processes, centre, width, scatter, within, correlation, freedom, residuals)


def _fitted(shares: NDArray, values: NDArray, errors: NDArray, seed: int) -> Any:
    """The likeliest process of standardised values whose errors have these variances."""
    gaussian = library("sklearn.gaussian_process", "calibrate")
    kernels = library("sklearn.gaussian_process.kernels", "calibrate")
    of_warnings = library("sklearn.exceptions", "calibrate")
    count, dimension = shares.shape
    shortest = min(1.0, SHORTEST * count ** (-1.0 / dimension))
    kernel = kernels.ConstantKernel(1.0, SIZES) * kernels.Matern(np.ones(dimension), (shortest, LONGEST), nu=2.5)
    kernel += kernels.WhiteKernel(0.1, SCATTERS)
    process = gaussian.GaussianProcessRegressor(
        kernel, alpha=errors + 1e-10, n_restarts_optimizer=RESTARTS, random_state=seed
    )
    with warnings.catch_warnings():  # a length or a scatter at the end of its range is what was found
        warnings.simplefilter("ignore", of_warnings.ConvergenceWarning)
        return process.fit(shares, values)


def _noise(process: Any) -> float:
    """Variance between runs that a process has learned."""
    return float(process.kernel_.k2.noise_level)


def _freedom(process: Any, shares: NDArray, errors: NDArray) -> float:
    """Runs less the trace of the matrix that takes their values to the emulated means (Hastie and Tibshirani 1990)."""
    covariance = process.kernel_.k1(shares)
    smoother = np.linalg.solve(covariance + np.diag(errors + _noise(process)), covariance)
    return float(len(shares) - np.trace(smoother))


def _left_out(process: Any, shares: NDArray, values: NDArray, errors: NDArray) -> NDArray:
    """(n,) deviation of each value from its prediction by all others, in predicted standard deviations.

    With K the covariance of the values these are (K^-1 y)_i/sqrt((K^-1)_ii): Rasmussen and Williams (2006), eq. 5.12.
    """
    inverse = np.linalg.inv(process.kernel_(shares) + np.diag(errors + 1e-10))
    return inverse @ values / np.sqrt(np.diag(inverse))


def correlation_of(residuals: NDArray) -> NDArray:
    """(m, m) correlation between the metrics of what the emulators did not predict of the runs.

    A run that is denser than others of its parameters has more contacts as well: its metrics are not so many
    independent measurements. Shrunk as Ledoit and Wolf (2004), doi:10.1016/S0047-259X(03)00096-4.
    """
    if residuals.shape[1] == 1:
        return np.ones((1, 1))
    covariance = library("sklearn.covariance", "calibrate").LedoitWolf(assume_centered=True).fit(residuals).covariance_
    deviations = np.sqrt(np.diag(covariance))
    return covariance / np.outer(deviations, deviations)
