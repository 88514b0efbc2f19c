"""The summary picture of accuracy against cost: the cost of a tenth of the default error, for each parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workflows import shear_gouge
from workflows.accuracy.curves import Curve
from workflows.accuracy.gouge import LAYER
from workflows.plots.work_precision import COLOURS, LABELS, named

DEFAULTS = {  # curve that a quantity is judged by, and its default; None: the setting that costs what discs cost
    "energy after a collision": ("onset_verlet", None),
    "energy drift of a gas": ("onset_verlet", None),
    "shape error": ("patches", 30),
}
OWN = ("friction", "statistical error of friction")  # quantities whose parameters are each judged by themselves
QUANTITIES = (*DEFAULTS, *OWN)
NO_AXIS = "platen_roughness"  # no roughness of the walls is the most accurate one
UNRESOLVED, NEVER = "no effect beyond the standard errors", "more time does not help"
FREE = 1.05  # times as long: a smaller factor is lost in the noise
LEAST = 0.3  # times as long, up to which the picture goes at least
FARTHEST = 1e5  # times as long, at the border of the picture


@dataclass(frozen=True)
class Bar:
    """A row of the picture: times over the default's time, or why there are none (`note`).

    begin, end: times at which the parameter reaches the error of the default and a tenth of it.
    """

    quantity: str
    name: str
    begin: float = math.nan
    end: float = math.nan
    default: bool = False
    note: str = ""


def default_of(found: dict[Any, Any], curve: Curve) -> tuple[float, float] | None:
    """(error, relative cost) of the default settings for a curve, None if they were not measured."""
    if curve.quantity == "friction":
        judge, value = curve, getattr(shear_gouge.Params.model_validate(LAYER), curve.parameter.split(", ")[0])
    elif curve.quantity in OWN:  # of strain and seeds: one of them
        judge, value = curve, 1
    else:
        name, value = DEFAULTS[curve.quantity]
        judge = found.get((name, curve.quantity))
        if judge is None:
            return None
    distance = np.abs(np.log(judge.relative if value is None else judge.value / value))
    at = int(np.nanargmin(distance))
    return float(judge.error[at]), float(judge.relative[at])


def bar_of(found: dict[Any, Any], curve: Curve) -> Bar | None:
    """The Bar of a curve, None if it has no default to be judged by or was not measured well enough to have one."""
    judged = curve.quantity in QUANTITIES and not curve.parameter.startswith(NO_AXIS)
    known = default_of(found, curve) if judged else None
    if known is None or math.isnan(curve.slope()):
        return None
    (error, cost), name = known, named(curve.parameter)
    default = curve.quantity in OWN or curve.parameter == DEFAULTS[curve.quantity][0]
    if not curve.resolved():
        return Bar(curve.quantity, name, note=UNRESOLVED)
    if math.isinf(curve.tenfold()):
        return Bar(curve.quantity, name, note=NEVER)
    if curve.tenfold() < FREE:
        begin = end = float(np.nanmedian(curve.relative)) / cost
    else:
        begin, end = curve.cost_at(error) / cost, curve.cost_at(0.1 * error) / cost
    return Bar(curve.quantity, name, begin, end, default)


def bars_of(found: dict[Any, Any]) -> list[Bar]:
    """All bars, by quantity and within it by the time that a tenth of the error takes."""
    bars = [bar for bar in (bar_of(found, curve) for curve in found.values()) if bar]
    return sorted(bars, key=lambda b: (QUANTITIES.index(b.quantity), b.note == UNRESOLVED, b.note == NEVER, b.end))


def text_of(bar: Bar) -> str:
    """What is written beside a bar."""
    if bar.note:
        return bar.note
    begin, end = (f"{x:.2g}" if x < 100 else f"{x:,.0f}" for x in (bar.begin, bar.end))
    if bar.end < FREE * bar.begin:
        return "no more time" if bar.default else f"{end} times as long"
    return f"{end} times" if bar.default else f"{begin} to {end} times"


def plot_summary(path: Path, found: dict[Any, Any]) -> None:
    """Draw tenfold.png: from the time for the default's error to that for a tenth of it, parameter by parameter."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    bars = bars_of(found)
    figure = Figure(figsize=(11, 1.6 + 0.3 * len(bars)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    last = None
    for i, bar in enumerate(bars):
        colour = COLOURS[QUANTITIES.index(bar.quantity)]
        if bar.quantity != last:
            axes.text(FARTHEST * 1.15, i, LABELS[bar.quantity], color=colour, fontsize=9, va="center")
            axes.axhline(i - 0.5, color="0.7", lw=0.7)
            last = bar.quantity
        begin, end = (min(x, FARTHEST) for x in (bar.begin, bar.end))
        if not bar.note:
            axes.plot([begin], [i], "o", color=colour, ms=6)
            axes.barh(i, end - begin, left=begin, height=0.55, color=colour, alpha=1.0 if bar.default else 0.45)
        left = end > 1e3  # where no space is left beyond the bar
        place = 1.15 if bar.note else begin / 1.3 if left else end * 1.25
        style = {"va": "center", "fontsize": 8, "color": "0.4" if bar.note else "black"}
        axes.text(place, i, text_of(bar), ha="right" if left else "left", **style)
    axes.axvline(1.0, color="0.3", lw=1.0)
    axes.set_yticks(range(len(bars)), [bar.name for bar in bars], fontsize=8.5)
    least = min([LEAST, *(0.6 * bar.begin for bar in bars if not bar.note)])
    axes.set(xscale="log", xlim=(least, FARTHEST), ylim=(len(bars) - 0.4, -0.6))
    axes.set_xlabel("time over that of the default settings [1]")
    axes.set_title(
        "What ten times less error costs: a bar begins at the time for the error of the default settings and ends at\n"
        "that for a tenth of it. Of each colour, change first the parameter whose bar ends first. Dark: the default.",
        loc="left",
        fontsize=10,
    )
    figure.savefig(path, dpi=130)
