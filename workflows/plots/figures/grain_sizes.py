"""Sizes of the grains, and their shapes: outlines of some of them, and how elongated they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflows.plots.canvas import BLUE, GREEN, ORANGE
from workflows.plots.run_files import RunFiles
from workflows.plots.solid_pictures import basis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("grains",)
SIZE = (3.5, 4.9)
MOST_SHAPES = 8  # outlines that are drawn in a row
BINS = 20


def draw_run(figure: Figure, run: RunFiles) -> None:
    """Draw the histograms of the mobile grains and, unless all are round, their shapes."""
    grains = run.snapshots.dataset
    mobile = grains.kind.values != 1
    index, size = grains.shape_index.values[mobile], 1e3 * grains.shape_scale.values[mobile]
    shapes, count = np.unique(index, return_counts=True)
    round_ = all(len(run.snapshots.outlines.surfaces[s].radius) == 1 for s in shapes)
    what = "pieces of the grains" if "bond" in grains.sizes else "grains"
    if round_:
        figure.set_size_inches(SIZE[0], 2.6)
        axes = figure.subplots()
        _draw_sizes(axes, size)
        axes.set_title(f"sizes of the {len(size)} mobile {what}, all round")
        return
    sizes, outlines, elongations = figure.subplots(3, 1, height_ratios=(1.0, 0.3, 1.0))
    _draw_sizes(sizes, size)
    sizes.set_title(f"(a) sizes of the {len(size)} mobile {what}")
    of_shape = {int(s): ends_of(run, int(s)) for s in shapes}
    _draw_shapes(outlines, run, of_shape)
    values = np.array([of_shape[int(s)] for s in index])
    elongations.hist(values, bins=np.linspace(0.0, 1.0, BINS + 1), color=GREEN, alpha=0.8)
    elongations.set(xlim=(0, 1), xlabel="shortest / longest axis [1]", ylabel="number of grains")
    elongations.set_title(f"(c) elongation, mean {values.mean():.2f}")


def _draw_sizes(axes: Any, size: NDArray) -> None:
    """Histogram of sizes [mm]; grains of one size are one bar."""
    from matplotlib.ticker import MaxNLocator

    spread = np.ptp(size) > 1e-6 * size.mean()
    bins = np.linspace(size.min(), size.max(), BINS + 1) if spread else size.mean() * np.array([0.95, 1.05])
    axes.hist(size, bins=bins, color=BLUE, alpha=0.8)
    axes.axvline(size.mean(), color=ORANGE, lw=1.2, ls="--", label=f"mean {size.mean():.3g} mm")
    axes.set(xlabel="equivalent diameter [mm]", ylabel="number of grains")
    axes.set_ylim(0.0, 1.25 * axes.get_ylim()[1])
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.legend(loc="upper right")


def ends_of(run: RunFiles, shape: int) -> float:
    """Shortest over longest axis of a shape [1], by the second moments of the points of its surface about their mean.

    Points count by the length or the area of the surface around them.
    """
    outlines = run.snapshots.outlines
    x = np.asarray(outlines.vertices_of(shape))
    if outlines.dim == 2:
        along = np.roll(x, -1, axis=0) - x
        middle, weight = x + 0.5 * along, np.linalg.norm(along, axis=1)
    else:
        a, b, c = (x[outlines.shapes[shape][1][:, i]] for i in range(3))
        middle, weight = (a + b + c) / 3.0, np.linalg.norm(np.cross(b - a, c - a), axis=1)
    middle = middle - np.average(middle, axis=0, weights=weight)
    moments = np.linalg.eigvalsh((weight[:, None] * middle).T @ middle)
    return float(np.sqrt(moments[0] / moments[-1]))


def _draw_shapes(axes: Any, run: RunFiles, elongation: dict[int, float]) -> None:
    """Outlines of shapes in a row, of equal area, from the most to the least elongated one; in 3D as they are seen."""
    from matplotlib.collections import PolyCollection
    from scipy.spatial import ConvexHull

    ordered = sorted(elongation, key=lambda shape: elongation[shape])
    chosen = [ordered[i] for i in np.unique(np.linspace(0, len(ordered) - 1, MOST_SHAPES).round().astype(int))]
    outlines, drawn, at = run.snapshots.outlines, [], 0.0
    for shape in chosen:
        x = np.asarray(outlines.vertices_of(shape))
        if outlines.dim == 3:
            x = x @ basis()[:2].T
            x = x[ConvexHull(x).vertices]
        drawn.append(x + np.array([at - x[:, 0].min(), 0.0]))
        at += np.ptp(x[:, 0]) + 0.2
    axes.add_collection(PolyCollection(drawn, facecolor="0.85", edgecolor="black", lw=0.7))
    axes.set(xlim=(-0.1, at - 0.1), aspect="equal")
    axes.set_ylim(min(x[:, 1].min() for x in drawn) - 0.1, max(x[:, 1].max() for x in drawn) + 0.1)
    axes.set_axis_off()
    seen = "outlines" if outlines.dim == 2 else "outlines as seen from one side"
    axes.set_title(f"(b) {len(chosen)} of {len(elongation)} shapes, {seen}")
