"""Means of steady shear with honest standard errors; plain functions on xarray objects."""

import math
from typing import NamedTuple

import numpy as np

# Fewer samples do not show their own correlation, so that every error made from them would be a guess.
LEAST_SAMPLES = 10


class Estimate(NamedTuple):
    """A mean with its standard error, both in the unit of the series.

    effective_samples: number of independent samples that would give the same error; for replicas their
    number, nan for a difference. Below about 20 the error itself is uncertain and tends to be too small.
    """

    mean: float
    standard_error: float
    effective_samples: float = math.nan


def steady_state(series, from_strain=1.0):
    """Mean of a series from a shear strain on, with a standard error that respects autocorrelation.

    series: DataArray (time,), evenly sampled, that carries the coordinate `shear_strain` [1], such as
    `ds.friction` of a run file. The error is std / sqrt(effective sample size), the latter from the
    autocorrelation (Geyer's sequences on the split chain; Vehtari et al. 2021, doi:10.1214/20-BA1221).
    A constant series has the error 0 and all samples count.
    Raises ValueError for another dimension, a missing coordinate, values that are not finite, or fewer than
    10 samples from that strain on.
    """
    return _estimate(_samples(series, from_strain))


def steady_ratio(numerator, denominator, from_strain=1.0):
    """Ratio of the steady means of two series, such as shear stress over normal stress.

    numerator, denominator: as the series of `steady_state`, on the same times. By the delta method the error
    is that of the mean of numerator - ratio * denominator, over abs(mean denominator); effective_samples is
    that of this residual series. Raises ValueError as `steady_state`, and if the denominator's mean is 0.
    """
    same_times = numerator.sizes == denominator.sizes and np.array_equal(numerator.time, denominator.time)
    if not same_times:
        raise ValueError(f"{numerator.name} and {denominator.name}: not on the same times")
    top, bottom = _samples(numerator, from_strain), _samples(denominator, from_strain)
    if bottom.mean() == 0:
        raise ValueError(f"{denominator.name}: the mean is 0, no ratio exists")
    ratio = top.mean() / bottom.mean()
    residual = _estimate(top - ratio * bottom)
    error = residual.standard_error / abs(bottom.mean())
    return Estimate(float(ratio), float(error), residual.effective_samples)


def combine_replicas(means, standard_errors=None):
    """Mean over replicas (same parameters, other seeds), the replica as the unit.

    means: n values; standard_errors: the n errors of the single runs. The error is std(means, ddof=1) over
    sqrt(n), so that it contains what differs between packings; it has n - 1 degrees of freedom (Student's t
    for intervals). One replica says nothing about the others: n = 1 takes the run's own error.
    Raises ValueError if a mean is missing or not finite, the counts differ, or n = 1 comes without its error.
    """
    means = np.asarray(means, dtype=float)
    if means.ndim != 1 or means.size == 0 or not np.isfinite(means).all():
        raise ValueError(f"means: {means}, a list of at least one finite number is needed")
    if standard_errors is not None and np.shape(standard_errors) != means.shape:
        raise ValueError(f"standard_errors: shape {np.shape(standard_errors)}, means have {means.shape}")
    if means.size > 1:
        error = means.std(ddof=1) / math.sqrt(means.size)
        return Estimate(float(means.mean()), float(error), float(means.size))
    if standard_errors is None:
        raise ValueError("standard_errors: needed for a single replica")
    return Estimate(float(means[0]), float(standard_errors[0]), 1.0)


def difference(a, b):
    """Estimate a minus estimate b of independent runs: the error is sqrt(se_a^2 + se_b^2)."""
    return Estimate(a.mean - b.mean, math.hypot(a.standard_error, b.standard_error))


def _samples(series, from_strain):
    """Values of the series from this strain on, as float64; see `steady_state` for what is refused."""
    name = series.name or "series"
    if series.dims != ("time",):
        raise ValueError(f"{name}: dimensions {series.dims}, allowed is ('time',)")
    if "shear_strain" not in series.coords:
        there = ", ".join(map(str, series.coords))
        raise ValueError(f"{name}: has no coordinate shear_strain; there are {there}")
    strain = np.asarray(series.shear_strain, dtype=float)
    if not np.isfinite(strain).all():
        raise ValueError(f"{name}: shear_strain is not finite at {np.sum(~np.isfinite(strain))} samples")
    values = np.asarray(series, dtype=float)[strain >= from_strain]
    if values.size < LEAST_SAMPLES:
        reached = f"strain {strain.max():g}" if strain.size else "no sample"
        raise ValueError(
            f"{name}: {values.size} samples from strain {from_strain:g} on, at least "
            f"{LEAST_SAMPLES} are needed; the run reached {reached}"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{name}: {np.sum(~np.isfinite(values))} of {values.size} samples are not finite")
    return values


def _estimate(values):
    if np.ptp(values) == 0:
        return Estimate(float(values[0]), 0.0, float(values.size))
    from arviz_stats.base import array_stats

    effective = float(array_stats.ess(values[np.newaxis], method="mean"))
    return Estimate(float(values.mean()), float(values.std(ddof=1) / math.sqrt(effective)), effective)
