"""Means of steady shear with honest standard errors and intervals; plain functions on xarray objects."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError

if TYPE_CHECKING:
    from xarray import DataArray

__all__ = ["Estimate", "combine_replicas", "difference", "steady_ratio", "steady_state"]

# Fewer rows do not show their own correlation at all: they are refused.
LEAST_SAMPLES = 10
# With fewer independent samples, or fewer crossings of its own mean, a series looks less correlated than it is, and its
# intervals miss the mean far too often (tests/statistics/test_coverage.py): its error is called unknown.
LEAST_EFFECTIVE, LEAST_CROSSINGS = 20, 10
# The correlation itself is known from the samples, to about n_eff / 5 degrees of freedom: the variance of a correlation
# time that is summed over five times itself, var(tau)/tau^2 = 10/n_eff, is 2 over them (Sokal 1997).
SAMPLES_PER_FREEDOM = 5.0
LEVEL = 0.95  # of the intervals
LEAST_RUNS = 3  # that know no error of their own, whose scatter is taken for one


class Estimate(NamedTuple):
    """A mean with its standard error, both in the unit of the series.

    Parameters
    ----------
    mean
        The mean.
    standard_error
        Its standard error; nan if it is unknown.
    effective_samples
        Number of independent samples that would give the same error; for replicas their number, nan for a difference.
    degrees_of_freedom
        Degrees of freedom of Student's t by which the interval is wider than that of a known error; inf if it is known.
    unknown
        Why the error is unknown, and what to do; "" if it is known.
    runs
        Number of runs that it is the mean of; 0 for the mean of a series, and for a difference.
    """

    mean: float
    standard_error: float
    effective_samples: float = math.nan
    degrees_of_freedom: float = math.inf
    unknown: str = ""
    runs: int = 0

    @property
    def half_width(self) -> float:
        """Half of the width of the 95 % interval, by Student's t; nan if the error is unknown."""
        return _student(self.degrees_of_freedom) * self.standard_error

    @property
    def interval(self) -> tuple[float, float]:
        """(least, greatest) of the 95 % interval."""
        return self.mean - self.half_width, self.mean + self.half_width

    def __repr__(self) -> str:
        """The mean to the last digit of its error, and the interval: "0.312 +- 0.004, 95 % interval 0.304 to 0.32"."""
        if math.isnan(self.standard_error):
            return f"{self.mean:.6g} +- unknown" + (f" ({self.unknown})" if self.unknown else "")
        error = f"{self.standard_error:.2g}"
        plain = 0.0 < self.standard_error < math.inf and "e" not in error
        form = f".{len(error.partition('.')[2])}f" if plain else ".6g"
        low, high = self.interval
        count = "" if math.isnan(self.effective_samples) else f" ({self.effective_samples:.0f} effective samples)"
        if self.runs:
            count = f" ({self.runs} run{'s' if self.runs > 1 else ''})"
        return f"{self.mean:{form}} +- {error}, 95 % interval {low:{form}} to {high:{form}}{count}"


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
        The error is std / sqrt(effective sample size), with a fifth of this size as degrees of freedom. It is nan,
        with the reason, below 20 effective samples, for a series that crosses its mean less than 10 times, and for a
        constant one.

    Raises
    ------
    InputError
        For another dimension, a missing coordinate, values that are not finite, or fewer than 10 samples from that
        strain on.

    Notes
    -----
    The effective sample size is that of the autocorrelation: Geyer's sequences on the split chain. Of series with at
    least 20 independent samples the intervals cover the mean in 92 to 97 %; of shorter ones most are called unknown,
    so that of all series, whatever their length, at most 8 % get an interval that misses the mean.

    References
    ----------
    Vehtari et al. (2021), doi:10.1214/20-BA1221; Sokal (1997), doi:10.1007/978-1-4899-0319-8_6.
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
    return residual._replace(mean=float(ratio), standard_error=float(error))


def combine_replicas(
    means: npt.ArrayLike,
    standard_errors: npt.ArrayLike | None = None,
    effective_samples: npt.ArrayLike | None = None,
) -> Estimate:
    """Mean over replicas (same parameters, other seeds) from what differs between them and what is known of each.

    Parameters
    ----------
    means
        (n,) means of the single runs.
    standard_errors
        (n,) their errors, nan where unknown; needed for n = 1 only. None: the means count alone.
    effective_samples
        (n,) independent samples of each run, from which its error is known; without them the errors count as exact.

    Returns
    -------
    Estimate
        The error is the larger one of two: the scatter s/sqrt(n) of the means, with n - 1 degrees of freedom, and the
        pooled error of the runs, sqrt(mean of se_i^2)/sqrt(n). Few means agree by chance, and errors within runs do
        not know what differs between packings. The interval is the wider one of the two Student intervals, and
        degrees_of_freedom are those by which standard_error gives it. Runs with unknown errors are left out of the
        pooled error. One run has its own error. Two of which neither knows its own give none: that they agree may be
        chance.

    Raises
    ------
    InputError
        If a mean is missing or not finite, the counts differ, or n = 1 comes without its error.

    Notes
    -----
    The wider of two intervals is never narrower than Student's. It covers normal means in 94 to 97 % where the runs
    differ by three times their own errors or more, and in 97 to 99.5 % (2 runs) where they do not differ. No rule for
    two or three runs keeps 95 % in both cases: a small scatter does not tell one from the other.

    The degrees of freedom of the pooled error are by Satterthwaite (1946), doi:10.2307/3002019.
    """
    means = _finite_means(means)
    count, mean = means.size, float(means.mean())
    if count == 1 and standard_errors is None:
        raise InputError("standard_errors: None, must be given for a single replica")
    errors = _of_replicas("standard_errors", standard_errors, count, math.nan)
    freedom = _of_replicas("effective_samples", effective_samples, count, math.inf) / SAMPLES_PER_FREEDOM

    within = _pooled(errors, freedom, count)
    unknown = math.isnan(within[0])
    if count == 1:
        reason = "one run whose own error is unknown: shear it further, or run more" if unknown else ""
        return Estimate(mean, *within, reason, count)
    between = Estimate(mean, float(means.std(ddof=1)) / math.sqrt(count), count, count - 1.0, runs=count)
    if unknown:
        reason = "all runs are equal: give them other seeds" if np.ptp(means) == 0 else ""
        if standard_errors is not None and count < LEAST_RUNS:
            reason = reason or f"{count} runs whose own errors are unknown, and which may agree by chance: run more"
        return Estimate(mean, math.nan, count, math.nan, reason, count) if reason else between
    pooled = Estimate(mean, within[0], count, within[2])
    larger, half_width = max(between[1], pooled[1]), max(between.half_width, pooled.half_width)
    return Estimate(mean, larger, count, _freedom(half_width / larger) if larger > 0 else math.inf, runs=count)


def difference(a: Estimate, b: Estimate) -> Estimate:
    """Estimate a minus estimate b of independent runs: the error is sqrt(se_a^2 + se_b^2).

    Degrees of freedom by Welch (1947), doi:10.1093/biomet/34.1-2.28.
    """
    error = math.hypot(a.standard_error, b.standard_error)
    freedom = _satterthwaite([a[1], b[1]], [a[3], b[3]])
    return Estimate(a.mean - b.mean, error, math.nan, freedom, a.unknown or b.unknown)


def _samples(series: "DataArray", from_strain: float) -> npt.NDArray[np.float64]:
    """Values of the series from this strain on, as float64; see `steady_state` for what is refused."""
    if not hasattr(series, "coords"):
        raise InputError(
            f"series: {type(series).__name__}, must be an xarray.DataArray such as open_run(folder).run.friction"
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
    """Mean with the error of its effective sample size, or with the reason why the error is unknown."""
    mean = float(values.mean())
    if np.ptp(values) == 0:
        return Estimate(float(values[0]), math.nan, math.nan, math.nan, "the series is constant")
    above = values > mean
    crossings = int(np.sum(above[1:] != above[:-1]))
    if crossings < LEAST_CROSSINGS:
        reason = f"the series crosses its mean {crossings} times, at least {LEAST_CROSSINGS} are needed: shear further"
        return Estimate(mean, math.nan, math.nan, math.nan, reason)
    from arviz_stats.base import array_stats  # takes long to load  # pyright: ignore[reportPrivateImportUsage]

    effective = np.asarray(array_stats.ess(values[np.newaxis], method="mean"), dtype=float).item()
    if effective < LEAST_EFFECTIVE:
        found = min(round(effective, 1), LEAST_EFFECTIVE - 0.1)  # or 19.97 would be the 20 that are needed
        reason = f"{found:g} effective samples, at least {LEAST_EFFECTIVE} are needed: shear further"
        return Estimate(mean, math.nan, effective, math.nan, reason)
    error = float(values.std(ddof=1)) / math.sqrt(effective)
    return Estimate(mean, error, effective, effective / SAMPLES_PER_FREEDOM)


def _finite_means(means: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """The means of `combine_replicas` as (n,) floats, or an InputError."""
    try:
        array = np.asarray(means, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"means: {means!r}, must be a list of at least one finite number") from None
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise InputError(f"means: {array}, must be a list of at least one finite number")
    return array


def _of_replicas(name: str, values: npt.ArrayLike | None, count: int, missing: float) -> npt.NDArray[np.float64]:
    """An argument of `combine_replicas` as (n,) floats, `missing` where there is none."""
    if values is None:
        return np.full(count, missing)
    if np.shape(values) != (count,):
        raise InputError(f"{name}: shape {np.shape(values)}, must be that of means, ({count},)")
    return np.asarray(values, dtype=float)


def _pooled(
    errors: npt.NDArray[np.float64], freedom: npt.NDArray[np.float64], count: int
) -> tuple[float, float, float]:
    """(standard error, samples, degrees of freedom) of the mean of `count` runs from the known errors within them."""
    known = np.isfinite(errors) & ~np.isnan(freedom)
    if not known.any():
        return math.nan, float(count), math.nan
    error = math.sqrt(float(np.mean(errors[known] ** 2)) / count)
    return error, float(count), _satterthwaite(errors[known], freedom[known])


def _satterthwaite(errors: npt.ArrayLike, freedom: npt.ArrayLike) -> float:
    """Degrees of freedom of a sum of variances: (sum se_i^2)^2 / sum (se_i^4 / nu_i)."""
    squares, nu = np.square(np.asarray(errors, float)), np.asarray(freedom, float)
    spread = float(np.sum(squares**2 / nu))
    return math.inf if spread == 0.0 else float(np.sum(squares)) ** 2 / spread


def _student(freedom: float) -> float:
    """Half-width of the interval in standard errors."""
    from scipy.special import stdtrit  # imported when needed: `import taichi_lsm` is quick

    return float(stdtrit(freedom, 0.5 + LEVEL / 2))


def _freedom(half_width: float) -> float:
    """Degrees of freedom for which the half-width has this value, in standard errors: the inverse of `_student`."""
    from scipy.special import stdtridf

    return float(stdtridf(0.5 + LEVEL / 2, half_width))
