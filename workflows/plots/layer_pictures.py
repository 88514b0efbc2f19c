"""Pictures of a sheared layer: the true outlines of the grains in grains.nc, coloured by velocity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm

SEGMENTS = 32  # chords in a quarter of a circle, in sections
MAP = "cividis"  # stays in order for colour-blind eyes and in grey
FAULT = "#D55E00"
MIDDLE = "through the middle"
BEYOND = 0.2  # of the height of the layer, shown at most beyond the platens
BAR_WIDTH = 0.05  # of the bar of the colours, over the longer side of the layer
ARROW_SPACE = 0.08  # of the height of the layer, for the direction of the shear above it
BAR = "velocity along the shear /\nvelocity of the top platen [1]"  # in two lines: one would be longer than the bar


class Snapshot(NamedTuple):
    """Grains at one instant, ready to be drawn."""

    outlines: list  # per grain the outline (points, 2) about its centre [mm]
    position: np.ndarray  # (grain, 2) [mm], x within the period
    velocity: np.ndarray  # (grain,) along the shear over that of the top platen [1]
    glued: np.ndarray  # (grain,) bool
    period: float  # along x [mm]
    number: np.ndarray  # (grain,) persistent
    is_section: bool = False  # of a 3D layer, which does not cut all its grains


def section_words(dim: int, where: str = MIDDLE) -> str:
    """What a title says of a 3D layer: that what is drawn is a section, whose grains look smaller than they are."""
    return f"section {where}" if dim == 3 else ""


def read_snapshot(path: Path, index: int = -1, through: int | None = None) -> Snapshot:
    """Snapshot `index` of the file grains.nc at `path`; in 3D a section along the shear.

    The positions on file are unwrapped; the file names the lengths of the periodic axes.

    Parameters
    ----------
    path, index
        Of the file; of the snapshot in it.
    through
        Number of the grain through whose centre the section goes; None, or a grain whose position is not known: through
        the middle of the width.

    Raises
    ------
    InputError
        If the file has no snapshot, or no grain of it is anywhere.
    """
    grains = lsm.open_run(Path(path))
    if not grains.sizes["time"]:
        raise lsm.InputError(f"{path}: holds no snapshot yet, which a picture of the layer needs")
    now = grains.isel(time=index)
    period = 1e3 * np.atleast_1d(grains.attrs["periodic_lengths"])
    plane = np.nan if through is None or now.sizes["space"] == 2 else 1e3 * float(now.position[through, 2])
    # A run that went wrong may have left grains that are nowhere.
    finite = [np.isfinite(now[name].values).all(axis=1) for name in ("position", "velocity")]
    number = np.flatnonzero(np.all(finite, axis=0))
    if not number.size:
        raise lsm.InputError(f"{path}: no grain of the snapshot has a finite position and velocity, so none is drawn")
    now = now.isel(grain=number)
    position, velocity, glued = 1e3 * now.position.values, now.velocity.values[:, 0], now.kind.values == 1
    velocity = over_top(velocity, position[:, 1], glued)
    if "cell_height" in now:
        position, velocity = _in_cell(now, position)
        period = np.delete(period, 1)
    if len(period) == 1:
        outlines = [1e3 * vertices for vertices in lsm.GrainOutlines(grains).around_centres(now)]
    else:
        plane = plane if np.isfinite(plane) else 0.5 * period[1]
        off = np.mod(position[:, 2] - plane + 0.5 * period[1], period[1]) - 0.5 * period[1]
        outlines = _sections(grains, now, off)
        cut = np.array([o is not None for o in outlines])
        outlines = [o for o in outlines if o is not None]
        position, velocity, glued, number = position[cut, :2], velocity[cut], glued[cut], number[cut]
    position[:, 0] %= period[0]
    return Snapshot(outlines, position, velocity, glued, period[0], number, len(period) > 1)


def over_top(velocity: np.ndarray, height: np.ndarray, glued: np.ndarray) -> np.ndarray:
    """Velocities (grain,) over that of the glued grains at the top, as they are where these are none or at rest."""
    platens = height[glued] if glued.any() else height
    upper = velocity[glued & (height > platens.mean())]
    return velocity / ((upper.mean() if upper.size else 0.0) or 1.0)


def _in_cell(now, position):
    """Images of the grains within a sheared cell [mm], and their velocities along the shear over its upper border's."""
    height, shift = 1e3 * float(now.cell_height), 1e3 * float(now.cell_shift)
    turns, flow = np.floor(position[:, 1] / height), float(now.cell_shear_rate) * float(now.cell_height)
    inside = position.copy()
    inside[:, 1] -= turns * height
    inside[:, 0] -= turns * shift
    return inside, (now.velocity.values[:, 0] - turns * flow) / (flow or 1.0)


def _sections(grains, now, off):
    """Outline (points, 2) [mm] of every 3D grain in a plane `off` [mm] below its centre, None if they do not meet.

    A grain is the intersection of the balls of its faces, so its section is an intersection of discs.
    """
    import shapely

    centre, radius = grains.patch_centre.values, grains.patch_radius.values
    ends = np.cumsum(grains.patch_count.values)
    scale, reach = 1e3 * now.shape_scale.values, 1e3 * now.bounding_radius.values
    result = []
    for g, s in enumerate(now.shape_index.values):
        if abs(off[g]) >= reach[g]:
            result.append(None)
            continue
        own = slice(ends[s] - grains.patch_count.values[s], ends[s])
        p, r = centre[own], radius[own]
        p, r = p[(p**2).sum(axis=1) <= r**2], r[(p**2).sum(axis=1) <= r**2]  # vertices do not hold the centre
        if "orientation" in now:
            p = Rotation.from_quat(now.orientation.values[g], scalar_first=True).apply(p)
        square = (scale[g] * r) ** 2 - (scale[g] * p[:, 2] + off[g]) ** 2
        discs = shapely.buffer(
            shapely.points(scale[g] * p[:, :2]), np.sqrt(np.maximum(square, 0.0)), quad_segs=SEGMENTS
        )
        section = shapely.intersection_all(discs)
        result.append(None if section.is_empty else shapely.get_coordinates(shapely.get_exterior_ring(section)))
    return result


def bar_beside(axes: Any) -> Any:
    """Axes for a colour bar at the right border of a layer, whose width follows from its shape; of its height."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    width = BAR_WIDTH * max(1.0, (high - low) / (right - left))  # a bar on a narrow layer would be a line
    return axes.inset_axes((1.0 + width, 0.0, width, 1.0))


def draw_colour_bar(figure: Any, drawn: Any, words: str = BAR, **place: Any) -> None:
    """Explain the colours of `draw_packing` in `words`: `drawn` is what it returned, `place` as matplotlib takes it."""
    figure.colorbar(drawn, extend="both", **place).set_label(words, fontsize=8.8)


def draw_packing(axes: Any, snapshot: Snapshot, marked: Sequence[int] = ()) -> Any:
    """Draw the outlines coloured by velocity; returns the collection for a colour bar.

    Glued grains are white and hatched, like no colour of the map; those with the numbers `marked` are edged in red.
    """
    drawn = draw_outlines(axes, snapshot, snapshot.velocity, (0.0, 1.0), marked=marked)
    frame_layer(axes, snapshot.period, *heights_of(snapshot))
    return drawn


def draw_outlines(
    axes: Any,
    snapshot: Snapshot,
    values: np.ndarray,
    limits: tuple[float, float],
    colours: Any = MAP,
    marked: Sequence[int] = (),
) -> Any:
    """Draw the outlines of the grains, those across the border on both sides; returns the collection of the mobile.

    Parameters
    ----------
    axes, snapshot
        Where, and what; the limits of the axes are left as they are.
    values, limits
        (grain,) what colours the mobile grains, and the values at both ends of the colours.
    colours
        A map of matplotlib.
    marked
        Numbers of grains that are edged in red.
    """
    from matplotlib.collections import PolyCollection

    period, reach = snapshot.period, reach_of(snapshot)
    polygons, shown, edged = {True: [], False: []}, [], []
    placed = zip(snapshot.outlines, snapshot.position, values, snapshot.glued, snapshot.number, strict=True)
    for outline, at, value, glued, number in placed:
        # A grain across a border is drawn on both sides; the axes cut off what lies outside.
        shifts = [s for s in (-period, 0.0, period) if -reach < at[0] + s < period + reach]
        polygons[bool(glued)] += [outline + at + (shift, 0.0) for shift in shifts]
        shown += [] if glued else [value] * len(shifts)
        edged += [outline + at + (shift, 0.0) for shift in shifts] if number in marked else []
    axes.add_collection(PolyCollection(polygons[True], facecolor="white", edgecolor="0.25", lw=0.6, hatch="////////"))
    drawn = PolyCollection(polygons[False], cmap=colours, edgecolor="black", lw=0.35)
    drawn.set_array(np.array(shown))
    drawn.set_clim(*limits)
    axes.add_collection(drawn)
    axes.add_collection(PolyCollection(edged, facecolor="none", edgecolor=FAULT, lw=1.8))
    return drawn


def reach_of(snapshot: Snapshot) -> float:
    """Greatest distance of an outline from its centre [mm]."""
    return max(np.abs(o).max() for o in snapshot.outlines)


def heights_of(snapshot: Snapshot) -> tuple[float, float]:
    """Heights (low, high) [mm] between which the layer lies; a grain that has flown far away is outside."""
    y, reach = snapshot.position[:, 1], reach_of(snapshot)
    platens = y[snapshot.glued] if snapshot.glued.any() else y
    beyond = BEYOND * (platens.max() - platens.min())
    return max(y.min(), platens.min() - beyond) - reach, min(y.max(), platens.max() + beyond) + reach


def frame_layer(axes: Any, period: float, low: float, high: float) -> None:
    """Limits and labels of the axes of a layer between two heights [mm], with the direction of the shear above it.

    It stands above the upper platen: beside the title of a narrow layer is no space for it.
    """
    space = ARROW_SPACE * (high - low)
    axes.set(xlim=(0, period), ylim=(low, high + space), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    arrow = {"arrowstyle": "-|>", "color": "black", "lw": 1.4}
    at = high + 0.5 * space
    axes.annotate("shear ", (0.98 * period, at), (0.7 * period, at), ha="right", va="center", arrowprops=arrow)
