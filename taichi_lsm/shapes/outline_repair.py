"""Simple outlines from lists of points: doubled points, spikes, points out of order and loops are mended."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.optimize import brentq

from ..core.errors import InputError
from .base import counted
from .geometry import cross_2d

SAME = 1e-9  # of the extent: points nearer to each other are one
NO_AREA = 1e-6  # of the squared extent
FLAW = 0.02  # share of the area that loops and pieces may have which are left out
SPIKE = 0.01  # half the width of a spike, over the extent: narrower ones are cut off
SPIKE_AREA = 0.02  # share of the area that may be cut off with them
SPIKE_HULL = 0.002  # share of the hull that they must span, else they are left
SHARPEST = 50.0  # ratio of the tip of a corner to SPIKE up to which it is no spike: corners of 2 degrees and more
BEYOND = 0.2  # of its length: a line that comes back nearer to its start is a spike
SWAPPED = 8  # outlines have more points than this for each pair of swapped neighbours
MOST_POINTS = 100_000
MOST_TANGLED = 2000  # points of an outline that crosses itself
LONGEST = 10.0  # such an outline, over that of its hull


def simple_outline(points: NDArray) -> tuple[shapely.Polygon, tuple[str, ...]]:
    """The polygon that points (k, 2) of extent 1 enclose, and what was mended; InputError if they enclose none."""
    repairs = []
    apart = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > SAME
    points = points[apart]
    if len(points) < 3 or len(points) > MOST_POINTS:
        raise InputError(f"points: {len(points)} different ones, must be from 3 to {MOST_POINTS}")
    ordered, swapped = _in_order(points)
    if swapped and shapely.Polygon(ordered).is_valid:
        points = ordered
        repairs.append(f"{counted(swapped, 'pair', 'pairs')} of swapped neighbours put in order")
    body = shapely.Polygon(points)
    if not body.is_valid:
        body, share = _untangled(points)
        repairs.append(f"crossings, overshoots or spikes of {100 * share:.2g} % of the area cut off")
    if not body.area > NO_AREA:
        raise InputError(f"points: no simple outline (area {body.area:g} of its squared extent)")
    cut = _without_spikes(body)
    if cut is not None:
        body = cut
        repairs.append(f"spikes narrower than {200 * SPIKE:g} % of the extent cut off")
    return body, tuple(repairs)


def _in_order(points: NDArray) -> tuple[NDArray, int]:
    """The points with swapped neighbours put back, and how many pairs.

    Where the lines from a to c and from b to d cross in the order a, c, b, d, the order a, b, c, d is simple there; so
    it is where b lies on the line from a to c.
    """
    a, c, b, d = (np.roll(points, -i, axis=0) for i in range(4))
    crossed = (cross_2d(c - a, b - a) * cross_2d(c - a, d - a) < 0) & (
        cross_2d(d - b, a - b) * cross_2d(d - b, c - b) < 0
    )
    on_line = np.abs(cross_2d(c - a, b - a)) < SAME * np.sum((c - a) ** 2, axis=1)
    share = np.sum((b - a) * (c - a), axis=1) / np.sum((c - a) ** 2, axis=1)
    first = np.flatnonzero((crossed | on_line) & (share > BEYOND) & (share < 1.0))
    if len(first) == 0 or SWAPPED * len(first) > len(points):
        return points, 0
    order = np.arange(len(points))
    for i in first:
        one, other = (i + 1) % len(points), (i + 2) % len(points)
        order[[one, other]] = order[[other, one]]
    return points[order], len(first)


def _untangled(points: NDArray) -> tuple[shapely.Polygon, float]:
    """The largest area that a line which crosses itself encloses in one sense, and the share of it that is in doubt.

    That is what it does not enclose just once, and in other pieces.
    """
    line = shapely.LinearRing(points).simplify(1e-4)
    long = line.length > LONGEST * line.convex_hull.length
    if long or shapely.get_num_coordinates(line) > MOST_TANGLED:
        raise InputError("points: no simple outline (they run to and fro); put them in order round the outline")
    faces = shapely.get_parts(shapely.polygonize([shapely.unary_union(line)]))
    ring = shapely.get_coordinates(line)
    turns = np.array([_turns(ring, shapely.get_coordinates(face.representative_point())[0]) for face in faces])
    area = shapely.area(faces)
    if not area[turns != 0].sum() > NO_AREA:
        raise InputError("points: no simple outline (they enclose no area)")
    sense = 1 if area[turns > 0].sum() >= area[turns < 0].sum() else -1
    pieces = shapely.get_parts(shapely.unary_union(list(faces[sense * turns > 0])))
    body = max(pieces, key=shapely.area)
    share = max(1.0 - float(body.area / area.sum()), 1.0 - float(area[turns == sense].sum() / area.sum()))
    if share > FLAW:
        raise InputError(
            f"points: no simple outline (it crosses itself, with {100 * share:.2g} % of its area in doubt); "
            "put them in order round the outline"
        )
    return shapely.Polygon(body.exterior), share


def _turns(ring: NDArray, x: NDArray) -> int:
    """How often a closed line (k, 2), its first point repeated, runs round a point (2,), counter-clockwise."""
    a, b = ring[:-1] - x, ring[1:] - x
    return round(float(np.arctan2(cross_2d(a, b), np.sum(a * b, axis=1)).sum()) / (2.0 * np.pi))


def _without_spikes(body: shapely.Polygon) -> shapely.Polygon | None:
    """The body without what is narrower than a spike, if that reaches out of it; None if nothing does.

    What shrinking by half the width takes away and growing by as much does not bring back.
    """
    hull = body.convex_hull.area
    if hull < (1.0 + SPIKE_HULL) * body.area:
        return None
    shrunk = body.buffer(-SPIKE)  # round: about the foot of a spike no corner is left that would grow into it
    opened = shrunk.buffer(1.01 * SPIKE, join_style="mitre", mitre_limit=SHARPEST).intersection(body)
    pieces = [p for p in shapely.get_parts(opened) if isinstance(p, shapely.Polygon)]
    if not pieces:
        return None
    opened = shapely.Polygon(max(pieces, key=shapely.area).exterior)
    if opened.area < (1.0 - SPIKE_AREA) * body.area or opened.convex_hull.area > (1.0 - SPIKE_HULL) * hull:
        return None
    return opened


def without_steps(body: shapely.Polygon, depth: float) -> shapely.Polygon:
    """The hull of a body drawn in to its area, if no concavity is deeper than `depth`: steps of pixels are none.

    The hull goes through the tips of the steps, and the true outline through their middle.
    """
    hull = shapely.Polygon(shapely.get_exterior_ring(body.convex_hull))
    dents = shapely.distance(hull.exterior, shapely.points(shapely.get_coordinates(body.exterior)))
    if dents.max() > depth:
        return body
    return grown_to(hull, body.area)


def grown_to(body: shapely.Polygon, area: float) -> shapely.Polygon:
    """The body with its outline moved in or out, everywhere by as much, so that it has this area."""

    def off(move: float) -> float:
        """Excess of the area after a move."""
        return shapely.area(shapely.buffer(body, move, join_style="mitre")) - area

    most = 2.0 * abs(body.area - area) / body.length
    if most == 0.0 or off(-most) >= 0.0 or off(most) <= 0.0:
        return body
    move: Any = brentq(off, -most, most, xtol=1e-9 * np.sqrt(area))
    pieces = shapely.get_parts(shapely.buffer(body, float(move), join_style="mitre"))
    return shapely.Polygon(max(pieces, key=shapely.area).exterior)
