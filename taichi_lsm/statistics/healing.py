"""Healing: how the strength after a hold grows with the time of the hold."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .input_checks import series
from .steady_means import Estimate

LEAST_HOLDS = 3


class Healing(NamedTuple):
    """Line through peak less steady friction against the logarithm of the hold.

    Parameters
    ----------
    per_e_fold
        Slope d(mu_peak - mu_steady)/d ln t [1].
    per_decade
        The same per factor of ten [1].
    at_unit_time
        Value of the line at a hold of 1 s, or of 1 of the unit of the holds [1].
    chi_square
        Sum of the squared residuals over the squared errors [1]: about degrees_of_freedom if the line describes the
        data; nan where the errors are not known.
    degrees_of_freedom
        Number of holds less 2.
    """

    per_e_fold: Estimate
    per_decade: Estimate
    at_unit_time: Estimate
    chi_square: float
    degrees_of_freedom: int


def healing_rate(
    hold_time: npt.ArrayLike, peak_minus_steady: npt.ArrayLike, errors: npt.ArrayLike | None = None
) -> Healing:
    """Healing rate: weighted least squares of mu_peak - mu_steady = c + beta ln t, Dieterich (1972).

    Parameters
    ----------
    hold_time
        (hold,) t > 0 [s], or in any unit: slopes do not depend on it.
    peak_minus_steady
        (hold,) friction at the peak after the hold less the steady one [1].
    errors
        (hold,) standard errors of these [1], > 0, known well. Without them all holds count alike, and their error is
        that of the residuals.

    Returns
    -------
    Healing
        With given errors those of the line follow from them, and intervals are normal; they are not widened where
        chi-square is large, which tells that the line or the errors are wrong. Without, intervals are Student's.

    Raises
    ------
    InputError
        For fewer than 3 holds, other lengths, times that are not positive or all equal, and errors that are not
        positive.

    Notes
    -----
    Holds need not be independent of their order, but of each other: holds from one checkpoint share its steady state,
    and an error of the steady friction moves all of them together. It enters `at_unit_time` alone, so leave it out of
    `errors`.

    References
    ----------
    Dieterich (1972), doi:10.1029/JB077i020p03690; Marone (1998), doi:10.1146/annurev.earth.26.1.643.
    """
    time, y, sigma = _checked(hold_time, peak_minus_steady, errors)
    # Normal equations about the weighted mean of ln t, where slope and level are independent.
    weight, log_time = sigma**-2.0, np.log(time)
    centre = float(np.average(log_time, weights=weight))
    x = log_time - centre
    slope = float(np.sum(weight * x * y) / np.sum(weight * x**2))
    level = float(np.average(y, weights=weight))
    chi_square, freedom = float(np.sum(weight * (y - level - slope * x) ** 2)), y.size - 2
    scale = 1.0 if errors is not None else chi_square / freedom  # variance of a residual, where it is not known
    student = math.inf if errors is not None else float(freedom)
    slope_error = math.sqrt(scale / float(np.sum(weight * x**2)))
    level_error = math.sqrt(scale / float(np.sum(weight)))
    if scale == 0.0:
        slope_error = level_error = math.nan
    reason = "all points lie on the line: give their errors" if scale == 0.0 else ""

    def estimate(mean: float, error: float) -> Estimate:
        return Estimate(mean, error, float(y.size), student, reason)

    return Healing(
        estimate(slope, slope_error),
        estimate(slope * math.log(10.0), slope_error * math.log(10.0)),
        estimate(level - slope * centre, math.hypot(level_error, centre * slope_error)),
        chi_square if errors is not None else math.nan,
        freedom,
    )


def _checked(
    hold_time: npt.ArrayLike, peak_minus_steady: npt.ArrayLike, errors: npt.ArrayLike | None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Times, differences of friction and their errors, 1 where none are given; see `healing_rate`."""
    y = series("peak_minus_steady", peak_minus_steady, LEAST_HOLDS)
    time = series("hold_time", hold_time, LEAST_HOLDS, y.size)
    if not np.all(time > 0):
        raise InputError(f"hold_time: {time.min():g}, must be > 0 s")
    if np.ptp(time) == 0:
        raise InputError(f"hold_time: all {time[0]:g} s, at least two must differ")
    sigma = np.ones_like(y) if errors is None else series("errors", errors, LEAST_HOLDS, y.size)
    if not np.all(sigma > 0):
        raise InputError(f"errors: {sigma.min():g}, must be > 0; leave errors out where they are not known")
    return time, y, sigma
