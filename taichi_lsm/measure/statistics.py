"""Means of steady shear with honest standard errors; plain functions on xarray objects."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError

if TYPE_CHECKING:
    from xarray import DataArray

__all__ = ["Estimate", "combine_replicas", "difference", "steady_ratio", "steady_state"]

__all__ = ["Estimate", "combine_replicas", "difference", "steady_ratio", "steady_state"]

# Fewer samples do not show their own correlation, so that every error made from them would be a guess.
LEAST_SAMPLES = 10


class Estimate(NamedTuple):
    """A mean with its standard error, both in the unit of the series.

    Parameters
    ----------
    mean
        The mean.
    standard_error
        Its standard error.
    effective_samples
        Number of independent samples that would give the same error; for replicas their number, nan for a difference.
        Below about 20 the error itself is uncertain and tends to be too small.
    """

    mean: float
    standard_error: float
    effective_samples: float = math.nan

    def __repr__(self) -> str:
        """The mean to the last of two digits of its error, such as "0.312 +- 0.004 (57 effective samples)"."""
        error = f"{self.standard_error:.2g}"
        plain = 0.0 < self.standard_error < math.inf and "e" not in error
        mean = f"{self.mean:.{len(error.partition('.')[2])}f}" if plain else f"{self.mean:.6g}"
        count = "" if math.isnan(self.effective_samples) else f" ({self.effective_samples:.0f} effective samples)"
        return f"{mean} +- {error}{count}"


def steady_state(series: "DataArray", from_strain: float = 1.0) -> Estimate:
    """Mean of a series from a shear strain on, with a standard error that respects autocorrelation.

    Parameters
    ----------
    series
        (time,), evenly sampled, with the coordinate `shear_strain` [1], such as `ds.friction` of a run file.
    from_strain
        First shear strain that counts [1].

    Returns
    -------
    Estimate
        The error is std / sqrt(effective sample size). A constant series has the error 0 and all its samples count.

    Raises
    ------
    InputError
        For another dimension, a missing coordinate, values that are not finite, or fewer than 10 samples from that
        strain on.

    Notes
    -----
    The effective sample size is that of the autocorrelation: Geyer's sequences on the split chain.

    References
    ----------
    Vehtari et al. (2021), doi:10.1214/20-BA1221.
    """
    return _estimate(_samples(series, from_strain))


def steady_ratio(numerator: "DataArray", denominator: "DataArray", from_strain: float = 1.0) -> Estimate:
    """Ratio of the steady means of two series, such as shear stress over normal stress.

    Parameters
    ----------
    numerator, denominator
        As the series of `steady_state`, on the same times.
    from_strain
        First shear strain that counts [1].

    Returns
    -------
    Estimate
        By the delta method the error is that of the mean of numerator - ratio * denominator, over
        abs(mean denominator); effective_samples is that of this residual series.

    Raises
    ------
    InputError
        As `steady_state`, for other times, and if the denominator's mean is 0.
    """
    top, bottom = _samples(numerator, from_strain), _samples(denominator, from_strain)
    same_times = numerator.sizes == denominator.sizes and np.array_equal(numerator.time, denominator.time)
    if not same_times:
        raise InputError(f"{numerator.name} and {denominator.name}: not on the same times, must be of one run")
    if bottom.mean() == 0:
        raise InputError(f"{denominator.name}: the mean is 0, no ratio exists")
    ratio = top.mean() / bottom.mean()
    residual = _estimate(top - ratio * bottom)
    error = residual.standard_error / abs(bottom.mean())
    return Estimate(float(ratio), float(error), residual.effective_samples)


def combine_replicas(means: npt.ArrayLike, standard_errors: Sequence[float] | npt.NDArray | None = None) -> Estimate:
    """Mean over replicas (same parameters, other seeds), the replica as the unit.

    Parameters
    ----------
    means
        (n,) means of the single runs.
    standard_errors
        (n,) their errors; needed for n = 1 only.

    Returns
    -------
    Estimate
        The error is std(means, ddof=1) over sqrt(n), so that it contains what differs between packings; it has n - 1
        degrees of freedom (Student's t for intervals). One replica says nothing about the others: n = 1 takes the
        run's own error.

    Raises
    ------
    InputError
        If a mean is missing or not finite, the counts differ, or n = 1 comes without its error.
    """
    try:
        means = np.asarray(means, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"means: {means!r}, must be a list of at least one finite number") from None
    if means.ndim != 1 or means.size == 0 or not np.isfinite(means).all():
        raise InputError(f"means: {means}, must be a list of at least one finite number")
    if standard_errors is not None and np.shape(standard_errors) != means.shape:
        raise InputError(f"standard_errors: shape {np.shape(standard_errors)}, must be that of means, {means.shape}")
    if means.size > 1:
        error = means.std(ddof=1) / math.sqrt(means.size)
        return Estimate(float(means.mean()), float(error), float(means.size))
    if standard_errors is None:
        raise InputError("standard_errors: None, must be given for a single replica")
    return Estimate(float(means[0]), float(standard_errors[0]), 1.0)


def difference(a: Estimate, b: Estimate) -> Estimate:
    """Estimate a minus estimate b of independent runs: the error is sqrt(se_a^2 + se_b^2)."""
    return Estimate(a.mean - b.mean, math.hypot(a.standard_error, b.standard_error))


def _samples(series: "DataArray", from_strain: float) -> npt.NDArray[np.float64]:
    """Values of the series from this strain on, as float64; see `steady_state` for what is refused."""
    if not hasattr(series, "coords"):
        raise InputError(
            f"series: {type(series).__name__}, must be an xarray.DataArray such as open_run(path).friction"
        )
    name = series.name or "series"
    if series.dims != ("time",):
        raise InputError(f"{name}: dimensions {series.dims}, must be ('time',)")
    if "shear_strain" not in series.coords:
        there = ", ".join(map(str, series.coords))
        raise InputError(f"{name}: has no coordinate shear_strain; there are {there or 'none'}")
    if not math.isfinite(from_strain):
        raise InputError(f"from_strain: {from_strain!r}, must be a finite shear strain")
    strain = np.asarray(series.shear_strain, dtype=float)
    if not np.isfinite(strain).all():
        raise InputError(f"{name}: shear_strain is not finite at {np.sum(~np.isfinite(strain))} samples")
    values = np.asarray(series, dtype=float)[strain >= from_strain]
    if values.size < LEAST_SAMPLES:
        reached = f"strain {strain.max():g}" if strain.size else "no sample"
        raise InputError(
            f"{name}: {values.size} samples from strain {from_strain:g} on, at least "
            f"{LEAST_SAMPLES} are needed; the run reached {reached}"
        )
    if not np.isfinite(values).all():
        raise InputError(f"{name}: {np.sum(~np.isfinite(values))} of {values.size} samples are not finite")
    return values


def _estimate(values: npt.NDArray[np.float64]) -> Estimate:
    """Mean with the error of its effective sample size."""
    if np.ptp(values) == 0:
        return Estimate(float(values[0]), 0.0, float(values.size))
    from arviz_stats.base import array_stats  # takes long to load  # pyright: ignore[reportPrivateImportUsage]

    effective = np.asarray(array_stats.ess(values[np.newaxis], method="mean"), dtype=float).item()
    return Estimate(float(values.mean()), float(values.std(ddof=1) / math.sqrt(effective)), effective)
