"""A polygon cut into few convex pieces, as far as a tolerance asks: what a non-convex outline is made of.

Hollow stretches are first drawn with few corners, by chords that stand out by less than the tolerance. Each re-entrant
corner that is left gets one cut, the deepest below the hull of its piece first. Of the cuts that are tried, to other
re-entrant corners and to places on sides, the one is taken that leaves the fewest re-entrant corners, then the one that
is short and halves its corner. Last, pieces whose common hull lies within the outline become one: the arms of a cross
on two sides of its middle are a bar again. Pieces may therefore overlap.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from .geometry import cross_2d

CLEARANCE = 0.08  # sizes: a cut ends no nearer than this to a sharp corner, where the side is long enough
BLUNT = 0.5  # rad: corners that turn by less are of a smooth outline; they only keep a share of the side
BLUNT_SHARE = 0.15
LENGTH_PRICE = 0.3  # of a cut of one size, in re-entrant corners left
OUTER_PRICE = 0.1  # of an end at a smooth place of the outline, where the grain gets a step
TURN_PRICE = 0.3  # of a cut along a side: rounded ends of parts have no place there
NEAR = 1e-7  # sizes: points nearer than this are one
STRAIGHT = 1e-9  # rad: a corner that turns by less is none
SHALLOW = 1e-3  # sizes: re-entrant corners less deep stay, their pieces become hulls
MERGE_SHARE = 0.003  # of the area: by how much the hull of two pieces may stand out of the outline


def convex_pieces(body: BaseGeometry, tolerance: float) -> tuple[list[NDArray], shapely.Polygon]:
    """Corners (k, 2) of convex pieces, counter-clockwise, that cover a polygon of size about 1 without holes.

    And the polygon that they cover, with its hollow stretches drawn by chords: larger by less than `tolerance`.
    """
    ring = _few_hollow_corners(_ring(body), tolerance)
    filled = shapely.Polygon(ring)
    waiting, pieces = [ring], []
    while waiting:
        ring = waiting.pop()
        depth = _depths(ring)
        cut = _best_cut(ring, int(np.argmax(depth)), filled) if depth.max() > SHALLOW else None
        if cut is None:
            pieces.append(_hull(ring))
        else:
            waiting.extend(cut)
    return _merged(pieces, filled, tolerance), filled


def _ring(polygon: BaseGeometry) -> NDArray:
    """Corners (k, 2), counter-clockwise, the first not repeated, without straight ones."""
    return _bent(shapely.get_coordinates(shapely.orient_polygons(polygon))[:-1])


def _bent(ring: NDArray) -> NDArray:
    """The ring without repeated points and straight corners."""
    ring = ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > NEAR]
    return ring[np.abs(_turns(ring)) > STRAIGHT]


def _hull(ring: NDArray) -> NDArray:
    """Corners (m, 2) of the convex hull of points (k, 2), counter-clockwise."""
    return _ring(shapely.MultiPoint(ring).convex_hull)


def _turns(ring: NDArray) -> NDArray:
    """Exterior angle (k,) [rad] at each corner, negative at re-entrant ones."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.arctan2(cross_2d(before, after), np.sum(before * after, axis=1))


def _depths(ring: NDArray) -> NDArray:
    """Depth (k,) of each re-entrant corner below the hull of the ring; 0 for other corners."""
    border = shapely.LinearRing(_hull(ring))
    return np.where(_turns(ring) < 0.0, shapely.distance(border, shapely.points(ring)), 0.0)


def _few_hollow_corners(ring: NDArray, tolerance: float) -> NDArray:
    """The ring whose runs of re-entrant corners keep only those that chords within the tolerance need."""
    hollow = _turns(ring) < 0.0
    if not hollow.any():
        return ring
    ring, hollow = (np.roll(a, -int(np.argmin(hollow)), axis=0) for a in (ring, hollow))  # begins with no hollow corner
    kept, k, count = [ring[0]], 0, len(ring)
    while k < count - 1:
        # The farthest corner to which a chord passes none but hollow corners, and near all of them.
        end = k + 1
        while end < count and hollow[end] and _sag(ring[np.arange(k, end + 2) % count]) < tolerance:
            end += 1
        k = end
        if k < count:
            kept.append(ring[k])
    return _bent(np.array(kept))


def _sag(run: NDArray) -> float:
    """Greatest distance of the points (k, 2) of a line from the chord between its ends."""
    along = (run[-1] - run[0]) / np.linalg.norm(run[-1] - run[0])
    return float(np.abs(cross_2d(run - run[0], along)).max())


def _best_cut(ring: NDArray, start: int, body: shapely.Polygon) -> list[NDArray] | None:
    """The two rings of the best cut from a corner, None if no cut stays inside."""
    inside = shapely.Polygon(ring).buffer(NEAR)
    best, least = None, np.inf
    for end, share in _cut_ends(ring, start):
        point = ring[end] + share * (ring[(end + 1) % len(ring)] - ring[end])
        line = shapely.LineString([ring[start], point])
        if line.length < 100 * NEAR or not inside.covers(line):
            continue
        halves = [_bent(half) for half in _halves(ring, start, end, share, point)]
        if any(len(half) < 3 or shapely.Polygon(half).area < 1e-6 for half in halves):
            continue
        price = sum(int((_depths(half) > SHALLOW).sum()) for half in halves) + LENGTH_PRICE * line.length
        if share > 0.0:
            price += OUTER_PRICE if body.exterior.distance(shapely.Point(point)) < NEAR else 0.0
            price += TURN_PRICE * (1.0 - _least_turn(ring, start, point))
        if price < least:
            best, least = halves, price
    return best


def _cut_ends(ring: NDArray, start: int) -> list[tuple[int, float]]:
    """Where a cut from a corner may end: (row, share of the side after corner `row`), the share 0 being the corner."""
    count, turn, here = len(ring), _turns(ring), ring[start]
    ends = [(k, 0.0) for k in range(count) if turn[k] < 0.0 and k != start]
    halving = np.sum([(here - x) / np.linalg.norm(here - x) for x in (ring[start - 1], ring[(start + 1) % count])], 0)
    for k in range(count):
        if k not in (start, (start - 1) % count):
            a, along = ring[k], ring[(k + 1) % count] - ring[k]
            length = float(np.linalg.norm(along))
            sharp = max(turn[k], turn[(k + 1) % count]) > BLUNT
            clear = min(CLEARANCE / length, 0.5) if sharp else BLUNT_SHARE
            shares = {0.5, clear, 1.0 - clear, float((here - a) @ along) / length**2}
            if abs(cross_2d(halving, along)) > STRAIGHT:
                shares.add(float(cross_2d(here - a, halving) / cross_2d(along, halving)))
            ends += [(k, s) for s in sorted(shares) if clear <= s <= 1.0 - clear]
    return ends


def _halves(ring: NDArray, start: int, end: int, share: float, point: NDArray) -> list[NDArray]:
    """The two rings on both sides of the cut from corner `start` to a point at or after corner `end`."""
    rolled = np.roll(ring, -start, axis=0)
    k = (end - start) % len(ring)
    first = rolled[: k + 1] if share == 0.0 else np.concatenate([rolled[: k + 1], [point]])
    return [first, np.concatenate([rolled[:1], [point], rolled[k + 1 :]])]


def _least_turn(ring: NDArray, start: int, point: NDArray) -> float:
    """Angle between a cut and the nearer of the two sides of its corner, drawn out beyond it, over the most it can be.

    That is half the angle by which the corner turns back.
    """
    here = ring[start]
    cut = (point - here) / np.linalg.norm(point - here)
    out = [(here - x) / np.linalg.norm(here - x) for x in (ring[start - 1], ring[(start + 1) % len(ring)])]
    least = min(float(np.arccos(np.clip(o @ cut, -1.0, 1.0))) for o in out)
    return min(1.0, 2.0 * least / float(np.arccos(np.clip(out[0] @ out[1], -1.0, 1.0 - 1e-12))))


def _merged(pieces: list[NDArray], body: shapely.Polygon, tolerance: float) -> list[NDArray]:
    """The pieces, two of which are one where their hull stands out of the body by hardly anything."""
    room, border = body.buffer(tolerance), body.exterior.buffer(NEAR)
    for i in range(len(pieces)):
        for j in range(i):
            whole = shapely.MultiPoint(np.concatenate([pieces[i], pieces[j]])).convex_hull
            if not room.covers(whole) or whole.difference(body).area > MERGE_SHARE * body.area:
                continue
            rest = [p for k, p in enumerate(pieces) if k not in (i, j)]
            rest = [p for p in rest if not whole.buffer(NEAR).covers(shapely.Polygon(p))]
            # Two pieces along the same stretch of the outline would both resist there.
            stretch = shapely.boundary(whole).intersection(border).buffer(NEAR)
            if all(shapely.Polygon(p).exterior.intersection(border & stretch).length < 100 * NEAR for p in rest):
                return _merged([*rest, _ring(whole)], body, tolerance)
    return pieces
