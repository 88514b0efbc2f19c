"""The picture of a calibration: the posterior of each parameter and of each two, and what it gives of the targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflows.plots.canvas import BLUE, ORANGE, figure_at

BINS = 48  # of a histogram over what is drawn of a parameter
SMOOTH = 1.2  # bins, of the smoothing of two parameters' histogram
LEVELS = (0.68, 0.95)  # probabilities within the contours
INCH = 2.1  # width of a panel
LEAST_INCH = 1.1  # height of a target
QUANTILES = (0.005, 0.995)  # of a posterior that must be seen, with as much again on either side
GREY = "0.6"


@dataclass(frozen=True)
class Axis:
    """A parameter as it is drawn.

    Attributes
    ----------
    label
        Its name and unit.
    log
        Whether its axis is logarithmic.
    edges
        (BINS + 1,) borders of the bins.
    prior
        (BINS,) probability of the prior in each bin.
    values
        (n,) of the points of the posterior.
    runs
        (r,) of the runs.
    """

    label: str
    log: bool
    edges: NDArray
    prior: NDArray
    values: NDArray
    runs: NDArray


@dataclass(frozen=True)
class Compared:
    """A target beside what is emulated.

    Attributes
    ----------
    label
        The metric with its unit.
    value, error
        Of the target, in the unit of the metric; the error holds all but the emulator's.
    posterior, prior
        (n,) emulated means of draws of the posterior and of the prior.
    """

    label: str
    value: float
    error: float
    posterior: NDArray
    prior: NDArray


def plot_calibration(path: Path, axes: Sequence[Axis], weights: NDArray, targets: Sequence[Compared]) -> None:
    """Draw calibration.png.

    Parameters
    ----------
    path
        File to write; its ending is the format.
    axes, weights
        The parameters; (n,) weights of the points of the posterior.
    targets
        At least one.
    """
    count = len(axes)
    height = 0.6 + max(0.9 * INCH * count, LEAST_INCH * len(targets))
    with figure_at(path, (INCH * (count + 1.6), height)) as figure:
        # Side by side, since there may be more targets than parameters.
        corner, beside = np.ravel(np.asarray(figure.subfigures(1, 2, width_ratios=[count, 1.4])))
        grid = corner.add_gridspec(count, count)
        for row in range(count):
            for column in range(row + 1):
                panel = corner.add_subplot(grid[row, column])
                if row == column:
                    _draw_one(panel, axes[row], weights, first=row == 0)
                else:
                    _draw_two(panel, axes[column], axes[row], weights, first=(row, column) == (1, 0))
                _label(panel, axes, row, column)
        corner.align_ylabels()
        for row, (panel, target) in enumerate(zip(np.ravel(beside.subplots(len(targets), 1)), targets, strict=True)):
            _draw_target(panel, target, first=row == 0)
        figure.set_label(_description(axes, weights))


def _description(axes: Sequence[Axis], weights: NDArray) -> str:
    """What the file says of its content: the mean of each parameter."""
    means = [f"{axis.label} {np.sum(weights * axis.values):.4g}" for axis in axes]
    return f"posterior: {'; '.join(means)}"


def _draw_one(panel: Any, axis: Axis, weights: NDArray, first: bool) -> None:
    """Density of one parameter, as probability per bin, with the prior and ticks for the runs."""
    density, _ = np.histogram(axis.values, bins=axis.edges, weights=weights)
    panel.stairs(density, axis.edges, color=BLUE, fill=True, alpha=0.35, label="posterior")
    panel.stairs(density, axis.edges, color=BLUE, lw=1.0)
    panel.stairs(axis.prior, axis.edges, color=GREY, lw=1.2, baseline=None, label="prior")
    panel.plot(axis.runs, np.zeros(len(axis.runs)), "|", color="black", ms=5, mew=0.6, clip_on=True, label="runs")
    panel.set(ylim=(0.0, 1.3 * max(density.max(), axis.prior.max())), yticks=[])
    panel.spines["left"].set_visible(False)
    if first:
        panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, handlelength=1.2, columnspacing=1.0)


def _draw_two(panel: Any, across: Axis, up: Axis, weights: NDArray, first: bool) -> None:
    """Density of two parameters, with the regions of least area that hold LEVELS, and the runs as points."""
    from scipy.ndimage import gaussian_filter

    mass, _, _ = np.histogram2d(across.values, up.values, bins=(across.edges, up.edges), weights=weights)
    mass = gaussian_filter(mass, SMOOTH, mode="nearest")
    panel.pcolormesh(across.edges, up.edges, mass.T, cmap="Blues", rasterized=True)
    middle = [_middle(axis) for axis in (across, up)]
    descending = np.sort(mass.ravel())[::-1]
    held = np.cumsum(descending) / descending.sum()
    borders = [descending[min(np.searchsorted(held, level), len(held) - 1)] for level in LEVELS]
    if borders[1] < borders[0] and borders[1] > 0.0:
        panel.contour(*middle, mass.T, levels=borders[::-1], colors=BLUE, linewidths=(0.8, 1.4))
        if first:
            words = " and ".join(f"{100 * level:.0f} %" for level in LEVELS)
            panel.set_title(f"regions of {words}", fontsize=8.8)
    panel.plot(across.runs, up.runs, ".", color="black", ms=4.5, mew=0.0, clip_on=True)


def _middle(axis: Axis) -> NDArray:
    """(BINS,) middles of the bins."""
    low, high = axis.edges[:-1], axis.edges[1:]
    return np.sqrt(low * high) if axis.log else 0.5 * (low + high)


def _label(panel: Any, axes: Sequence[Axis], row: int, column: int) -> None:
    """Limits, scales and names, the names only at the left and at the bottom."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter

    drawn = [(panel.xaxis, axes[column], panel.set_xscale, panel.set_xlim)]
    if row != column:
        drawn.append((panel.yaxis, axes[row], panel.set_yscale, panel.set_ylim))
    for side, axis, scale, limits in drawn:
        if axis.log:
            scale("log")
            decades = np.log10(axis.edges[-1] / axis.edges[0])
            side.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)))
            side.set_major_formatter(FormatStrFormatter("%g"))
            side.set_minor_formatter(NullFormatter())
        else:
            side.set_major_locator(MaxNLocator(4))
        limits(axis.edges[0], axis.edges[-1])
    if row == len(axes) - 1:
        panel.set_xlabel(axes[column].label)
    else:
        panel.tick_params(labelbottom=False)
    if row != column and column == 0:
        panel.set_ylabel(axes[row].label)
    elif row != column:
        panel.tick_params(labelleft=False)


def _draw_target(panel: Any, target: Compared, first: bool) -> None:
    """A band for the target and its two errors, and what draws of the prior and of the posterior give."""
    wide = 2.0 * target.error
    panel.axvspan(target.value - wide, target.value + wide, color=ORANGE, alpha=0.18, lw=0)
    panel.axvline(target.value, color=ORANGE, lw=1.4, label="target, two errors")
    for height, values, colour, name in (
        (1.0, target.prior, GREY, "prior"),
        (0.0, target.posterior, BLUE, "posterior"),
    ):
        low, middle, high = np.quantile(values, (0.025, 0.5, 0.975))
        panel.plot([low, high], [height, height], color=colour, lw=3.0, solid_capstyle="butt")
        panel.plot([middle], [height], "o", color=colour, ms=5, label=f"emulated, {name}, 95 %")
    panel.set(ylim=(-0.7, 1.7), yticks=[], xlabel=target.label)
    panel.spines["left"].set_visible(False)
    panel.locator_params(axis="x", nbins=5)
    if first:
        panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1, handlelength=1.2)


def edges_of(shares: NDArray, weights: NDArray) -> NDArray:
    """(BINS + 1,) shares of a prior over which a parameter is drawn: all of it, or what holds a narrow posterior."""
    order = np.argsort(shares)
    ends = np.searchsorted(np.cumsum(weights[order]), QUANTILES).clip(0, len(shares) - 1)
    low, high = shares[order][ends]
    width = high - low
    if width > 1.0 / 3.0:
        return np.linspace(0.0, 1.0, BINS + 1)
    return np.linspace(max(0.0, low - width), min(1.0, high + width), BINS + 1)
