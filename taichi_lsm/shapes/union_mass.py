"""Area or volume, centre and second moments of what convex parts cover together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .arc_chain import ArcChain
from .ball_cells import cell_of_balls
from .ball_polyhedron import BallPolyhedron
from .geometry import even_directions, polygon_integrals
from .mass_properties import mass_of

ConvexShape = ArcChain | BallPolyhedron

OUTLINE_POINTS = 4000  # of a part; two such outlines give moments to about 1e-8
LINES = 64  # per axis, of the grid of lines that measures what parts in 3D share
PLANES = 500  # even ones, besides those of its features, that bound a part for it
# A rotation whose axes no faces follow: by 1 rad about each of two axes.
ASKEW = np.array([[np.cos(1.0), -np.sin(1.0), 0.0], [np.sin(1.0), np.cos(1.0), 0.0], [0.0, 0.0, 1.0]]) @ np.array(
    [[1.0, 0.0, 0.0], [0.0, np.cos(1.0), -np.sin(1.0)], [0.0, np.sin(1.0), np.cos(1.0)]]
)


def surface_points(part: ConvexShape, count: int) -> NDArray:
    """About `count` points (k, dim) of the surface of a convex part."""
    return part.outline(count) if isinstance(part, ArcChain) else part.support_points(even_directions(count))


def moments_of(members: Sequence[ConvexShape]) -> tuple[float, NDArray, NDArray]:
    """Area or volume of what the parts cover, its centroid (dim,), and second moments (dim, dim) about that."""
    return _moments_2d(members) if members[0].dim == 2 else _moments_3d(members)


def _moments_2d(members: Sequence[ConvexShape]) -> tuple[float, NDArray, NDArray]:
    """(area, centroid (2,), second moments (2, 2) about it) of the union of 2D parts."""
    # Chords miss an area that falls as 1/n^2: two numbers of points extrapolate it (Richardson).
    coarse = _outline_moments(members, OUTLINE_POINTS // 2)
    fine = _outline_moments(members, OUTLINE_POINTS)
    area = (4.0 * fine[0] - coarse[0]) / 3.0
    first, second = (4.0 * fine[1] - coarse[1]) / 3.0, (4.0 * fine[2] - coarse[2]) / 3.0
    centroid = first / area
    return area, centroid, second - area * np.outer(centroid, centroid)


def _outline_moments(members: Sequence[ConvexShape], count: int) -> tuple[float, NDArray, NDArray]:
    """Area, first moment (2,) and second moments (2, 2) of the union of the parts' outlines of `count` points."""
    import shapely

    body = shapely.union_all([shapely.Polygon(surface_points(m, count)) for m in members])
    if not isinstance(body, shapely.Polygon):
        raise InputError("members: must hang together, but the union falls apart; move the parts together")
    area, first, second = 0.0, np.zeros(2), np.zeros((2, 2))
    # The exterior counts with its area and the holes against it, whatever the sense of their points.
    for ring, outer in ((body.exterior, True), *((hole, False) for hole in body.interiors)):
        twice_area, six_first, second_24 = polygon_integrals(shapely.get_coordinates(ring)[:-1])
        sign = np.sign(twice_area) * (1.0 if outer else -1.0)
        area += sign * 0.5 * twice_area
        first += sign * six_first / 6.0
        second += sign * second_24 / 24.0
    return float(area), first, second


def _moments_3d(members: Sequence[ConvexShape]) -> tuple[float, NDArray, NDArray]:
    """(volume, centroid (3,), second moments (3, 3) about it) of the union of 3D parts.

    Lines along one axis of a frame askew to all faces cross each part in one interval. What their union holds is
    integrated along the lines and summed over a grid of them. From that comes only what parts share: their own moments
    are exact. Parts hang together if they overlap in a chain.
    """
    reach = np.concatenate([surface_points(m, 500) for m in members]) @ ASKEW
    low, high = reach.min(axis=0), reach.max(axis=0)
    width = (high - low)[:2] / LINES
    places = np.stack(
        np.meshgrid(*(low[i] + width[i] * (np.arange(LINES) + 0.5) for i in range(2)), indexing="ij"), axis=-1
    ).reshape(-1, 2)
    ends = np.array([_crossings(m, places) for m in members])  # (parts, 2, lines)
    _check_chain(ends)
    alone = [_line_moments(both[None], places, width) for both in ends]
    together = _line_moments(ends, places, width)
    exact = [_own_moments(m) for m in members]
    volume = together[0] + sum(whole[0] - lines[0] for whole, lines in zip(exact, alone, strict=True))
    first, second = together[1].copy(), together[2].copy()
    for whole, lines in zip(exact, alone, strict=True):
        first += whole[1] - lines[1]
        second += whole[2] - lines[2]
    centroid = first / volume
    return float(volume), centroid, second - volume * np.outer(centroid, centroid)


def _line_moments(ends: NDArray, lines: NDArray, width: NDArray) -> tuple[float, NDArray, NDArray]:
    """As `_own_moments`, of what the intervals (parts, 2, k) of lines at points (k, 2) cover together."""
    # Of intervals in the order of their beginnings, each adds what lies beyond all before it.
    order = np.argsort(ends[:, 0], axis=0)
    enter, leave = (np.take_along_axis(ends[:, i], order, axis=0) for i in range(2))
    before = np.concatenate([np.full_like(enter[:1], -np.inf), leave[:-1]])
    enter = np.maximum(enter, np.maximum.accumulate(before, axis=0))
    leave = np.maximum(leave, enter)
    length, once, twice = (np.sum(leave**k - enter**k, axis=0) / k for k in (1, 2, 3))
    second = np.empty((3, 3))
    second[:2, :2] = np.einsum("k,ki,kj->ij", length, lines, lines)
    second[:2, 2] = second[2, :2] = once @ lines
    second[2, 2] = twice.sum()
    cell = width.prod()
    first = np.append(length @ lines, once.sum())
    return float(cell * length.sum()), cell * ASKEW @ first, cell * ASKEW @ second @ ASKEW.T


def _crossings(part: ConvexShape, lines: NDArray) -> NDArray:
    """Where lines at points (k, 2), along the third axis of the askew frame, enter and leave a part (2, k).

    A line leaves a convex body where it first leaves a ball or a half-space that holds the body: those of the faces,
    and tangent planes. A line that misses has both at 0.
    """
    assert isinstance(part, BallPolyhedron)
    n = _tangent_normals(part)
    support, n = part.support(n), n @ ASKEW
    centre, radius = part.feature_centre[: part.face_count] @ ASKEW, part.feature_radius[: part.face_count]
    result = np.zeros((2, len(lines)))
    for block in range(0, len(lines), LINES):
        own = lines[block : block + LINES]
        height = (support - own @ n[:, :2].T) / n[:, 2]
        rest = radius**2 - np.sum((own[:, None] - centre[:, :2]) ** 2, axis=2)
        half = np.where(rest > 0.0, np.sqrt(np.maximum(rest, 0.0)), -np.inf)
        enter = np.maximum(height[:, n[:, 2] < 0.0].max(axis=1), (centre[:, 2] - half).max(axis=1))
        leave = np.minimum(height[:, n[:, 2] > 0.0].min(axis=1), (centre[:, 2] + half).min(axis=1))
        result[:, block : block + LINES] = np.where(leave > enter, [enter, leave], 0.0)
    return result


def _tangent_normals(part: BallPolyhedron) -> NDArray:
    """Normals (k, 3) of planes that are close to the rounded edges and vertices of a part: even ones, and its own."""
    corners = [c for c in part.corner_normals()[part.face_count :] if len(c)]
    own = [np.concatenate([c, c + c.mean(axis=0), c.mean(axis=0, keepdims=True)]) for c in corners]
    n = np.concatenate([even_directions(PLANES), *own])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def _own_moments(part: ConvexShape) -> tuple[float, NDArray, NDArray]:
    """Volume, first moment (3,) and second moments (3, 3) about the origin of a part where it lies, exact."""
    assert isinstance(part, BallPolyhedron)
    faces = slice(part.face_count)
    cell = cell_of_balls(part.feature_centre[faces], part.feature_radius[faces] - part.dilation)
    volume, centroid, second = mass_of(cell, part.dilation)
    return volume, volume * centroid, second


def _check_chain(ends: NDArray) -> None:
    """Refuse parts, given by where lines enter and leave them (parts, 2, lines), that do not all hang together."""
    joined, waiting = {0}, [0]  # parts reached from the first one through overlaps
    while waiting:
        here = waiting.pop()
        for other in range(len(ends)):
            overlap = np.minimum(ends[here, 1], ends[other, 1]) - np.maximum(ends[here, 0], ends[other, 0])
            crossed = (ends[here, 1] > ends[here, 0]) & (ends[other, 1] > ends[other, 0])
            if other not in joined and np.any(crossed & (overlap > 0.0)):
                joined.add(other)
                waiting.append(other)
    if len(joined) < len(ends):
        raise InputError("members: must hang together, but the union falls apart; move the parts together")
