"""Convex pieces grown into each other, so that rounding takes nothing from the outside of a grain (2D).

A part is an intersection of half-planes: its sides on the outline, its cuts moved out by `push`, and, where a cut ends
at a smooth place of the outline, a step. There both parts would lie on the same curve and resist together. One of them,
the owner, keeps the outline up to its rounded end; the other is drawn in below it by DRAWN_IN and comes back to the
outline with the slope RISE. What a probe then meets is a small step, a re-entrant corner, in place of a stretch where
the stiffness is doubled.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import HalfspaceIntersection

from .geometry import cross_2d

DRAWN_IN = 0.006  # equivalent diameters: by which a part lies below the end of its neighbour
RISE = 0.06  # slope with which it comes back
PUSH = 1.5  # corner radii by which cuts move out: more than rounding takes at a right angle
SHARES = (1.0, 0.6, 0.3, 0.0)  # of the push, tried until the part stays within the grain
ON = 1e-6  # sizes: points nearer than this to the outline lie on it
STAND_OUT = 1e-5  # of the area, by which a grown part may leave the grain and its own piece


@dataclass
class Piece:
    """A convex piece: corners (k, 2) counter-clockwise, and for the side after each its outward normal and distance.

    own (k,): which sides lie on the outline, at least in places; steps: half-planes (normal, distance) that draw it in.
    """

    corner: NDArray
    normal: NDArray
    distance: NDArray
    own: NDArray
    steps: list[tuple[NDArray, float]] = field(default_factory=list)

    @property
    def area(self) -> float:
        """Area of the piece."""
        return 0.5 * float(cross_2d(self.corner, np.roll(self.corner, -1, axis=0)).sum())


def grown_pieces(rings: list[NDArray], body: shapely.Polygon, radius: float) -> list[NDArray]:
    """Corners of the parts to be rounded with `radius`, from those of the pieces (k, 2) of a body of size 1."""
    pieces = [_piece(ring, body) for ring in rings]
    _add_steps(pieces, body, radius)
    return [_grown(piece, body, PUSH * radius) for piece in pieces]


def _piece(ring: NDArray, body: shapely.Polygon) -> Piece:
    """The piece of these corners; a side is a cut if all of it lies inside the body."""
    side = np.roll(ring, -1, axis=0) - ring
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.linalg.norm(side, axis=1, keepdims=True)
    along = ring[:, None] + side[:, None] * np.linspace(0.02, 0.98, 25)[:, None]
    points = shapely.points(along.reshape(-1, 2))
    inside = shapely.contains(body, points) & (shapely.distance(body.exterior, points) > ON)
    own = np.asarray(~inside.reshape(len(ring), -1).all(axis=1))
    return Piece(ring, normal, np.sum(normal * ring, axis=1), own)


def _smooth_ends(piece: Piece, body: shapely.Polygon) -> list[tuple[int, int, NDArray]]:
    """(row of a cut, row of the side of the outline beside it, their corner) where the outline is not re-entrant."""
    count, outline = len(piece.corner), shapely.get_coordinates(body.exterior)[:-1]
    before, after = outline - np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0) - outline
    hollow = outline[cross_2d(before, after) < 0.0]
    ends = []
    for cut in np.flatnonzero(~piece.own):
        for side, corner in (((cut - 1) % count, cut), ((cut + 1) % count, (cut + 1) % count)):
            x = piece.corner[corner]
            smooth = not len(hollow) or np.linalg.norm(hollow - x, axis=1).min() > ON
            if piece.own[side] and smooth and body.exterior.distance(shapely.Point(x)) < ON:
                ends.append((int(cut), int(side), x))
    return ends


def _add_steps(pieces: list[Piece], body: shapely.Polygon, radius: float) -> None:
    """Draw in the smaller of two pieces at each smooth place of the outline where a cut between them ends."""
    ends = [(i, *end) for i, piece in enumerate(pieces) for end in _smooth_ends(piece, body)]
    for i, _, side, x in ends:
        piece = pieces[i]
        beside = [e for e in ends if e[0] != i and np.linalg.norm(e[3] - x) < ON]
        for j, cut, owned, _ in beside:
            owner = pieces[j]
            if (owner.area, j) < (piece.area, i):  # of two of one area the later one is the owner
                continue
            # The owner's surface ends where its rounding begins: `push` beyond the corner less the tangent of the arc.
            turn = np.arccos(np.clip(owner.normal[cut] @ owner.normal[owned], -1.0, 1.0))
            reach = radius * (PUSH / max(np.sin(turn), 0.5) - np.tan(0.5 * turn))
            # Towards the owner along the outline.
            n = piece.normal[side]
            towards = np.array([-n[1], n[0]])
            towards *= np.sign(towards @ (x - piece.corner.mean(axis=0)))
            end = x - reach * towards
            slope = n + RISE * towards
            length = float(np.linalg.norm(slope))
            piece.steps.append((slope / length, float(slope @ end - DRAWN_IN) / length))


def _grown(piece: Piece, body: shapely.Polygon, push: float) -> NDArray:
    """Corners (k, 2) of the piece with its cuts moved out by `push`, or by as much of it as stays within the grain."""
    room = body.union(shapely.Polygon(piece.corner)).buffer(ON)
    corners = piece.corner
    for share in SHARES:
        distance = piece.distance + np.where(piece.own, 0.0, share * push)
        rows = np.column_stack([piece.normal, -distance])
        rows = np.concatenate([rows, *([[*n, -d]] for n, d in piece.steps)])
        found = HalfspaceIntersection(rows, piece.corner.mean(axis=0)).intersections
        hull = shapely.MultiPoint(found).convex_hull
        corners = shapely.get_coordinates(shapely.orient_polygons(hull))[:-1]
        if hull.difference(room).area < STAND_OUT * body.area:
            break
    return corners
