"""Statistics of a catalogue of events: sizes, recurrence, and the b-value with its completeness.

No library is used for the b-value: SeismoStats is under the AGPL, and powerlaw, under the MIT licence, fits tails of
power laws without the correction for binned magnitudes or an error that allows for the spread of the magnitudes.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, finite
from .input_checks import series
from .steady_means import Estimate

if TYPE_CHECKING:
    from xarray import Dataset

LEAST_EVENTS = 2
LEAST_COMPLETE = 50  # events above completeness, below which the b-value is not told (Woessner & Wiemer 2005 take 60)
CURVATURE_BIN, CURVATURE_CORRECTION = 0.1, 0.2  # of the magnitudes, for the completeness


class Catalogue(NamedTuple):
    """Means of a catalogue of events.

    Parameters
    ----------
    events
        Number of events.
    stress_drop
        Mean drop of the stress [Pa, or 1 for friction].
    slip
        Mean slip [m].
    duration
        Mean duration [s].
    recurrence
        Mean time from onset to onset [s].
    recurrence_variation
        Standard deviation of that time over its mean [1]: 0 for a clock, 1 for events at random.
    """

    events: int
    stress_drop: Estimate
    slip: Estimate
    duration: Estimate
    recurrence: Estimate
    recurrence_variation: float


class BValue(NamedTuple):
    """Slope of the magnitudes' distribution, N(M) ~ 10^(-b M).

    Parameters
    ----------
    b
        The b-value [1].
    completeness
        Magnitude from which on the catalogue is complete [1].
    events
        Number of events from there on.
    """

    b: Estimate
    completeness: float
    events: int


def catalogue_statistics(events: "Dataset") -> Catalogue:
    """Mean drop, slip, duration and recurrence of the events that `detect_events` found, with errors.

    Parameters
    ----------
    events
        Along event: stress_drop, slip, duration, recurrence.

    Returns
    -------
    Catalogue
        Errors are std/sqrt(n) with Student's t: events count as independent of each other.

    Raises
    ------
    InputError
        For fewer than 2 events.
    """
    count = int(events.sizes["event"])
    if count < LEAST_EVENTS:
        raise InputError(f"events: {count}, at least {LEAST_EVENTS} are needed: shear further")
    times = np.asarray(events.recurrence, float)[1:]
    variation = float(np.std(times, ddof=1) / np.mean(times)) if times.size > 1 else math.nan
    drop, slip, duration = (_mean(np.asarray(events[name], float)) for name in ("stress_drop", "slip", "duration"))
    return Catalogue(count, drop, slip, duration, _mean(times), variation)


def magnitude_of_completeness(magnitudes: npt.ArrayLike) -> float:
    """Magnitude from which on a catalogue is complete: that of most events, plus 0.2.

    The maximum of the histogram in bins of 0.1 (Wiemer & Wyss 2000, doi:10.1785/0119990114), with the correction of
    Woessner & Wiemer (2005), doi:10.1785/0120040007, since catalogues fade gradually.

    Parameters
    ----------
    magnitudes
        (n,) [1].
    """
    m = series("magnitudes", magnitudes, LEAST_EVENTS)
    bins, counts = np.unique(np.round(m / CURVATURE_BIN), return_counts=True)
    return float(bins[np.argmax(counts)]) * CURVATURE_BIN + CURVATURE_CORRECTION


def b_value(magnitudes: npt.ArrayLike, completeness: float | None = None, bin_width: float = 0.0) -> BValue:
    """b-value by maximum likelihood, with the magnitude of completeness and a standard error.

    b = (n - 1)/n log10(e)/(<M> - M_c + w/2), the mean over the n events of M >= M_c - w/2, w the width of bins     (1)
    error = ln 10 b^2 sqrt(sum (M - <M>)^2/(n (n - 1)))                                                        (2)

    Parameters
    ----------
    magnitudes
        (n,) [1]: of events the decimal logarithm of the drop, of the slip or of the energy, two thirds of it for the
        scale of earthquakes.
    completeness
        M_c; by `magnitude_of_completeness` where it is not given.
    bin_width
        w, of magnitudes that are rounded; 0 if they are not. M_c is the centre of a bin.

    Returns
    -------
    BValue
        The interval is Student's. The error is nan, with the reason, for fewer than 50 events from M_c on. It is that
        for a known M_c.

    Raises
    ------
    InputError
        For fewer than 2 events from M_c on, or all of one magnitude.

    References
    ----------
    Aki (1965), Bull. Earthq. Res. Inst. 43, 237, and Utsu (1966) for (1), with the factor against bias of Ogata &
    Yamashina (1986), doi:10.4294/jpe1952.34.187; Shi & Bolt (1982), doi:10.1785/BSSA0720051677, for (2).
    """
    m = series("magnitudes", magnitudes, LEAST_EVENTS)
    if not (finite(bin_width) and bin_width >= 0):
        raise InputError(f"bin_width: {bin_width}, must be >= 0")
    least = magnitude_of_completeness(m) if completeness is None else float(completeness)
    m = m[m >= least - 0.5 * bin_width - 1e-9 * max(1.0, abs(least))]
    if m.size < LEAST_EVENTS or np.ptp(m) == 0.0:
        raise InputError(
            f"completeness: {least:g}, {m.size} events lie above it, must be 2 and more of which two differ"
        )
    b = (m.size - 1) / m.size * math.log10(math.e) / float(m.mean() - least + 0.5 * bin_width)
    error = math.log(10.0) * b**2 * float(m.std(ddof=1)) / math.sqrt(m.size)
    if m.size < LEAST_COMPLETE:
        reason = f"{m.size} events above completeness, at least {LEAST_COMPLETE} are needed: shear further"
        return BValue(Estimate(b, math.nan, m.size, math.nan, reason), least, m.size)
    return BValue(Estimate(b, error, m.size, m.size - 1.0), least, m.size)


def _mean(values: npt.NDArray[np.float64]) -> Estimate:
    """Mean of independent values, its error by their scatter."""
    if values.size < 2:
        return Estimate(float(values.mean()), math.nan, values.size, math.nan, "one value: shear further")
    if np.ptp(values) <= 1e-9 * abs(float(values.mean())):
        reason = "all values are equal, as of times in whole rows: shear further, or with closer rows"
        return Estimate(float(values.mean()), math.nan, values.size, math.nan, reason)
    return Estimate(
        float(values.mean()), float(values.std(ddof=1)) / math.sqrt(values.size), values.size, values.size - 1.0
    )
