"""Figure of an oedometer: void ratio and breakage against the logarithm of the normal stress."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflows.gouge.compression import NeverYields, yield_of
from workflows.plots.canvas import BLUE, ORANGE, figure_at
from workflows.plots.run_titles import title_of

if TYPE_CHECKING:
    import xarray


def plot_oedometer(path: Path, dataset: xarray.Dataset, levels: xarray.Dataset) -> None:
    """Draw compression.png of run.nc and compression.nc."""
    bonded = "broken_share" in levels
    with figure_at(path, (11 if bonded else 6, 4.2)) as figure:
        panels = figure.subplot_mosaic("ab" if bonded else "a")
        _draw_void_ratio(panels["a"], levels)
        if bonded:
            _draw_breakage(panels["b"], levels)
        figure.suptitle(title_of(dataset))
        figure.set_label(f"compression of a layer in {levels.sizes['level']} levels")


def _draw_void_ratio(axes: Any, levels: xarray.Dataset) -> None:
    """Void ratio of each level, and the two lines that meet where the layer yields."""
    stress, ratio = levels.normal_stress.values / 1e6, levels.void_ratio.values
    axes.semilogx(stress, ratio, "o-", ms=4, lw=0.8, color=BLUE)
    axes.set(xlabel="normal stress [MPa]", ylabel="void ratio [1]", title="(a) compression")
    try:
        meeting, before, after = (found.mean for found in yield_of(levels))
    except NeverYields:
        return
    x, meeting = np.log10(stress), meeting - 6.0  # of MPa
    shape = before * np.minimum(x - meeting, 0.0) + after * np.maximum(x - meeting, 0.0)
    level = float(np.mean(ratio - shape))
    ends = np.array([x[0], meeting, x[-1]])
    lines = level + before * np.minimum(ends - meeting, 0.0) + after * np.maximum(ends - meeting, 0.0)
    axes.semilogx(10.0**ends, lines, color=ORANGE, lw=1.5, label=f"yield at {10.0**meeting:.3g} MPa, C = {-after:.2g}")
    axes.legend(loc="lower left")


def _draw_breakage(axes: Any, levels: xarray.Dataset) -> None:
    """Share of broken bonds, and number of fragments, at the end of each level."""
    stress = levels.normal_stress.values / 1e6
    axes.semilogx(stress, 100.0 * levels.broken_share.values, "o-", ms=4, lw=0.8, color=ORANGE)
    axes.set(xlabel="normal stress [MPa]", title="(b) breakage", ylim=(0, None))
    axes.set_ylabel("bonds broken [%]", color=ORANGE)
    number = axes.twinx()
    number.semilogx(stress, levels.fragment_count.values, "--", lw=1.3, color=BLUE)
    number.set_ylim(bottom=0)
    number.set_ylabel("fragments (dashed)", color=BLUE)
    number.spines["right"].set_visible(True)
