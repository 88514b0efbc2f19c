"""Non-convex grains as unions of convex parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arc_chain import ArcChain
from .ball_cells import spread
from .ball_polyhedron import BallPolyhedron
from .base import GrainShape
from .polygon_fit import from_polygon

OUTLINE_POINTS = 4000  # of a member; two such outlines give moments to about 1e-8
GRID = 72  # cells per axis that measure a 3D union, to about 1e-3
PROBE = 1e-3  # equivalent diameters: parts nearer than this to a point of the outer surface resist there together


@dataclass(frozen=True, eq=False)
class Union(GrainShape):
    """A rigid grain of convex members, whose arrays are in the frame of the whole. Members never touch each other.

    stiffness_peak: greatest number of members that resist at one point of the outer surface, in units of the contact
    stiffness k: where members meet at a re-entrant corner it is 2; along shared outer surfaces it should not be.
    """

    members: tuple
    stiffness_peak: float

    @property
    def kind(self) -> str:
        """The contact geometry of the members."""
        return self.members[0].kind

    @property
    def patch_count(self) -> int:
        """Number of patches of all members."""
        return sum(m.patch_count for m in self.members)

    @property
    def parts(self) -> tuple[GrainShape, ...]:
        """The convex members."""
        return self.members

    def patches(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """See GrainShape; member after member."""
        return tuple(np.concatenate(rows) for rows in zip(*(m.patches() for m in self.members), strict=True))

    def part_bounds(self) -> tuple[NDArray, NDArray]:
        """Balls that hold the members: centres (members, dim), radii (members,)."""
        balls = [_ball_about(m) for m in self.members]
        return np.array([c for c, _ in balls]), np.array([r for _, r in balls])


def _ball_about(member: GrainShape) -> tuple[NDArray, float]:
    x = member.outline(512) if member.dim == 2 else member.support_points(spread(2000))
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    return middle, float(np.linalg.norm(x - middle, axis=1).max()) * 1.001  # between the sampled points


def placed(shape: GrainShape, offset: ArrayLike, turn: float | NDArray = 0.0, scale: float = 1.0) -> GrainShape:
    """A convex shape as a member of a union: scaled, turned (angle [rad] in 2D, matrix in 3D), then moved by offset."""
    if isinstance(shape, BallPolyhedron):
        matrix = np.eye(3) if np.ndim(turn) == 0 else turn
        return shape.rescaled(scale).moved(matrix, offset)
    if not (isinstance(shape, ArcChain) and shape.patch_count > 1):
        raise ValueError(f"members: {shape.name!r} must be an arc chain of 3 or more arcs, or a ball-polyhedron")
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, -s], [s, c]])
    reach = shape.bounding_radius * scale + float(np.linalg.norm(offset))
    return replace(
        shape,
        centre=scale * shape.centre @ matrix.T + np.asarray(offset),
        radius=scale * shape.radius,
        seam=shape.seam @ matrix.T,
        measure=shape.measure * scale**2,
        inertia=shape.inertia * scale**4,
        bounding_radius=reach,
        overlap_limit=shape.overlap_limit * scale,
        lever=min(reach, shape.lever * scale + float(np.linalg.norm(offset))),
    )


def union(members: Sequence[GrainShape], *, name: str = "union", normalise: bool = True) -> GrainShape:
    """One rigid grain of convex members in a common frame, see `placed`; mass properties of the true union.

    Exact to about 1e-8 in 2D, 1e-3 in 3D. Moved to the centre of mass and, unless normalise is False, rescaled to
    equivalent diameter 1. One member is returned as it is.
    Raises ValueError if there is no member, kinds or dimensions differ, or the members do not hang together.
    """
    members = list(members)
    if not members:
        raise ValueError("members: none given, must be at least one")
    if len(members) == 1:
        return members[0]
    if len({(m.kind, m.dim) for m in members}) > 1:
        raise ValueError(f"members: {[(m.name, m.kind) for m in members]}, must be of one kind")
    dim = members[0].dim
    measure, centroid, second = _moments_2d(members) if dim == 2 else _moments_3d(members)
    frame = np.eye(dim)
    if dim == 2:
        inertia = np.array([np.trace(second)])
    else:
        inertia, frame = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
        frame = frame * np.sign(np.linalg.det(frame))
    unit = np.pi / 4 if dim == 2 else np.pi / 6
    factor = (unit / measure) ** (1.0 / dim) if normalise else 1.0
    inertia = inertia * factor ** (dim + 2)
    moved = []
    for m in members:
        if dim == 3:
            moved.append(m.moved(frame.T, -frame.T @ centroid).rescaled(factor))
        else:
            moved.append(placed(m, -factor * centroid, 0.0, factor))
    points = np.concatenate([m.outline(4000) if dim == 2 else m.support_points(spread(4000)) for m in moved])
    reach = float(np.linalg.norm(points, axis=1).max()) * 1.0005
    return Union(
        name=name,
        dim=dim,
        measure=measure * factor**dim,
        inertia=inertia,
        bounding_radius=reach,
        overlap_limit=min(m.overlap_limit for m in moved),
        lever=reach,
        members=tuple(moved),
        stiffness_peak=_stiffness_peak(moved, points),
    )


def _depth_in(member: GrainShape, x: NDArray) -> NDArray:
    """How far inside a convex member the points (k, dim) lie, at most; negative outside."""
    if member.dim == 2:
        angle = 2.0 * np.pi * np.arange(720) / 720
        n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        n = spread(1000)
    return (member.support(n) - x @ n.T).min(axis=1)


def _stiffness_peak(members: Sequence[GrainShape], points: NDArray) -> float:
    depth = np.array([_depth_in(m, points) for m in members])
    outer = depth.max(axis=0) < 0.5 * PROBE
    return float((depth[:, outer] > -PROBE).sum(axis=0).max())


def _moments_2d(members) -> tuple[float, NDArray, NDArray]:
    coarse, fine = (_polygon_moments(members, count) for count in (OUTLINE_POINTS // 2, OUTLINE_POINTS))
    first, moment, second = (
        (4.0 * b - a) / 3.0 for a, b in zip(coarse, fine)
    )  # chords miss an area that falls as 1/n^2
    centroid = moment / first
    return float(first), centroid, second - first * np.outer(centroid, centroid)


def _polygon_moments(members, count: int) -> tuple[float, NDArray, NDArray]:
    """Area, first moment (2,) and second moments (2, 2) of the union of the members' outlines of `count` points."""
    import shapely

    body = shapely.union_all([shapely.Polygon(m.outline(count)) for m in members])
    if body.geom_type != "Polygon":
        raise ValueError("members: must hang together, but the union falls apart")
    area, moment, second = 0.0, np.zeros(2), np.zeros((2, 2))
    for ring in (body.exterior, *body.interiors):
        a = np.array(ring.coords)[:-1]
        b = np.roll(a, -1, axis=0)
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        way = np.sign(cross.sum()) * (1.0 if ring is body.exterior or ring.equals(body.exterior) else -1.0)
        area += way * 0.5 * cross.sum()
        moment += way * ((a + b) * cross[:, None]).sum(axis=0) / 6.0
        outer = np.einsum("ki,kj->kij", a, a) + np.einsum("ki,kj->kij", b, b) + np.einsum("ki,kj->kij", a + b, a + b)
        second += way * np.einsum("k,kij->ij", cross, outer) / 24.0
    return area, moment, second


def _moments_3d(members) -> tuple[float, NDArray, NDArray]:
    """Midpoint sums over a grid; parts hang together if they overlap in a chain."""
    reach = [m.support_points(spread(500)) for m in members]
    low, high = np.concatenate(reach).min(axis=0), np.concatenate(reach).max(axis=0)
    width = (high - low) / GRID
    axes = [low[i] + width[i] * (np.arange(GRID) + 0.5) for i in range(3)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.array([np.concatenate([_depth_in(m, chunk) > 0 for chunk in np.array_split(x, 64)]) for m in members])
    joined, waiting = {0}, [0]
    while waiting:
        here = waiting.pop()
        for other in range(len(members)):
            if other not in joined and np.any(inside[here] & inside[other]):
                joined.add(other)
                waiting.append(other)
    if len(joined) < len(members):
        raise ValueError("members: must hang together, but the union falls apart")
    x = x[inside.any(axis=0)]
    cell = width.prod()
    measure, centroid = cell * len(x), x.mean(axis=0)
    return float(measure), centroid, cell * np.einsum("ki,kj->ij", x - centroid, x - centroid)


def cross(arm_ratio: float = 3.0, corner_radius: float = 0.05) -> GrainShape:
    """Two equal rounded bars at a right angle (2D); arm_ratio: length over width of a bar, above 1. The bars share
    the square in the middle and meet at four re-entrant corners."""
    if not (np.isfinite(arm_ratio) and arm_ratio > 1):
        raise ValueError(f"arm_ratio = {arm_ratio}: must be above 1")
    x, y = 0.5 * arm_ratio, 0.5
    size = np.sqrt(4.0 / np.pi * (2.0 * arm_ratio - 1.0))
    bar = from_polygon([(-x, -y), (x, -y), (x, y), (-x, y)], corner_radius * size, normalise=False)
    return union([placed(bar, (0.0, 0.0)), placed(bar, (0.0, 0.0), 0.5 * np.pi)], name=f"cross {arm_ratio:g}")
