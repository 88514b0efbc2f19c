"""Slip events of stick-slip: when the platen runs away from its load point, and how far the stress falls."""

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .input_checks import require_positive, rising, series

if TYPE_CHECKING:
    from xarray import Dataset

Array = npt.NDArray[np.float64]
LEAST_ROWS = 50
NORMAL_MAD = 1.482602218505602  # standard deviation of a normal distribution over its median absolute deviation
WINDOW = 20  # rows of loading on each side of an event, from which its drop is read
LEAST_PLACES = 10  # without an event, at which the error of a drop is measured
MEANING = {
    "start": ("s", "time of the onset: of the last row before it"),
    "end": ("s", "time at which the platen is slow again: of the first row after it"),
    "duration": ("s", "end less start"),
    "stress_drop": ("Pa", "stress at the onset less that at the end"),
    "stress_drop_error": ("Pa", "standard error of stress_drop; nan where too little loading shows the noise"),
    "slip": ("m", "slip of the platen during the event"),
    "peak_velocity": ("m s-1", "greatest velocity of the platen, mean since the row before"),
    "recurrence": ("s", "time since the onset of the event before; nan of the first"),
}


def detect_events(
    time: npt.ArrayLike,
    stress: npt.ArrayLike,
    platen_velocity: npt.ArrayLike,
    load_velocity: float,
    *,
    onset: float = 6.0,
    end: float = 2.0,
    least_drop: float = 1.0,
    gap: int = 2,
) -> "Dataset":
    """Find the slip events of a run by the velocity of its platen, with hysteresis and the run's own noise.

    An event holds a row whose platen velocity is beyond `onset` deviations above its median, and beyond the load
    velocity. From there it reaches to both sides as long as the velocity is beyond `end` deviations above the median
    and above the load velocity. The deviation is that of the rows between events: 1.48 times the median absolute
    deviation, of which events that take less than a fifth of the rows change little. It lies between two rows: where
    it begins and ends within rows, its start is half a row early on average, its end half a row late, and the drop
    smaller by what loading adds in a row. Slip and energies are those between the two rows.

    The drop is the stress at the onset less that at the end, each from the straight line through the 20 rows of loading
    before or after, or those that there are up to the next event. So noise does not make drops larger, as it does
    highest less lowest values. Its error is what the same two lines differ by at places without an event, so that it
    holds for correlated noise. Events that the data cut off at either end are left out.

    Parameters
    ----------
    time
        (n,) [s], rising.
    stress
        (n,) shear stress [Pa] that pulls the platen, or friction; drops are in its unit.
    platen_velocity
        (n,) [m s-1], mean since the row before, such as `plate_velocity` of run.nc.
    load_velocity
        [m s-1] > 0 of the load point.
    onset, end
        Thresholds in deviations of the velocity, onset > end >= 0.
    least_drop
        Drop that an event must have, in standard deviations of the stress between events: less is not told from noise.
    gap
        Events fewer rows apart than this are one.

    Returns
    -------
    Dataset
        Along event: the variables of MEANING. Attributes: the thresholds used, the noise of stress and velocity.

    Raises
    ------
    InputError
        For fewer than 50 rows, lengths that differ, times that do not rise, or thresholds out of order.
    """
    t, tau, v = _checked(time, stress, platen_velocity)
    require_positive(load_velocity=load_velocity, onset=onset, least_drop=least_drop)
    if not 0.0 <= end < onset:
        raise InputError(f"end: {end:g}, must be >= 0 and below onset, {onset:g}")
    median = float(np.median(v))
    deviation = NORMAL_MAD * float(np.median(np.abs(v - median)))
    high = max(median + onset * deviation, load_velocity)
    low = max(median + end * deviation, load_velocity)
    spans = _merged(_spans(v > low, v > high), gap)
    noise, of_lines = _noise_between(tau, spans), _noise_of_lines(t, tau, spans)
    found = [_event(t, tau, v, spans, i, of_lines) for i in range(len(spans))]
    used = {"onset_velocity": high, "end_velocity": low, "velocity_noise": deviation, "stress_noise": noise}
    return _table([event for event in found if event["stress_drop"] > least_drop * noise], used)


def _checked(time: npt.ArrayLike, stress: npt.ArrayLike, platen_velocity: npt.ArrayLike) -> tuple[Array, Array, Array]:
    """The three series (n,), or an InputError that names what is wrong with one."""
    t = series("time", time, LEAST_ROWS)
    rising("time", t)
    return (
        t,
        series("stress", stress, LEAST_ROWS, t.size),
        series("platen_velocity", platen_velocity, LEAST_ROWS, t.size),
    )


def _table(events: list[dict[str, float]], attributes: dict[str, float]) -> "Dataset":
    """Events as rows of a Dataset, each with the time since the one before."""
    import xarray

    for event, before in zip(events, [math.nan, *(event["start"] for event in events)], strict=False):
        event["recurrence"] = event["start"] - before
    data = {
        name: ("event", np.array([event[name] for event in events], float), {"units": units, "long_name": long_name})
        for name, (units, long_name) in MEANING.items()
    }
    return xarray.Dataset(data, attrs={"title": "Slip events"} | attributes)


def _spans(loose: npt.NDArray[np.bool_], certain: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """[first, last) of every run of `loose` rows that holds a `certain` one, with onset and end in the data."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], loose, [False]]).astype(int)))
    return [(int(i), int(j)) for i, j in edges.reshape(-1, 2) if certain[i:j].any() and i > 0 and j < loose.size]


def _merged(spans: list[tuple[int, int]], gap: int) -> list[tuple[int, int]]:
    """Spans fewer than `gap` rows apart as one."""
    merged: list[tuple[int, int]] = []
    for first, last in spans:
        if merged and first - merged[-1][1] < gap:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return merged


def _between(spans: list[tuple[int, int]], rows: int, length: int) -> list[int]:
    """First rows of pieces of so many rows of loading, without an event in them."""
    ends = [0, *(row for span in spans for row in span), rows]
    return [at for i, j in zip(ends[::2], ends[1::2], strict=True) for at in range(i, j - length + 1, length)]


def _noise_between(stress: Array, spans: list[tuple[int, int]]) -> float:
    """Standard deviation of the stress between events, about straight lines: loading does not count as noise."""
    x = np.arange(WINDOW) - 0.5 * (WINDOW - 1)
    pieces = [stress[at : at + WINDOW] for at in _between(spans, stress.size, WINDOW)]
    if not pieces:
        return float(np.std(np.diff(stress))) / math.sqrt(2.0)
    y = np.stack(pieces)
    y = y - y.mean(axis=1, keepdims=True)
    left = y - (y @ x / np.sum(x**2))[:, None] * x
    return math.sqrt(float(np.median(np.sum(left**2, axis=1))) / (WINDOW - 2))


def _noise_of_lines(t: Array, stress: Array, spans: list[tuple[int, int]]) -> float:
    """Standard deviation of independent rows that would give lines on both sides of no event such differences."""
    pulls = []
    for at in _between(spans, stress.size, 2 * WINDOW):
        middle = at + WINDOW
        moment = 0.5 * (t[middle - 1] + t[middle])
        upper, upper_variance = _line_at(t[at:middle], stress[at:middle], moment)
        lower, lower_variance = _line_at(t[middle : middle + WINDOW], stress[middle : middle + WINDOW], moment)
        pulls.append((upper - lower) ** 2 / (upper_variance + lower_variance))
    return math.sqrt(float(np.mean(pulls))) if len(pulls) >= LEAST_PLACES else math.nan


def _event(t: Array, stress: Array, v: Array, spans: list[tuple[int, int]], i: int, noise: float) -> dict[str, float]:
    """What is told of one event; rows [first, last) are fast, and row first - 1 is the last slow one."""
    first, last = spans[i]
    before = spans[i - 1][1] if i else 0
    after = spans[i + 1][0] if i + 1 < len(spans) else stress.size
    start, stop = t[first - 1], t[last - 1]  # the velocity of a row is the mean since the row before
    rows_before, rows_after = slice(max(before, first - WINDOW), first), slice(last - 1, min(after, last - 1 + WINDOW))
    upper, upper_variance = _line_at(t[rows_before], stress[rows_before], start)
    lower, lower_variance = _line_at(t[rows_after], stress[rows_after], stop)
    steps = np.diff(t, prepend=t[0] - (t[1] - t[0]))
    return {
        "start": float(start),
        "end": float(stop),
        "duration": float(stop - start),
        "stress_drop": upper - lower,
        "stress_drop_error": noise * math.sqrt(upper_variance + lower_variance),
        "slip": float(np.sum((v * steps)[first:last])),
        "peak_velocity": float(v[first:last].max()),
    }


def _line_at(t: Array, stress: Array, moment: float) -> tuple[float, float]:
    """Value at a moment of the line through rows, and its variance over that of a row; of few rows their mean."""
    if t.size < 4:
        return float(stress.mean()), 1.0 / t.size
    x = t - t.mean()
    slope, lever = float(np.sum(x * stress) / np.sum(x**2)), moment - float(t.mean())
    return float(stress.mean()) + slope * lever, 1.0 / t.size + lever**2 / float(np.sum(x**2))
