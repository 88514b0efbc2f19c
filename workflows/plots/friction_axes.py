"""What the pictures of friction share: means in words, running means, and axes that hold all that is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import taichi_lsm as lsm

if TYPE_CHECKING:
    import xarray

COLOUR_OF_ZERO = "0.5"
DASHES = (0, (5, 3))  # of means
ROOM_OF_LETTER = 0.014  # of the width of the axes
MOST_LINES = 30  # stages that all have a line
MARGIN = 0.05  # of the span, below what is negative
SMOOTH_STRAIN = 0.05  # width of the running mean of curves, the least one of a single run
MOST_WINDOWS = 100  # widths of the running mean that a column has space for


def estimate_text(estimate: lsm.statistics.Estimate) -> str:
    """A mean as legends show it, such as "0.261, 95 % interval 0.252 to 0.270"."""
    low, high = estimate.interval
    known = f"95 % interval {low:.3f} to {high:.3f}" if np.isfinite(low) else "error unknown"
    return f"{estimate.mean:.3f}, {known}"


def axis_limits(*values: ArrayLike, space: float) -> tuple[float, float]:
    """Limits (low, high) of an axis that holds all `values`, which are known or nan.

    The axis begins at 0, and below the least value where that is negative; it is `space` times as long as the values
    need, at its upper end.
    """
    numbers = np.concatenate([np.ravel(np.asarray(v, float)) for v in values])
    numbers = numbers[np.isfinite(numbers)]
    low, high = min(0.0, numbers.min(initial=0.0)), max(0.0, numbers.max(initial=0.0))
    if low == high:
        high = 1.0
    if low < 0.0:
        low -= MARGIN * (high - low)
    return float(low), float(low + space * (high - low))


def draw_zero(axes: Any) -> None:
    """A line at 0 across a vertical axis that goes below it."""
    if axes.get_ylim()[0] < 0.0:
        axes.axhline(0.0, color=COLOUR_OF_ZERO, lw=0.8, zorder=1)


def mark_stages(axes: Any, along: NDArray, sheared: xarray.Dataset) -> None:
    """A line where each stage of a run begins, and the name of those that have room for it, at the foot of the axes.

    Of very many stages only those with a name have a line: others would hide the curves.

    along: values (n,) of the rows along the horizontal axis, of which a stage begins at that of the row before it.
    """
    index = sheared.stage_index.values
    begins = np.flatnonzero(np.diff(index, prepend=index[0] - 1))
    lines = along[np.maximum(begins - 1, 0)]
    ends = [*lines[1:], along[-1]]
    width = axes.get_xlim()[1]
    for row, begin, end in zip(begins, lines, ends, strict=True):
        name = str(sheared.stage.values[row])
        named = end - begin > ROOM_OF_LETTER * width * len(name)
        if named or len(lines) <= MOST_LINES:
            axes.axvline(begin, color="0.6", lw=0.7, ls=":", zorder=1)
        if named:
            middle = 0.5 * (begin + end)
            place = {"transform": axes.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            paper = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}  # above the line of zero friction
            axes.text(middle, 0.02, name, fontsize=8, bbox=paper, **place)


def running_mean(values: NDArray, width: int) -> NDArray:
    """Mean over `width` samples about each, fewer at the ends; same length as `values`."""
    kernel = np.ones(min(max(1, width), len(values)))
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same")


def smoothing_width(span: float) -> float:
    """Width of the running mean of a run over a span of strain: 1, 2 or 5 times a power of ten, SMOOTH_STRAIN at least.

    Of a long run a narrow mean would be a band that hides the other curves.
    """
    least = max(SMOOTH_STRAIN, span / MOST_WINDOWS)
    power = 10.0 ** np.floor(np.log10(least) + 1e-9)
    return float(power * next(part for part in (1.0, 2.0, 5.0, 10.0) if part * power >= least * (1.0 - 1e-9)))


def smoothed(strain: NDArray, values: NDArray, width: float = SMOOTH_STRAIN) -> NDArray:
    """Mean of the values over a width of strain about each strain (n,)."""
    step = (strain[-1] - strain[0]) / max(1, len(strain) - 1)
    return running_mean(values, round(width / step) if step > 0 else 1)
