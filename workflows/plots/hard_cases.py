"""The picture of the hard cases: the share of its bound that each of them uses, in both precisions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workflows.common.run_table import Rows

COLOURS = {"f64": "#0072b2", "f32": "#e69f00"}
LEAST, GREATEST = 1e-4, 1e2  # shares of a bound on the axis; what lies beyond is drawn at the border


def plot_cases(path: Path, rows: Rows) -> None:
    """Draw the rows of `hard_cases.measure` to the file `path`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row["case"] for row in rows))
    titles = {row["case"]: row["title"] for row in rows}
    kinds = {row["case"]: row["kind"] for row in rows}
    figure = Figure(figsize=(10, 1.6 + 0.22 * len(names)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.axvspan(1.0, 2 * GREATEST, color="#d55e00", alpha=0.18, lw=0)
    axes.axvline(1.0, color="#d55e00", lw=1)
    beyond = False
    for precision, offset in (("f64", -0.14), ("f32", 0.14)):
        own = [row for row in rows if row["precision"] == precision]
        used = np.array([0.0 if row["value"] == 0.0 else 1.0 / max(row["margin"], 1e-300) for row in own])
        at = np.array([names.index(row["case"]) for row in own]) + offset
        judged = np.array([row["status"] < 2 for row in own], bool)
        drawn = np.clip(used, LEAST, GREATEST)
        beyond |= bool(np.any(used > GREATEST))
        colour = COLOURS[precision]
        for chosen, fill, label in ((judged, colour, precision), (~judged, "none", f"{precision}, excepted")):
            if chosen.any():
                style = {"facecolor": fill, "edgecolor": colour, "label": label, "s": 26, "zorder": 3}
                axes.scatter(drawn[chosen], at[chosen], **style)
    bounds = [i for i in range(1, len(names)) if kinds[names[i]] != kinds[names[i - 1]]]
    for border in bounds:
        axes.axhline(border - 0.5, color="0.6", lw=0.6)
    axes.set(xscale="log", xlim=(0.6 * LEAST, 2 * GREATEST), ylim=(len(names) - 0.5, -0.5))
    axes.set_yticks(range(len(names)), [titles[name] for name in names], fontsize=8)
    at_right = f"; at the right border: {GREATEST:g} or more, or no result" if beyond else ""
    axes.set_xlabel(f"measured value over its bound [1]\nat the left border: {LEAST:g} or less, many exact{at_right}")
    axes.set_title("Hard cases: left of the line the case holds", loc="left")
    axes.grid(axis="x", color="0.9")
    # Above the frame, beside the title: inside it a legend may cover the very case that failed.
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, fontsize=8, borderaxespad=0.1)
    figure.savefig(path, dpi=130)
