"""The friction panels of a comparison of shapes: curves with their means, and steady values beside published ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.gouge.labels import shape_words
from workflows.plots.canvas import BLUE, ORANGE
from workflows.plots.friction_axes import DASHES, SMOOTH_STRAIN, axis_limits, draw_zero, estimate_text, smoothed

if TYPE_CHECKING:
    import xarray

COLOUR = {"round": BLUE, "angular": ORANGE}
NEUTRAL = "0.3"  # of legends that hold for every shape
BESIDE, APART = 0.025, 0.025  # place of the means at the end of the curves, and between them, over the strain
LEAST_TOP = 0.5  # friction up to which the curves' axis goes at least
PUBLISHED_TOP = 0.7  # friction up to which the axis of the published values goes at least
SINGLE_BELOW = 0.3  # rows by which single runs are drawn below their mean


class Curves(NamedTuple):
    """Friction of all runs of a shape at the same strains."""

    strain: NDArray  # (n,)
    runs: NDArray  # (run, n), means over SMOOTH_STRAIN


def curves_of(sheared: Sequence[xarray.Dataset]) -> Curves:
    """The Curves of runs, from the rows of their shear, over the strains that all of them have."""
    begin, end = max(s.shear_strain[0] for s in sheared), min(s.shear_strain[-1] for s in sheared)
    strain = np.linspace(float(begin), float(end), len(sheared[0].time))
    of_runs = [np.interp(strain, s.shear_strain, smoothed(s.shear_strain.values, s.friction.values)) for s in sheared]
    return Curves(strain, np.array(of_runs))


def draw_comparison(axes: Any, curves: Mapping[str, Curves], found: Mapping[str, Any], since: float, dim: int) -> None:
    """Friction against strain, all of a shape in its colour: the mean over its runs and the span of the runs.

    Steady means are dashed, and stand at the end of the curves with their 95 % intervals, side by side.

    Parameters
    ----------
    axes
        To draw in.
    curves, found
        {shape: Curves} and {shape: Estimate of its steady friction}.
    since
        Strain from which the steady means are taken.
    dim
        Dimension of space.
    """
    last = max((c.strain[-1] for c in curves.values()), default=1.0)
    drawn: list[Any] = [[0.0, LEAST_TOP]]
    for i, (shape, (strain, runs)) in enumerate(curves.items()):
        colour, estimate, count = COLOUR[shape], found[shape], len(runs)
        if count > 1:
            axes.fill_between(strain, runs.min(axis=0), runs.max(axis=0), color=colour, alpha=0.22, lw=0)
        label = f"{shape_words(shape, dim)}: {estimate_text(estimate)} ({count} run{'s' * (count > 1)})"
        axes.plot(strain, runs.mean(axis=0), color=colour, lw=1.4, label=label)
        at = last * (1.0 + BESIDE + APART * i)
        axes.plot([since, at], [estimate.mean] * 2, color=colour, lw=1.1, ls=DASHES)
        bar = estimate.half_width if np.isfinite(estimate.half_width) else None
        axes.errorbar(at, estimate.mean, yerr=bar, fmt="o", color=colour, ms=4.5, capsize=4, elinewidth=1.8)
        drawn += [runs, estimate.interval, estimate.mean]
    axes.set(xlabel="shear strain [1]", ylabel="friction: shear stress / normal stress [1]")
    if curves:
        _explain_curves(axes, any(len(c.runs) > 1 for c in curves.values()), found, since)
        axes.set_xlim(0, last * (1.0 + 2.0 * BESIDE + APART * (len(curves) - 1)))
        axes.legend(loc="upper left", fontsize=8.8)
    axes.set_ylim(axis_limits(*drawn, space=1.6))
    draw_zero(axes)
    axes.set_title(f"(a) friction of the layer, running mean over strain {SMOOTH_STRAIN:g}")


def _explain_curves(axes, replicated, found, since):
    """Entries of the legend that hold for every shape, of what is drawn."""
    if replicated:
        axes.fill_between([], [], color=NEUTRAL, alpha=0.22, lw=0, label="least to greatest run; line: their mean")
    style = {"color": NEUTRAL, "ms": 4.5, "lw": 1.1, "ls": DASHES}
    label = f"mean from strain {since:g} on"
    if any(np.isfinite(e.half_width) for e in found.values()):
        # The bar stands upright, as those in the panel, on the dashes of the mean.
        axes.errorbar(
            [], [], yerr=[], fmt="o", capsize=4, elinewidth=1.8, label=f"{label}; bar: 95 % interval", **style
        )
    else:
        axes.plot([], [], marker="o", label=label, **style)
    axes.axvline(since, 0.0, 0.62, color="0.6", lw=1, ls=":")


def draw_seeds(axes: Any, table: xarray.Dataset, found: Any, target: float, colour: str) -> None:
    """Mean friction of each run of target.nc, and that of all with its 95 % interval beside the wanted one.

    Parameters
    ----------
    axes, colour
        To draw in.
    table, found
        target.nc, and the mean of all runs: `mean`, `half_width` and `interval`.
    target
        Wanted half-width of the interval [1].
    """
    seeds, means, errors = (table[name].values for name in ("seed", "friction_mean", "friction_se"))
    mean, known = found.mean, bool(np.isfinite(found.half_width))
    axes.axhspan(mean - target, mean + target, color="0.85", lw=0, label=f"wanted 95 % interval, ±{target:g}")
    if known:
        axes.axhspan(*found.interval, color=colour, alpha=0.3, lw=0, label=f"reached, ±{found.half_width:.2g}")
    axes.axhline(mean, color=colour, lw=1.2, ls=DASHES, label=f"mean of the runs, {mean:.3f}")
    bars, any_known = np.where(np.isfinite(errors), errors, 0.0), bool(np.isfinite(errors).any())
    label = "a run" + ("; bar: standard error within it" if any_known else "; its error is unknown")
    style = {"fmt": "o", "color": colour, "ms": 4.5, "capsize": 3}
    axes.errorbar(seeds, means, yerr=errors if any_known else None, label=label, **style)
    axes.set_xticks(seeds)
    span = [*(means + bars), *(means - bars), *found.interval, mean - target, mean + target]
    low, high = float(np.nanmin(span)), float(np.nanmax(span))
    axes.set(xlabel="seed of the run", ylabel="mean friction of steady shear [1]")
    axes.set_ylim(low - 0.08 * (high - low), high + 0.7 * (high - low))
    axes.legend(loc="upper left", fontsize=8.8)
    axes.set_title("(b) the runs, and the wanted error")


def published_rows() -> list[tuple]:
    """(dimension, friction, label, kind, round or angular, remark, values) of the checked references, unsorted.

    Values of one source and condition share a row; the friction is their mean.
    """
    rows = {}
    for r in lsm.published_friction():
        if r["note"] == "unchecked":
            continue
        still = "rotation suppressed" in r["conditions"]
        what = r["shape"].removeprefix("smooth ") + ("" if r["shape"] == "angular" else "s")
        label = f"{what} {r['dimension']}D{', no rotation' * still}, {r['source']}"
        rows.setdefault((r["dimension"], label, r["kind"], still), []).append(r["mu"])
    return [
        (d, float(np.mean(mu)), label, kind, "angular" if "angular" in label else "round", still, mu)
        for (d, label, kind, still), mu in rows.items()
    ]


def draw_published(axes: Any, found: Mapping[str, Any], dim: int, singles: Mapping[str, NDArray]) -> None:
    """Steady friction of a comparison, with 95 % intervals and the means of single runs, beside published values.

    Rows are sorted by dimension, then by friction; the axis holds all that is drawn.

    Parameters
    ----------
    axes
        To draw in.
    found, singles
        {shape: Estimate of its steady friction} and {shape: (run,) means of its single runs}.
    dim
        Dimension of space of its runs.
    """
    rows = published_rows()
    rows += [
        (dim, e.mean, f"{shape_words(s, dim).removesuffix(' grains')} {dim}D, here", "here", s, False, e)
        for s, e in found.items()
    ]
    rows.sort(key=lambda row: row[:3], reverse=True)
    drawn: list[Any] = []
    for y, (_, mean, _, kind, shape, _, values) in enumerate(rows):
        colour = COLOUR[shape]
        if kind == "here":
            axes.axhspan(y - 0.5, y + 0.5, color=colour, alpha=0.14, lw=0)
            width = values.half_width if np.isfinite(values.half_width) else None
            axes.errorbar(mean, y, xerr=width, fmt="o", color=colour, ms=5.5, capsize=5, elinewidth=2)
            axes.plot(singles[shape], [y - SINGLE_BELOW] * len(singles[shape]), "o", color=colour, ms=3, mfc="white")
            drawn += [mean, values.interval, singles[shape]]
            continue
        face = colour if kind == "laboratory" else "white"
        axes.plot(values, [y] * len(values), "s" if face == colour else "D", color=colour, ms=6, mfc=face, mew=1.5)
        drawn.append(values)
    axes.set_yticks(range(len(rows)), [row[2] for row in rows], fontsize=9)
    for tick, row in zip(axes.get_yticklabels(), rows, strict=True):
        tick.set_fontweight("bold" if row[3] == "here" else "normal")
    for y in range(1, len(rows)):
        if rows[y][0] != rows[y - 1][0]:  # a line between the dimensions
            axes.axhline(y - 0.5, color="0.6", lw=0.8)
    _explain_published(axes, found)
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    low, high = axis_limits(*drawn, space=1.03)
    axes.set(xlim=(low, max(PUBLISHED_TOP, high)), ylim=(-0.6, len(rows) - 0.4), xlabel="friction [1]")
    if low < 0.0:
        axes.axvline(0.0, color="0.5", lw=0.8)
    axes.set_title("(b) steady friction beside published values")


def _explain_published(axes, found):
    """The legend, below the axis since values may lie anywhere in it; of what is drawn."""
    style = {"color": NEUTRAL, "ms": 6}
    axes.plot([], [], "s", label="laboratory", **style)
    axes.plot([], [], "D", mfc="white", mew=1.5, label="simulation", **style)
    known = [bool(np.isfinite(e.half_width)) for e in found.values()]
    if any(known):
        label = "here, 95 % interval" + ("" if all(known) else " if known")
        axes.errorbar([], [], xerr=[], fmt="o", color=NEUTRAL, ms=5.5, capsize=5, elinewidth=2, label=label)
    elif found:
        axes.plot([], [], "o", color=NEUTRAL, ms=5.5, label="here, error unknown")
    if found:
        axes.plot([], [], "o", color=NEUTRAL, ms=3, mfc="white", label="single runs")
    axes.legend(loc="upper right", bbox_to_anchor=(1.03, -0.15), ncols=4, handletextpad=0.3, columnspacing=1.0)
