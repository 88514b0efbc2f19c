"""Force chains: a line through every contact, as wide as its normal force is large, those of chains in a colour."""

from __future__ import annotations

from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.plots.canvas import BLUE, ORANGE
from workflows.plots.layer_pictures import draw_outlines
from workflows.plots.packing import Scale, frame_of, layer_axes, layer_of
from workflows.plots.run_files import Moment
from workflows.plots.run_panels import prefixed
from workflows.plots.solid_pictures import basis, box_of, clear_axes, corners_of, draw_box, draw_directions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("grains", "contacts")
SIZE = (3.5, 3.5)
MOST = 99.5  # per cent of the contacts whose force is below that of the widest line
WIDEST, LEAST = 4.5, 0.25  # widths of lines [points]
BEYOND = 1.3  # width of a line over the widest one, at most
ABOUT = 1.3  # inches above and below the layer, for the title, the lengths and the legend
WEAK, TENSION = "0.45", ORANGE


def scale_of(moment: Moment) -> Scale:
    """Ends of the force that the widths of lines show [N], and of the axes."""
    force = np.abs(moment.touching.normal_force.values)
    ends = frame_of(moment)
    if moment.grains.dim == 3:
        corners = corners_of(box_of(moment)) @ basis().T
        for axis, name in enumerate(ends):
            seen = corners[:, axis]
            ends[name] = (min(ends[name][0], float(seen.min())), max(ends[name][1], float(seen.max())))
    return {"force": (0.0, float(np.percentile(force, MOST)) if force.size else 0.0)} | ends


def draw_moment(figure: Figure, moment: Moment, scale: Scale) -> None:
    """Draw the lines over pale grains, those of `lsm.force_chains` in a colour; in 3D without the grains."""
    axes, force = layer_axes(figure, moment, scale, ABOUT), moment.touching.normal_force.values
    begin, end = lines_of(moment)
    if moment.grains.dim == 3:
        clear_axes(axes, scale)
        draw_box(axes, moment)
        draw_directions(axes, moment, scale)
        view = basis().T[:, :2]
        begin, end = begin @ view, end @ view
    else:
        draw_grains(axes, moment)
    chain = lsm.force_chains(moment.all_grains, contacts=moment.touching).contact_chain.values >= 0
    kinds = [
        ("contact", (force >= 0.0) & ~chain, WEAK),
        ("link of a force chain", (force >= 0.0) & chain, BLUE),
        ("tension", force < 0.0, TENSION),
    ]
    for name, which, colour in kinds:
        if which.any():
            _draw_lines(axes, begin[which], end[which], width_of(force[which], scale), colour, name)
    _draw_legend(figure, axes, scale["force"][1])


def lines_of(moment: Moment) -> tuple[NDArray, NDArray]:
    """Ends (line, dim) [mm] of the lines of the contacts: from centre to centre, or to a wall.

    A line across a border of the cell is drawn from either grain: the rows of the contacts come twice, in their order,
    as begin and end of the line of the first grain, then of that of the second.
    """
    contacts, frame = moment.touching, moment.grains
    place = np.full((moment.run.snapshots.dataset.sizes["grain"], frame.dim), np.nan)
    place[frame.grain] = layer_of(moment).position if frame.dim == 2 else 1e3 * frame.position
    branch = 1e3 * contacts.branch.values
    first = place[contacts.first_id.values]
    second = np.where((contacts.second_id.values >= 0)[:, None], place[contacts.second_id.values], first + branch)
    return np.stack([first, second - branch], axis=1), np.stack([first + branch, second], axis=1)


def width_of(force: NDArray, scale: Scale) -> NDArray:
    """Widths of lines [points]."""
    share = np.abs(force) / (scale["force"][1] or 1.0)
    return LEAST + (WIDEST - LEAST) * np.minimum(share, BEYOND)


def draw_grains(axes: Any, moment: Moment) -> None:
    """The grains of a 2D layer, pale."""
    from matplotlib.colors import ListedColormap

    layer = layer_of(moment)
    pale = draw_outlines(axes, layer, np.zeros(len(layer.outlines)), (0.0, 1.0), ListedColormap(["0.95"]))
    pale.set(edgecolor="0.75", linewidth=0.3)


def _draw_lines(axes: Any, begin: NDArray, end: NDArray, width: NDArray, colour: str, name: str) -> None:
    """Draw lines with their images beyond the borders along x of a 2D layer; begin, end: (line, 2, 2)."""
    from matplotlib.collections import LineCollection

    # The widest lines last, on top.
    order = np.argsort(width)
    lines = np.stack([begin, end], axis=2)[order]  # [line, image, end, axis]
    apart = np.linalg.norm(lines[:, 0] - lines[:, 1], axis=(1, 2)) > 1e-6 * np.ptp(lines)
    drawn = np.concatenate([lines[:, 0], lines[apart, 1]])
    widths = np.concatenate([width[order], width[order][apart]])
    axes.add_collection(LineCollection(list(drawn), linewidths=widths, colors=colour, capstyle="round", label=name))


def _draw_legend(figure: Figure, axes: Any, most: float) -> None:
    """What the widths and the colours mean, below the layer."""
    from matplotlib.lines import Line2D

    unit, factor = prefixed(most, "N")
    step = float(f"{0.5 * factor * most:.1g}")
    samples = [
        Line2D([], [], color=WEAK, lw=_width(k * step / factor, most), label=f"{k * step:g} {unit}")
        for k in (0.5, 1, 2)
    ]
    kinds = [
        Line2D([], [], color=lines.get_edgecolor()[0], lw=2.0, label=lines.get_label())
        for lines in axes.collections
        if not str(lines.get_label()).startswith("_")
    ]
    rows = zip_longest(samples, kinds, fillvalue=Line2D([], [], lw=0.0, label=" "))  # columns come first
    handles = [one for pair in rows for one in pair]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, handlelength=1.6, columnspacing=1.2)


def _width(force: float, most: float) -> float:
    return float(width_of(np.array(force), {"force": (0.0, most)}))
