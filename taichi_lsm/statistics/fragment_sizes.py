"""The size distribution of fragments: the fractal dimension of a power law on a finite range, by maximum likelihood.

No library is used: powerlaw, under the MIT licence, fits densities with an upper cut-off, but its error is that of a
range without end, and it chooses the least size by the fit.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from ..core.errors import InputError
from .input_checks import require_positive, series
from .steady_means import Estimate

LEAST_FRAGMENTS = 20  # within the range, below which the error of the dimension is not told
SMALL = 1e-3  # D ln(d_max/d_min) below which the formulas cancel, and their series are exact to rounding


class FragmentSizes(NamedTuple):
    """A power law of fragment sizes, N(>d) ~ d^-D within a range.

    Parameters
    ----------
    dimension
        The fractal dimension D [1] with its error.
    least, largest
        Ends of the range [m].
    fragments
        Number of fragments within it.
    distance
        Kolmogorov's distance [1]: greatest difference between the shares of the fragments below a size, those counted
        and those of the law. Above 1.1/sqrt(fragments) the law does not describe the sizes: with the fitted D a true
        law exceeds that in 5 % at most, 1.36/sqrt(fragments), the limit for a known D, in none of 200.
    """

    dimension: Estimate
    least: float
    largest: float
    fragments: int
    distance: float


def fragment_dimension(diameters: npt.ArrayLike, least: float, largest: float) -> FragmentSizes:
    """Fractal dimension of the sizes of fragments between two sizes, with its standard error.

    N(>d) ~ d^-D within d_min <= d <= d_max, where fragments have the density                                   (1)
    p(d) = D d^(-D-1)/(d_min^-D - d_max^-D).
    With y = ln(d/d_min) and L = ln(d_max/d_min) the likelihood of n fragments is greatest where
    <y> = 1/D - L/(exp(D L) - 1),                                                                               (2)
    and the information gives
    error(D) = 1/sqrt(n I), I = 1/D^2 - L^2/(4 sinh^2(D L/2)), the variance of y.                               (3)
    D may be 0, where y is uniform, or negative.

    Parameters
    ----------
    diameters
        (n,) [m], in any order; those outside of the range do not count.
    least, largest
        d_min and d_max [m]: known beforehand, as the sizes of the pieces and of the grains are. Taken from the
        fragments themselves they bias D upwards.

    Returns
    -------
    FragmentSizes
        The interval of D is Student's with n - 1 degrees of freedom; the error is nan, with the reason, for fewer than
        20 fragments within the range.

    Raises
    ------
    InputError
        Unless 0 < least < largest, and for fewer than 2 fragments strictly within the range.

    References
    ----------
    Page (1968), Bull. Seismol. Soc. Am. 58, 1153, for (2), of magnitudes; Turcotte (1986), J. Geophys. Res. 91, 1921,
    for (1). The density (1) is an exponential family in y, of which (3) holds.
    """
    sizes = series("diameters", diameters, 0)
    require_positive(least=least, largest=largest)
    if not least < largest:
        raise InputError(f"least: {least:g} m, must be below largest, {largest:g} m")
    inside = sizes[(sizes >= least) & (sizes <= largest)]
    length, y = math.log(largest / least), np.log(inside / least)
    mean = float(y.mean()) if y.size else math.nan
    if y.size < 2 or not 0.0 < mean < length:
        raise InputError(
            f"diameters: {y.size} lie between {least:g} and {largest:g} m, must be 2 and more that are not all at one "
            "end; widen the range"
        )
    # |D| is below the inverse of the distance of the mean from the nearer end, as (2) shows for L without end.
    most = 2.0 / min(mean, length - mean)
    root: Any = brentq(lambda trial: _mean(trial, length) - mean, -most, most, xtol=1e-12 * most)
    d = float(root)
    error = 1.0 / math.sqrt(y.size * _variance(d, length))
    ranks, shares = np.arange(y.size + 1) / y.size, share_below(np.sort(inside), d, least, largest)
    distance = float(np.max(np.maximum(ranks[1:] - shares, shares - ranks[:-1])))
    if y.size < LEAST_FRAGMENTS:
        few = f"{y.size} fragments between {least:g} and {largest:g} m, at least {LEAST_FRAGMENTS} are needed"
        return FragmentSizes(Estimate(d, math.nan, y.size, math.nan, few), least, largest, y.size, distance)
    return FragmentSizes(Estimate(d, error, y.size, y.size - 1.0), least, largest, y.size, distance)


def share_below(diameters: npt.ArrayLike, dimension: float, least: float, largest: float) -> npt.NDArray[np.float64]:
    """Share of the fragments below these sizes (n,) [m] in a power law between `least` and `largest` [m].

    P(d) = (1 - (d/d_min)^-D)/(1 - (d_max/d_min)^-D), for D = 0 ln(d/d_min)/ln(d_max/d_min).
    """
    y, length = np.log(np.asarray(diameters, float) / least), math.log(largest / least)
    if abs(dimension * length) < 1e-9:
        return y / length
    return np.expm1(-dimension * y) / math.expm1(-dimension * length)


def _mean(d: float, length: float) -> float:
    """Mean of y, (2), which obeys mean(-D) = L - mean(D); near D = 0 by its series."""
    x = abs(d) * length
    if x < SMALL:
        return length * (0.5 - d * length / 12.0)
    of_positive = length * (1.0 / x - math.exp(-x) / -math.expm1(-x))
    return of_positive if d > 0.0 else length - of_positive


def _variance(d: float, length: float) -> float:
    """Variance of y, I of (3), even in D; near D = 0 by its series."""
    x = abs(d) * length
    if x < SMALL:
        return length**2 / 12.0 * (1.0 - x**2 / 20.0)
    # sinh(x/2)^-2 = 4 exp(-x)/(1 - exp(-x))^2, which never overflows.
    return length**2 * (1.0 / x**2 - math.exp(-x) / math.expm1(-x) ** 2)
