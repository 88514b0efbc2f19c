"""The common part of balls: its faces, edges and vertices, and the cones of normals that they own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .geometry import even_directions

MERGE = 1e-9  # of the size: vertices nearer than this are one, edges shorter than this are none
GUARD_DIRECTIONS = 3000  # among which false normals of a face are sought
PAIRS = 1000  # of balls whose circles are cut at once: bounds the memory
LONGEST_EDGE = np.radians(120.0)  # of an edge's arc; longer ones are cut, for a wedge must stay below pi


@dataclass(frozen=True)
class Features:
    """Features of a cell of balls, in the order faces, edges, vertices; see BallPolyhedron. Core only, no dilation.

    centre (f, 3) and radius (f,), the latter 0 but for a face: of its ball. axis (f, 3) and rho (f,): of the circle of
    an edge, the axis out of its first face. side (edges, 2): the faces of an edge. start, span (edges,) [rad]: its arc,
    measured from the first of two unit vectors, the columns of across (edges, 3, 2), towards the second. ends
    (edges, 2): its vertices, -1 at a cut. first_bound, bound, offset, beyond: cones of normals, as in BallPolyhedron.
    """

    faces: int
    edges: int
    vertices: int
    centre: NDArray
    radius: NDArray
    axis: NDArray
    rho: NDArray
    side: NDArray
    across: NDArray
    start: NDArray
    span: NDArray
    ends: NDArray
    first_bound: NDArray
    bound: NDArray
    offset: NDArray
    beyond: NDArray

    def moved(self, rotation: NDArray, shift: NDArray) -> Features:
        """Turned by a rotation matrix, then shifted."""
        return replace(
            self,
            centre=self.centre @ rotation.T + shift,
            axis=self.axis @ rotation.T,
            across=rotation @ self.across,
            bound=self.bound @ rotation.T,
        )

    def circle(self, e: int, angle: NDArray) -> NDArray:
        """Unit vectors (k, 3) from the centre of edge e's circle to its points at these angles (k,) [rad]."""
        return np.stack([np.cos(angle), np.sin(angle)], axis=1) @ self.across[e].T

    def slopes(self, e: int) -> tuple[float, float]:
        """Component along the axis of edge e of the normals that its first and its second face have there."""
        f = self.faces + e
        one, other = ((self.centre[f] - self.centre[face]) @ self.axis[f] / self.radius[face] for face in self.side[e])
        return float(one), float(other)

    def farthest(self) -> float:
        """Greatest distance of the core from the origin."""
        reach = [0.0, *np.linalg.norm(self.centre[self.faces + self.edges :], axis=1)]
        for f in range(self.faces):
            away = np.linalg.norm(self.centre[f])
            own = slice(self.first_bound[f], self.first_bound[f + 1])
            if self.bound[own].size == 0 or away == 0.0:
                reach.append(away + self.radius[f] if self.bound[own].size == 0 or away > 0 else self.radius[f])
            elif np.all(self.bound[own] @ self.centre[f] <= away * self.offset[own]):
                reach.append(away + self.radius[f])
        for e in range(self.edges):
            f = self.faces + e
            flat = self.centre[f] @ self.across[e]
            angle = np.mod(np.arctan2(flat[1], flat[0]) - self.start[e], 2.0 * np.pi)
            if angle <= self.span[e]:
                x = self.centre[f] + self.rho[f] * self.circle(e, np.array([self.start[e] + angle]))[0]
                reach.append(np.linalg.norm(x))
        return float(max(reach))


def cell_of_balls(p: NDArray, big: NDArray) -> Features:
    """Features of the intersection of the balls B(p_i, R_i), p (n, 3), big (n,).

    Each circle where two spheres meet is cut by all other balls; what is left of it are edges. InputError if the balls
    have no common part, one ball hides all others wrongly, or faces, edges and vertices do not close to a polyhedron.
    """
    kept = _not_hidden(p, big)
    p, big = p[kept], big[kept]
    if len(p) == 1:
        return _lone_ball(p, big)
    size = 2.0 * big.min()
    first, second = np.triu_indices(len(p), 1)
    blocks = range(0, len(first), PAIRS)
    edges = [edge for b in blocks for edge in _edges_of_pairs(p, big, first[b : b + PAIRS], second[b : b + PAIRS])]
    if not edges:
        raise InputError("centres, radii: the balls have no common part with an edge; move them closer together")
    faces = sorted({f for edge in edges for f in edge["side"]})
    index = {f: k for k, f in enumerate(faces)}
    # The ends of edges that belong to one vertex differ by rounding: they are merged.
    points = np.array([x for edge in edges for x in edge["tips"] if edge["tips_are_vertices"]]).reshape(-1, 3)
    vertex, of_tip = _merged(points, MERGE * size)
    ends, at = np.full((len(edges), 2), -1), 0
    for e, edge in enumerate(edges):
        if edge["tips_are_vertices"]:
            ends[e], at = of_tip[at : at + 2], at + 2
    if len(vertex) and len(vertex) - len(edges) + len(faces) != 2:
        raise InputError(
            f"centres, radii: {len(faces)} faces, {len(edges)} edges and {len(vertex)} vertices do not close "
            "(faces - edges + vertices must be 2): slivers, or faces in several pieces"
        )
    return _guarded(_assembled(p[faces], big[faces], edges, index, vertex, ends))


def _guarded(cell: Features) -> Features:
    """Add a bound to every face whose cone also holds normals on the far side of the sphere of normals.

    That happens where neighbouring balls differ in radius: their circles are then small caps. The guard is a cap about
    the face that its own normals do not reach; what lies beyond is left to a search over all features. Caps of balls of
    one radius are all convex, so that their common part is in one piece and needs none.
    """
    if np.ptp(cell.radius[: cell.faces]) == 0.0:
        return cell
    n = even_directions(GUARD_DIRECTIONS)
    p, big = cell.centre[: cell.faces], cell.radius[: cell.faces]
    guards = {}
    for f in range(cell.faces):
        own = slice(cell.first_bound[f], cell.first_bound[f + 1])
        inside = n[np.all(n @ cell.bound[own].T <= cell.offset[own], axis=1)]
        # Normals whose points on the sphere of the face lie outside another ball are not normals of the cell.
        x = p[f] + big[f] * inside
        false = (np.linalg.norm(x[:, None] - p, axis=2) > big * (1.0 + 1e-9)).any(axis=1)
        if not false.any():
            continue
        rim = np.concatenate(
            [
                cell.centre[cell.faces + e]
                + cell.rho[cell.faces + e] * cell.circle(e, cell.start[e] + cell.span[e] * np.linspace(0, 1, 9))
                - p[f]
                for e in map(int, np.flatnonzero((cell.side == f).any(axis=1)))
            ]
        )
        rim = np.concatenate([rim / big[f], inside[~false]])
        middle = rim.sum(axis=0) / np.linalg.norm(rim.sum(axis=0))
        widest, nearest = (rim @ middle).min(), (inside[false] @ middle).max()
        if nearest >= widest:
            raise InputError(f"centres, radii: face {f} cannot be told from directions that are not its own")
        guards[f] = (-middle, -0.5 * (widest + nearest))
    if not guards:
        return cell
    at = [cell.first_bound[f + 1] for f in guards]
    first_bound = cell.first_bound + np.array([sum(f < k for f in guards) for k in range(len(cell.first_bound))])
    return replace(
        cell,
        first_bound=first_bound,
        bound=np.insert(cell.bound, at, [a for a, _ in guards.values()], axis=0),
        offset=np.insert(cell.offset, at, [b for _, b in guards.values()]),
        beyond=np.insert(cell.beyond, at, [cell.beyond[cell.first_bound[f]] for f in guards]),
    )


def _not_hidden(p: NDArray, big: NDArray) -> NDArray:
    """Balls that do not hold another one whole; of equal ones the first."""
    kept = np.ones(len(p), bool)
    for i in range(len(p)):
        away = np.linalg.norm(p - p[i], axis=1)
        if np.any(away > big + big[i]):
            raise InputError(f"centres, radii: ball {i} does not meet all others, so they have no common part")
        inside = (away <= big[i] - big) & kept
        inside[i] = False
        kept[i] = not inside.any()
    return np.flatnonzero(kept)


def _lone_ball(p: NDArray, big: NDArray) -> Features:
    """A single ball: one face without a bound."""
    none, empty = np.zeros((0, 3)), np.zeros(0)
    index = np.zeros((0, 2), int)
    rows = (none, empty, empty.astype(int))
    return Features(
        1, 0, 0, p, big, np.zeros((1, 3)), np.zeros(1), index, np.zeros((0, 3, 2)), empty, empty, index,
        np.zeros(2, int), *rows,
    )  # fmt: skip


def _edges_of_pairs(p: NDArray, big: NDArray, i: NDArray, j: NDArray) -> list[dict[str, Any]]:
    """What the other balls leave of the circles where the spheres i (pairs,) meet the spheres j (pairs,)."""
    gap = p[i] - p[j]
    length = np.linalg.norm(gap, axis=1)
    met = (length > np.abs(big[i] - big[j])) & (length >= 1e-12 * big[i])
    i, j, gap, length = i[met], j[met], gap[met], length[met]
    axis = gap / length[:, None]  # out of face i: inside ball j means against it
    along = (length**2 + big[i] ** 2 - big[j] ** 2) / (2.0 * length)
    centre = p[i] - along[:, None] * axis
    rho = np.sqrt(np.maximum(big[i] ** 2 - along**2, 0.0))
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    across = np.stack([u, np.cross(axis, u)], axis=2)
    # The point of a circle at the angle t, x = centre + rho across (cos t, sin t), lies within the ball (q, R) if
    # flat . (cos t, sin t) <= limit with flat = 2 rho (centre - q) across, limit = R^2 - rho^2 - |centre - q|^2.
    off = centre[:, None] - p
    flat = 2.0 * rho[:, None, None] * off @ across
    amplitude = np.linalg.norm(flat, axis=2)
    limit = big**2 - rho[:, None] ** 2 - np.sum(off**2, axis=2)
    pairs = np.arange(len(i))
    limit[pairs, i] = limit[pairs, j] = np.inf  # the two balls of a circle do not cut it
    left = np.flatnonzero((rho > 0.0) & np.all(limit > -amplitude, axis=1))
    flat, amplitude, limit = flat[left], amplitude[left], limit[left]
    cutting = limit < amplitude
    middle = np.arctan2(flat[..., 1], flat[..., 0])  # where the circle leaves the ball farthest
    half = np.arccos(np.clip(np.divide(limit, amplitude, out=np.ones_like(limit), where=cutting), -1.0, 1.0))
    result = []
    for c, start, span, whole in _free_arcs(middle - half, 2.0 * half, cutting):
        k = left[c]
        if rho[k] * span < MERGE * 2.0 * big.min():
            continue
        ends = np.array([start, start + span])
        tips = centre[k] + rho[k] * np.stack([np.cos(ends), np.sin(ends)], axis=1) @ across[k].T
        result.append(
            {"centre": centre[k], "axis": axis[k], "rho": rho[k], "across": across[k], "side": (int(i[k]), int(j[k]))}
            | {"start": start, "span": span, "tips": tips, "tips_are_vertices": not whole}
        )
    return result


def _free_arcs(start: NDArray, span: NDArray, cutting: NDArray) -> list[tuple[int, float, float, bool]]:
    """(circle, start, span, is the whole circle) of the arcs that no interval of their circle covers.

    start, span (circles, m) [rad]: intervals; cutting (circles, m): which of them count.
    """
    full = 2.0 * np.pi
    cut = np.flatnonzero(cutting.any(axis=1))
    rows, start, span = np.arange(len(cut))[:, None], start[cut], span[cut]
    # An interval that does not count becomes a copy of one that does.
    own = np.where(cutting[cut], np.arange(start.shape[1]), np.argmax(cutting[cut], axis=1)[:, None])
    start, span = np.mod(start[rows, own], full), span[rows, own]
    order = np.argsort(start, axis=1)
    start, span = start[rows, order], span[rows, order]
    # A gap lies before a start that no interval before it reaches, those of the previous period included.
    reached = np.maximum.accumulate(start + span, axis=1)
    last = reached[:, -1:] - full
    before = np.maximum(np.concatenate([last, reached[:, :-1]], axis=1), last)
    gaps = start - before
    arcs = [(int(cut[c]), float(before[c, m]), float(gaps[c, m]), False) for c, m in np.argwhere(gaps > 0.0)]
    whole = [(int(c), 0.0, full, True) for c in np.flatnonzero(~cutting.any(axis=1))]
    return sorted(arcs + whole)


def _merged(points: NDArray, width: float) -> tuple[NDArray, NDArray]:
    """Distinct points (m, 3), their coordinates averaged, and for each given point which of them it is."""
    which = np.full(len(points), -1)
    centres = []
    for k in range(len(points)):
        if which[k] < 0:
            same = np.linalg.norm(points - points[k], axis=1) < width
            which[same & (which < 0)] = len(centres)
            centres.append(points[same].mean(axis=0))
    return np.array(centres).reshape(-1, 3), which


def _short_edges(edges: list[dict[str, Any]], ends: NDArray) -> list[dict[str, Any]]:
    """Edges cut into pieces of at most LONGEST_EDGE; `next` of a piece: those at its two cuts, None at a vertex."""
    pieces: list[dict[str, Any]] = []
    for e, edge in enumerate(edges):
        count = int(np.ceil(edge["span"] / LONGEST_EDGE - 1e-9))
        for c in range(count):
            tip = (ends[e, 0] if c == 0 else -1, ends[e, 1] if c == count - 1 else -1)
            whole = not edge["tips_are_vertices"]
            left = len(pieces) - 1 if c else len(pieces) + count - 1 if whole else None
            right = len(pieces) + 1 if c < count - 1 else len(pieces) - count + 1 if whole else None
            span = edge["span"] / count
            pieces.append(edge | {"start": edge["start"] + c * span, "span": span, "ends": tip, "next": (left, right)})
    return pieces


def _cone_bounds(
    p: NDArray, big: NDArray, pieces: list[dict[str, Any]], index: dict[int, int], vertices: int
) -> list[list[tuple[NDArray, float, int]]]:
    """Bounds (a, b, feature beyond) of the cone of every feature: n is in it if a . n <= b for all."""
    faces = len(p)
    bounds: list[list[tuple[NDArray, float, int]]] = [[] for _ in range(faces + len(pieces) + vertices)]

    def separate(f: int, g: int, a: NDArray, b: float) -> None:
        """Store that a normal with a . n > b leaves feature f for feature g, and the exact opposite at g."""
        bounds[f].append((a, b, g))
        bounds[g].append((-a, -b, f))

    for e, piece in enumerate(pieces):
        f = faces + e
        # The normals of a face along the edge make the constant angle with its axis whose cosine is b.
        i, j = (index[s] for s in piece["side"])
        separate(i, f, piece["axis"], (piece["centre"] - p[i]) @ piece["axis"] / big[i])
        separate(j, f, -piece["axis"], -((piece["centre"] - p[j]) @ piece["axis"]) / big[j])
        # At an end, the plane of the edge's normals there.
        for tip, sign, angle in ((0, 1.0, piece["start"]), (1, -1.0, piece["start"] + piece["span"])):
            inward = sign * (piece["across"] @ np.array([-np.sin(angle), np.cos(angle)]))
            if piece["ends"][tip] >= 0:
                separate(f, faces + len(pieces) + piece["ends"][tip], -inward, 0.0)
            elif tip == 1:  # a cut is stored once, by the piece before it
                separate(f, faces + piece["next"][1], -inward, 0.0)
    return bounds


def _assembled(
    p: NDArray, big: NDArray, edges: list[dict[str, Any]], index: dict[int, int], vertex: NDArray, ends: NDArray
) -> Features:
    """Number the features, cut edges that are too long, and store the bounds of every cone.

    index: row of p and big of each ball; vertex (vertices, 3); ends (edges, 2): vertices of each edge, -1 for none.
    """
    faces = len(p)
    pieces = _short_edges(edges, ends)
    bounds = _cone_bounds(p, big, pieces, index, len(vertex))
    flat = [bound for own in bounds for bound in own]
    zero = np.zeros((len(vertex), 3))
    return Features(
        faces=faces,
        edges=len(pieces),
        vertices=len(vertex),
        centre=np.concatenate([p, [q["centre"] for q in pieces], vertex]),
        radius=np.concatenate([big, np.zeros(len(pieces) + len(vertex))]),
        axis=np.concatenate([np.zeros_like(p), [q["axis"] for q in pieces], zero]),
        rho=np.concatenate([np.zeros(faces), [q["rho"] for q in pieces], zero[:, 0]]),
        side=np.array([[index[s] for s in q["side"]] for q in pieces]),
        across=np.array([q["across"] for q in pieces]),
        start=np.array([q["start"] for q in pieces]),
        span=np.array([q["span"] for q in pieces]),
        ends=np.array([q["ends"] for q in pieces]),
        first_bound=np.concatenate([[0], np.cumsum([len(own) for own in bounds])]),
        bound=np.array([a for a, _, _ in flat]),
        offset=np.array([b for _, b, _ in flat]),
        beyond=np.array([g for _, _, g in flat]),
    )
