"""The picture of shape-roughness: outlines, shape error, friction and cost of patches and of clumps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.run_table import Rows
from workflows.plots.friction_axes import axis_limits, draw_zero

COLOURS = {"patches": "#0072b2", "clump": "#d55e00"}


def plot_roughness(path: Path, rows: Rows, discs: NDArray, chain: NDArray) -> None:
    """Draw roughness.png: an outline of each kind, error, friction and cost against the number of elements.

    Parameters
    ----------
    path
        File to write.
    rows
        Of `shape_roughness.measure`.
    discs, chain
        Outlines (k, 2) of one grain as 30 discs and as 30 patches.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FormatStrFormatter, LogLocator

    figure = Figure(figsize=(14, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    drawn, error, friction, cost = figure.subplots(1, 4)
    drawn.plot(*discs.T, color=COLOURS["clump"], lw=1.2, label="30 discs")
    drawn.plot(*chain.T, color=COLOURS["patches"], lw=1.2, label="30 patches")
    drawn.set(aspect="equal", xticks=[], yticks=[], title="One outline")
    drawn.legend(fontsize=8, loc="center")
    values, intervals = [np.nan], []
    for kind, colour in COLOURS.items():
        own = [r for r in rows if r["kind"] == kind]
        x, mean = ([r[column] for r in own] for column in ("elements", "friction_mean"))
        half, costs = [_half_width(r) for r in own], [1e9 * r["cost"] for r in own]
        style = {"color": colour, "label": kind}
        if own:
            error.loglog(x, [r["shape_error"] for r in own], "o-", **style)
        if np.isfinite(mean).any():  # a legend names what is drawn
            bars = half if np.isfinite(half).any() else None
            friction.errorbar(x, mean, bars, fmt="o-", capsize=3, **style)
        if np.isfinite(costs).any():
            cost.plot(x, costs, "o-", **style)
        values += [m + sign * np.nan_to_num(h) for m, h in zip(mean, half, strict=True) for sign in (-1, 1)]
        intervals += [bool(np.isfinite(h)) for m, h in zip(mean, half, strict=True) if np.isfinite(m)]
    error.set(title="Shape error", ylabel="greatest distance / diameter [1]")
    friction.set(title=f"Friction of the layer{_interval_words(intervals)}", ylabel="friction [1]")
    cost.set(title="Cost", ylabel="time per grain and step [ns]")
    error.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))  # less than two decades
    error.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    # From 0, so that ratios are seen, with space for the legend.
    friction.set_ylim(axis_limits(values, space=1.35))
    cost.set_ylim(axis_limits([1e9 * r["cost"] for r in rows], space=1.35))
    draw_zero(friction)
    counts = sorted({r["elements"] for r in rows})
    for axes in (error, friction, cost):
        axes.set(xlabel="patches or discs per grain [1]", xscale="log", xlim=(0.8 * counts[0], 1.25 * counts[-1]))
        axes.set_xticks(counts, [str(n) for n in counts])
        axes.minorticks_off()
        axes.grid(True, alpha=0.25)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8)
        else:
            axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", va="center", color="0.4")
    figure.savefig(path, dpi=130)


def _interval_words(known):
    """What a title says of the intervals of means, of which these are known."""
    if not known:
        return ""
    return ", 95 % intervals" + ("" if all(known) else " where known") if any(known) else ", error unknown"


def _half_width(row):
    """Half-width of the 95 % interval of the friction of a row; nan, which draws no bar, if it is unknown."""
    if not np.isfinite(row["friction_mean"]):
        return np.nan
    return lsm.statistics.combine_replicas(*([row[f"friction_{n}"]] for n in ("mean", "se", "ess"))).half_width
