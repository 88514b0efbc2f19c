"""Packings whose grains are coloured by a value of each: true outlines in 2D, shaded surfaces in 3D."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.plots.layer_pictures import MAP, Snapshot, draw_outlines, frame_layer, heights_of
from workflows.plots.run_files import Moment
from workflows.plots.solid_pictures import draw_solids, extent_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 99.0  # per cent of the grains that lie between the ends of the colours
WIDTH = 3.5  # of a picture, that of a column [inches]
HEIGHTS = (2.0, 5.5)  # of a picture [inches]
BESIDE = 0.55  # inches beside the layer, for the heights
ABOUT = 1.15  # inches above and below it, for the title, the lengths and the bar of the colours
BESIDE_AXES = 0.2  # inches of ABOUT for the lengths, which 3D pictures tell otherwise
TICKS = 6  # of a bar of colours, at most
Scale = dict[str, tuple[float, float]]  # ends of what pictures share by names


class Colours(NamedTuple):
    """How values become colours.

    Attributes
    ----------
    label
        What the values are, with their unit, for the bar.
    map
        Of matplotlib.
    signed
        Zero is the middle of the colours.
    whole
        The values are whole numbers, each with a colour of its own.
    """

    label: str
    map: str = MAP
    signed: bool = False
    whole: bool = False


def scale_of(moment: Moment, values: NDArray, colours: Colours) -> Scale:
    """The ends of the colours of the mobile grains' values (grain,), and of the axes [mm].

    Several moments share the least and the greatest of these.
    """
    mobile = values[moment.grains.constant("kind") != 1]
    known = mobile[np.isfinite(mobile)]
    low, high = np.percentile(known, [100.0 - MOST, MOST]) if known.size else (0.0, 1.0)
    if colours.signed:
        high = max(abs(low), abs(high))
        low = -high
    if colours.whole:
        low, high = 0.0, known.max(initial=1.0)
    low = min(low, 0.0)
    return {"colours": (float(low), float(high) if high > low else float(low) + 1.0)} | frame_of(moment)


def frame_of(moment: Moment) -> Scale:
    """The ends of the axes of a picture of the layer [mm]."""
    if moment.grains.dim == 3:
        return extent_of(moment)
    return {"y": heights_of(layer_of(moment))}


def layer_of(moment: Moment) -> Snapshot:
    """The outlines of a 2D layer, about the places of the grains within the period."""
    frame, outlines = moment.grains, moment.run.snapshots.outlines
    period = 1e3 * frame.cell.matrix[0, 0]
    position = 1e3 * frame.position[:, :2]
    if frame.cell.periodic[0]:
        position[:, 0] %= period
    else:
        position[:, 0] -= 1e3 * frame.cell.origin[0]
    around = [1e3 * vertices for vertices in outlines.around_centres(frame.dataset)]
    return Snapshot(around, position, frame.velocity[:, 0], frame.constant("kind") == 1, period, frame.grain)


def draw(figure: Figure, moment: Moment, values: NDArray, colours: Colours, scale: Scale) -> None:
    """Draw a packing with a bar of its colours below it; values: (grain,) of the snapshot."""
    from matplotlib.ticker import MaxNLocator

    axes = layer_axes(figure, moment, scale)
    bar = _bar(colours, scale["colours"])
    if moment.grains.dim == 3:
        draw_solids(axes, moment, bar.to_rgba(values)[:, :3], scale)
    else:
        draw_outlines(axes, layer_of(moment), values, scale["colours"], bar.cmap)
    # By the ends alone, so that the bar is the same in all frames of a film.
    beyond = "neither" if colours.whole else "max" if scale["colours"][0] == 0.0 else "both"
    drawn = figure.colorbar(bar, ax=axes, location="bottom", fraction=0.08, pad=0.03, aspect=30, extend=beyond)
    drawn.set_label(colours.label)
    drawn.locator = MaxNLocator(TICKS, integer=colours.whole)
    drawn.minorticks_off()
    drawn.update_ticks()


def layer_axes(figure: Figure, moment: Moment, scale: Scale, about: float = ABOUT) -> Any:
    """Axes of a layer with its title, in a figure that becomes as high as the layer needs; about: inches around it."""
    if moment.grains.dim == 3:
        (left, right), (low, high) = scale["across"], scale["up"]
        wide, beside, about = right - left, 0.1, about - BESIDE_AXES
    else:
        low, high = scale["y"]
        wide, beside = 1e3 * moment.grains.cell.matrix[0, 0], BESIDE
    height = (WIDTH - beside) * (high - low) / wide + about
    figure.set_size_inches(WIDTH, float(np.clip(height, *HEIGHTS)))
    axes = figure.subplots()
    if moment.grains.dim == 3:
        figure.suptitle(moment.words, x=0.02, ha="left")
    else:
        axes.set_title(moment.words)
        frame_layer(axes, wide, low, high)
        axes.locator_params(nbins=TICKS)
    return axes


def _bar(colours: Colours, ends: tuple[float, float]) -> Any:
    """What gives values their colours."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, Normalize

    if not colours.whole:
        return ScalarMappable(Normalize(*ends), colours.map)
    borders = np.arange(-0.5, ends[1] + 1.0)
    shades = matplotlib.colormaps[colours.map].resampled(len(borders) - 1)
    return ScalarMappable(BoundaryNorm(borders, len(borders) - 1), shades)
