"""Work-precision diagrams: error against time, a line for each choice."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#7f7f7f")
NAMES = {
    "explicit_euler": "explicit Euler, as printed",
    "symplectic_euler": "symplectic Euler",
    "velocity_verlet": "velocity Verlet",
    "onset_verlet": "Verlet with onset correction",
    "forest_ruth": "Forest-Ruth, 4th order",
}
WORDS = {"step_safety": "time step", "platen_roughness": "roughness of the walls"}
PANELS = (  # title, quantities
    ("One collision of two discs", ("energy after a collision",)),
    ("Gas of 225 grains of 30 arcs", ("energy drift of a gas",)),
    ("Shape of the outline", ("shape error",)),
    ("Motion after an impact of ellipses", ("motion after an impact of ellipses",)),
    ("Friction: choices of the layer", ("friction",)),
    ("Friction: strain and seeds", ("statistical error of friction",)),
)
LABELS = {
    "energy after a collision": "energy after a collision, relative error",
    "energy drift of a gas": "energy of a gas, relative drift",
    "shape error": "outline, greatest distance / diameter",
    "motion after an impact of ellipses": "velocities of motion and rotation, error / speed",
    "friction": "mean friction, deviation",
    "statistical error of friction": "mean friction, statistical error",
}
SHAPES = {"round": "discs", "angular": "angular grains"}
WRITTEN = ("shape error", "motion after an impact of ellipses", "friction")  # panels whose points bear their settings
LEAST_SPAN = 3.0  # of the axis of times, last over first
STEEPEST = 10.0  # power of the time that is written; beyond, the time hardly changes
LEGEND_ROW = 0.042  # of the height of a panel


def named(parameter: str) -> str:
    """A parameter in words."""
    first, _, rest = parameter.partition(", ")
    words = WORDS.get(first) or first.replace("_", " ")
    name = f"step of {NAMES[first]}" if first in NAMES else words
    return name + (f", {SHAPES.get(rest, rest)}" if rest else "")


def plot_work_precision(path: Path, found: dict[Any, Any]) -> None:
    """Draw the curves {(parameter, quantity): Curve}: error against cost, the slope written on each line."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    figure, with_bars = Figure(figsize=(15, 10.5), layout="constrained"), False
    FigureCanvasAgg(figure)
    for axes, (title, quantities) in zip(figure.subplots(2, 3).flat, PANELS, strict=True):
        own = [curve for (_, quantity), curve in found.items() if quantity in quantities]
        for colour, curve in zip(COLOURS * 3, own):
            known = np.isfinite(curve.error) & (curve.error > 0.0) & np.isfinite(curve.relative)
            if not known.any():
                continue
            slope = curve.slope() if curve.resolved() else math.nan
            text = named(curve.parameter) + (f" ({slope:.1f})" if abs(slope) < STEEPEST else "")
            error = np.where(np.isfinite(curve.error_se), curve.error_se, 0.0)[known]
            low = np.minimum(error, 0.7 * curve.error[known])
            style = {"color": colour, "fmt": "o-", "ms": 4, "lw": 1.3, "capsize": 2, "label": text}
            bars = (low, error) if np.any(error > 0.0) else None  # a legend shows bars where there are any
            axes.errorbar(curve.relative[known], curve.error[known], yerr=bars, **style)
            with_bars |= bars is not None
            if quantities[0] in WRITTEN:
                for x, y, setting in zip(curve.relative[known], curve.error[known], np.array(curve.setting)[known]):
                    axes.annotate(setting, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7, color=colour)
        axes.set(xscale="log", yscale="log", title=title, xlabel="time over that of discs at default settings [1]")
        axes.set_ylabel(LABELS.get(quantities[0], quantities[0]) + " [1]")
        low, high = axes.get_xlim()
        if high < LEAST_SPAN * low:  # times that differ by their noise
            axes.set_xlim(*(np.sqrt(low * high) * np.array([LEAST_SPAN**-0.5, LEAST_SPAN**0.5])))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if _narrow(axis) else (1.0,)))
            axis.set_minor_formatter(NullFormatter())
            if _narrow(axis):
                axis.set_major_formatter(FormatStrFormatter("%g"))
        axes.grid(True, which="major", color="0.9")
        entries = len(axes.get_legend_handles_labels()[0])
        if entries:
            share = LEGEND_ROW * (entries + 1)  # of the height, above the lines
            low, high = axes.get_ylim()
            axes.set_ylim(low, high * (high / low) ** (share / (1.0 - share)))
            axes.legend(fontsize=7.5, frameon=False, loc="upper right")
        else:
            axes.tick_params(which="both", bottom=False, left=False, labelbottom=False, labelleft=False)
            axes.grid(False)
            axes.text(0.5, 0.5, "no error known", transform=axes.transAxes, ha="center", va="center", color="0.4")
    bars = "; bars: standard errors" if with_bars else ""
    figure.suptitle(f"Error against time; in brackets the power of the time with which the error falls{bars}")
    figure.savefig(path, dpi=120)


def _narrow(axis):
    """Whether the axis spans less than two decades."""
    low, high = axis.get_view_interval()
    return high < 100.0 * low
