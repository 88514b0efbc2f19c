"""The figures of accuracy against cost: work-precision diagrams, and what ten times less error costs."""

import math

import numpy as np

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
NAMES = {
    "explicit_euler": "explicit Euler, as printed",
    "symplectic_euler": "symplectic Euler",
    "velocity_verlet": "velocity Verlet",
    "onset_verlet": "Verlet with onset correction",
    "forest_ruth": "Forest-Ruth, 4th order",
}
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
    "motion after an impact of ellipses": "velocities and spins, error / speed",
    "friction": "mean friction, deviation",
    "statistical error of friction": "mean friction, statistical error",
}
SHAPES = {"sphere": "discs", "angular": "angular grains"}
SUMMARY = (
    "energy after a collision",
    "energy drift of a gas",
    "shape error",
    "friction",
    "statistical error of friction",
)
WRITTEN = ("shape error", "motion after an impact of ellipses", "friction")  # panels whose points bear their settings
NO_AXIS = "platen_diameter"  # of walls no roughness is the most accurate one
WORST = 1e6  # factor of time that is drawn; what does not help at all is drawn as that


def named(knob):
    """A knob in words."""
    first, _, rest = knob.partition(", ")
    name = f"step of {NAMES[first]}" if first in NAMES else first.replace("_", " ")
    return name + (f", {SHAPES.get(rest, rest)}" if rest else "")


def plot_work_precision(path, found):
    """Draw the curves {(knob, quantity): Curve}: error against cost, the slope written on each line."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    figure = Figure(figsize=(15, 9), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (title, quantities) in zip(figure.subplots(2, 3).flat, PANELS, strict=True):
        own = [curve for (_, quantity), curve in found.items() if quantity in quantities]
        for colour, curve in zip(COLOURS * 3, own):
            known = np.isfinite(curve.error) & (curve.error > 0.0) & np.isfinite(curve.relative)
            if not known.any():
                continue
            slope = curve.slope()
            text = named(curve.knob) + (f" ({slope:.1f})" if math.isfinite(slope) else "")
            error = np.where(np.isfinite(curve.error_se), curve.error_se, 0.0)[known]
            low = np.minimum(error, 0.7 * curve.error[known])
            style = {"color": colour, "fmt": "o-", "ms": 4, "lw": 1.3, "capsize": 2, "label": text}
            axes.errorbar(curve.relative[known], curve.error[known], yerr=(low, error), **style)
            if quantities[0] in WRITTEN:
                for x, y, setting in zip(curve.relative[known], curve.error[known], np.array(curve.setting)[known]):
                    axes.annotate(setting, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7, color=colour)
        axes.set(xscale="log", yscale="log", title=title, xlabel="time over that of discs at default settings [1]")
        axes.set_ylabel(LABELS.get(quantities[0], quantities[0]) + " [1]")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if _narrow(axis) else (1.0,)))
            axis.set_minor_formatter(NullFormatter())
            if _narrow(axis):
                axis.set_major_formatter(FormatStrFormatter("%g"))
        axes.grid(True, which="major", color="0.9")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=7.5, frameon=False)
    figure.suptitle("Error against time; in brackets the power of the time with which the error falls")
    figure.savefig(path, dpi=120)


def _narrow(axis):
    """Does the axis span less than two decades?"""
    low, high = axis.get_view_interval()
    return high < 100.0 * low


def plot_summary(path, found):
    """Draw tenfold.png: factor of time for ten times less error, knob by knob."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    known = [curve for curve in found.values() if curve.quantity in SUMMARY and not math.isnan(curve.slope())]
    chosen = [curve for curve in known if not curve.knob.startswith(NO_AXIS)]
    rows = [(curve.quantity, named(curve.knob), curve.tenfold() if curve.resolved() else math.nan) for curve in chosen]
    rows.sort(key=lambda row: (SUMMARY.index(row[0]), math.isnan(row[2]), row[2]))
    figure = Figure(figsize=(10, 1.2 + 0.3 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for i, (quantity, _, factor) in enumerate(rows):
        if math.isnan(factor):
            axes.text(1.05, i, "no effect beyond the standard errors", va="center", fontsize=8, color="0.4")
            continue
        colour = COLOURS[SUMMARY.index(quantity)]
        axes.barh(i, min(factor, WORST), color=colour, alpha=1.0 if factor < WORST else 0.25)
        text = f" {factor:.2g} x" if factor < WORST else " more time does not help"
        text = " free" if factor < 1.05 else text
        inside = min(factor, WORST) > 1e3
        place = (min(factor, WORST) / 1.2, "right") if inside else (min(factor, WORST), "left")
        axes.text(place[0], i, text.strip() if inside else text, va="center", ha=place[1], fontsize=8)
    axes.set_yticks(range(len(rows)), [name for _, name, _ in rows], fontsize=8.5)
    axes.set(xscale="log", xlim=(1.0, WORST), ylim=(len(rows) - 0.4, -0.6))
    axes.set_xlabel("times as long for ten times less error [1]")
    last = None
    for i, (quantity, _, _) in enumerate(rows):
        if quantity != last:
            colour = COLOURS[SUMMARY.index(quantity)]
            axes.text(WORST * 1.15, i, LABELS.get(quantity, quantity), color=colour, fontsize=9)
            axes.axhline(i - 0.5, color="0.7", lw=0.7)
            last = quantity
    title = "What ten times less error costs: the shortest bar of each colour is the knob to turn first"
    axes.set_title(title, loc="left")
    figure.savefig(path, dpi=130)
