"""The picture of a sensitivity: indices of first order and total ones as bars, one panel for each metric."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from workflows.plots.canvas import BLUE, ORANGE, figure_at
from workflows.sweep.saltelli import Indices

WIDE, HIGH = 5.6, 0.42  # inches of the picture, and of two bars
BAR = 0.36  # height of a bar, of the distance of parameters


def plot_sensitivity(path: Path, names: Sequence[str], found: Mapping[str, Indices]) -> None:
    """Draw the picture to `path`, whose ending is its format.

    Parameters
    ----------
    path
        File to write.
    names
        Of the parameters.
    found
        Indices by metric.
    """
    places = np.arange(len(names))
    with figure_at(path, (WIDE, 0.9 + len(found) * (0.6 + HIGH * len(names)))) as figure:
        panels = np.ravel(figure.subplots(len(found), 1))
        for axes, (metric, indices) in zip(panels, found.items(), strict=True):
            for shift, values, errors, colour, label in (
                (-BAR / 2, indices.first, indices.first_error, BLUE, "alone (first order)"),
                (BAR / 2, indices.total, indices.total_error, ORANGE, "with all others (total)"),
            ):
                style = {"ecolor": "black", "capsize": 2.5, "elinewidth": 0.9}
                axes.barh(places + shift, values, BAR, xerr=errors, color=colour, label=label, error_kw=style)
            axes.set_yticks(places, [name.replace("_", " ") for name in names])
            axes.invert_yaxis()
            axes.axvline(0.0, color="black", lw=0.8)
            axes.set_xlim(min(0.0, float((indices.first - indices.first_error).min()) - 0.02))
            left = f", {indices.left_out} left out" if indices.left_out else ""
            axes.set_title(f"{metric.replace('_', ' ')}: {indices.blocks} blocks of runs{left}")
        panels[-1].set_xlabel("share of the variance, 95 % intervals [1]")
        panels[-1].legend(loc="upper center", bbox_to_anchor=(0.45, -0.28 - 0.12 / len(names)), ncols=2)
        described = [
            f"{metric} {name} total {value:.3f}"
            for metric, indices in found.items()
            for name, value in zip(names, indices.total, strict=True)
        ]
        figure.set_label("; ".join(described))
