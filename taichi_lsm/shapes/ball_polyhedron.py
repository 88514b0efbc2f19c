"""Rounded ball-polyhedra (3D): the common part of balls, dilated by a small ball.

K is the intersection of balls B(p_i, R_i); the grain is K rolled round by a ball of radius r. Its faces are spherical
patches of radius R_i + r, its vertices patches of radius r, and its edges torus strips that close the surface, so
that the outward normal is continuous. Spherical patches alone cannot do that in 3D: two spheres share a normal at
one point only. Every feature owns the normals n of a cone, and the cones tile the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .ball_cells import Features, cell_of_balls, spread
from .base import GrainShape, frozen_array
from .mass_properties import mass_of

SLACK = 1.25  # of a face's radius over the least that holds the other tangent points: less makes slivers
CORNER_ROUNDING = 1e-9  # of a bound: a corner of a narrow cone is known no better
SAMPLES = 4000  # directions that bound the lever
ARRAYS = ("feature_centre", "feature_radius", "ring_axis", "ring_radius", "bound", "bound_offset")
INDICES = ("first_bound", "bound_next")


@dataclass(frozen=True, eq=False)
class BallPolyhedron(GrainShape):
    """A convex 3D grain whose features are ordered faces, edges, vertices.

    dilation        r, the radius that rounds edges and vertices
    face_count, edge_count, vertex_count
    feature_centre  (features, 3) centre of a face's ball, of an edge's circle; the point of a vertex
    feature_radius  (features,) radius of the surface, dilation included: R_i + r of a face, else r
    ring_axis       (features, 3) unit axis of an edge's circle, else 0
    ring_radius     (features,) radius of an edge's circle, else 0
    first_bound     (features + 1,) where the bounds of each feature's cone begin
    bound           (bounds, 3) unit vectors a, bound_offset (bounds,) b: n is in the cone if a.n <= b for all
    bound_next      (bounds,) the feature beyond; there the same bound is stored with both signs turned
    """

    kind = "polyhedron"

    dilation: float
    face_count: int
    edge_count: int
    vertex_count: int
    feature_centre: NDArray
    feature_radius: NDArray
    ring_axis: NDArray
    ring_radius: NDArray
    first_bound: NDArray
    bound: NDArray
    bound_offset: NDArray
    bound_next: NDArray

    def __post_init__(self):
        super().__post_init__()
        for field in ARRAYS:
            object.__setattr__(self, field, frozen_array(field, getattr(self, field)))
        for field in INDICES:
            index = np.array(getattr(self, field), dtype=np.int64)
            index.setflags(write=False)
            object.__setattr__(self, field, index)
        self._check()

    def _check(self):
        count = self.face_count + self.edge_count + self.vertex_count
        bounds = int(self.first_bound[-1]) if self.first_bound.size else -1
        wanted = {
            "feature_centre": (count, 3),
            "feature_radius": (count,),
            "ring_axis": (count, 3),
            "ring_radius": (count,),
            "first_bound": (count + 1,),
            "bound": (bounds, 3),
            "bound_offset": (bounds,),
            "bound_next": (bounds,),
        }
        for field, shape in wanted.items():
            if getattr(self, field).shape != shape:
                raise ValueError(f"{field} has shape {getattr(self, field).shape}: must be {shape}")
        if self.dim != 3:
            raise ValueError(f"dim = {self.dim}: a ball-polyhedron is 3D")
        if not 0 < self.dilation <= self.overlap_limit:
            raise ValueError(f"dilation = {self.dilation}: must be > 0 and at most cap_radius = {self.overlap_limit}")
        if np.any(self.feature_radius < self.dilation) or np.any(self.ring_radius < 0):
            raise ValueError("feature_radius, ring_radius: must be at least the dilation, and >= 0")
        if bounds and not 0 <= self.bound_next.min() <= self.bound_next.max() < count:
            raise ValueError(f"bound_next: must name one of the {count} features")

    @property
    def patch_count(self) -> int:
        """Number of spherical patches: faces and vertices."""
        return self.face_count + self.vertex_count

    def feature_of(self, normals: ArrayLike) -> NDArray:
        """Feature (k,) whose cone holds each unit normal (k, 3), body frame."""
        n = np.asarray(normals, dtype=np.float64)
        worst = np.full((len(self.feature_radius), len(n)), -1.0)
        if self.bound.size:
            out = self.bound @ n.T - self.bound_offset[:, None]
            filled = np.flatnonzero(np.diff(self.first_bound))
            worst[filled] = np.maximum.reduceat(out, self.first_bound[:-1][filled], axis=0)
        return np.argmin(worst, axis=0)

    def support_points(self, normals: ArrayLike) -> NDArray:
        """Point of the surface (k, 3) with each outward unit normal (k, 3), body frame."""
        n = np.asarray(normals, dtype=np.float64)
        f = self.feature_of(n)
        axis, rho = self.ring_axis[f], self.ring_radius[f]
        flat = n - np.sum(n * axis, axis=1, keepdims=True) * axis
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        return self.feature_centre[f] + rho[:, None] * flat + self.feature_radius[f, None] * n

    def support(self, normals: ArrayLike) -> NDArray:
        """Support function h(n) (k,) = max over the surface of x . n for unit normals (k, 3), body frame."""
        n = np.asarray(normals, dtype=np.float64)
        return np.sum(self.support_points(n) * n, axis=1)

    def patches(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """See GrainShape: faces, then vertices; each with the least cone about its mean normal that holds it."""
        kept = np.r_[: self.face_count, self.face_count + self.edge_count : len(self.feature_radius)]
        n = spread(8000)
        owner = self.feature_of(n)
        axis, angle = np.zeros((kept.size, 3)), np.zeros(kept.size)
        corner = self._corner_normals()
        for row, f in enumerate(kept):
            own = np.concatenate([n[owner == f], corner[f]])
            mean = own.sum(axis=0) if self.bound.size else np.array([1.0, 0.0, 0.0])
            axis[row] = mean / np.linalg.norm(mean)
            angle[row] = np.arccos(np.clip((own @ axis[row]).min(), -1.0, 1.0)) if self.bound.size else np.pi
        return self.feature_centre[kept], self.feature_radius[kept], axis, angle

    def _corner_normals(self) -> list[NDArray]:
        """Normals (m, 3) at the corners of each feature's cone: where two of its bounds meet inside the others."""
        result = []
        for f in range(len(self.feature_radius)):
            own = slice(self.first_bound[f], self.first_bound[f + 1])
            a, b = self.bound[own], self.bound_offset[own]
            i, j = np.triu_indices(len(a), 1)
            line = np.cross(a[i], a[j])
            length = np.sum(line**2, axis=1)
            i, j, line, length = (v[length > 1e-20] for v in (i, j, line, length))
            foot = np.cross(b[i, None] * a[j] - b[j, None] * a[i], line) / length[:, None]
            rest = 1.0 - np.sum(foot**2, axis=1)
            foot, line, rest = foot[rest > 0], line[rest > 0], np.sqrt(rest[rest > 0])
            along = (rest / np.linalg.norm(line, axis=1))[:, None] * line
            n = np.concatenate([foot + along, foot - along])
            out = (n @ a.T - b).max(axis=1, initial=-2.0)
            result.append(n[out <= max(CORNER_ROUNDING, out.min(initial=2.0))])
        return result

    def mesh(self, points: int = 2000) -> tuple[NDArray, NDArray]:
        """Triangles of the surface, for pictures and misfits: vertices (m, 3) and indices (t, 3), outward."""
        from scipy.spatial import ConvexHull

        corners = np.concatenate([n for n in self._corner_normals()] or [np.zeros((0, 3))])
        x = self.support_points(np.concatenate([spread(points), corners]))
        hull = ConvexHull(x)
        used, index = np.unique(hull.simplices, return_inverse=True)
        vertices, triangles = x[used], index.reshape(hull.simplices.shape)
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0
        triangles[inward] = triangles[inward][:, ::-1]
        return vertices, triangles

    def moved(self, rotation: NDArray | None = None, shift: ArrayLike = (0.0, 0.0, 0.0)) -> BallPolyhedron:
        """The same surface turned by a rotation matrix (3, 3), then shifted (3,): a part of another grain.

        Mass and inertia are kept as they are: those of the part about its own centre of mass, in its own frame.
        """
        turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
        centre = self.feature_centre @ turn.T + np.asarray(shift, dtype=np.float64)
        return replace(self, feature_centre=centre, ring_axis=self.ring_axis @ turn.T, bound=self.bound @ turn.T)

    def rescaled(self, factor: float) -> BallPolyhedron:
        """The same shape, all lengths times `factor` > 0."""
        if not (np.isfinite(factor) and factor > 0):
            raise ValueError(f"factor = {factor}: must be finite and > 0")
        lengths = ("dilation", "feature_centre", "feature_radius", "ring_radius")
        lengths += ("bounding_radius", "overlap_limit", "lever")
        changed = {name: getattr(self, name) * factor for name in lengths}
        return replace(self, **changed, measure=self.measure * factor**3, inertia=self.inertia * factor**5)


def ball_polyhedron(
    centres: ArrayLike, radii: ArrayLike, dilation: float, *, name: str = "ball-polyhedron", normalise: bool = True
) -> BallPolyhedron:
    """The common part of the balls B(centres[i], radii[i]), dilated; balls that bound nothing are left out.

    centres (n, 3), radii (n,) > 0 and dilation > 0 in any unit. Moved to the centre of mass, turned into the
    principal frame unless the moments' products already vanish, and, unless normalise is False, rescaled to
    equivalent diameter 1. One ball alone gives a sphere.
    Raises ValueError if numbers are out of range, the balls have no common part or the surface is no polyhedron.
    """
    p, big = np.array(centres, dtype=np.float64), np.array(radii, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or big.shape != p.shape[:1] or not len(p):
        raise ValueError(f"centres and radii have shapes {p.shape}, {big.shape}: must be (n, 3) and (n,), n >= 1")
    if not (np.all(np.isfinite(p)) and np.all(np.isfinite(big)) and np.all(big > 0)):
        raise ValueError(f"centres, radii = {p}, {big}: must be finite, radii > 0")
    if not (np.isfinite(dilation) and dilation > 0):
        raise ValueError(f"dilation = {dilation}: must be finite and > 0")
    shape, _, _ = placed_ball_polyhedron(p, big, dilation, name)
    return shape.rescaled((np.pi / 6.0 / shape.measure) ** (1.0 / 3.0)) if normalise else shape


def placed_ball_polyhedron(
    p: NDArray, big: NDArray, dilation: float, name: str
) -> tuple[BallPolyhedron, NDArray, NDArray]:
    """The shape in its own frame and in the given unit of length, and where it is among the balls (n, 3), (n,).

    Returns (shape, centre of mass (3,), rotation matrix (3, 3) from the shape's frame to that of the balls).
    """
    cell = cell_of_balls(p, big)
    volume, centroid, second = mass_of(cell, dilation)
    cell = cell.moved(np.eye(3), -centroid)
    second = second - volume * np.outer(centroid, centroid)
    inertia = np.trace(second) * np.eye(3) - second
    products = np.abs(inertia - np.diag(np.diag(inertia))).max()
    frame = np.eye(3)
    if products > 1e-9 * np.trace(inertia):
        _, frame = np.linalg.eigh(inertia)
        frame = frame * np.sign(np.linalg.det(frame))
        cell = cell.moved(frame.T, np.zeros(3))
        inertia = frame.T @ inertia @ frame
    return _shape(cell, dilation, volume, np.diag(inertia), name), centroid, frame


def _shape(cell: Features, dilation: float, volume: float, inertia: NDArray, name: str) -> BallPolyhedron:
    one = len(cell.radius) == 1
    shape = BallPolyhedron(
        name=name,
        dim=3,
        measure=volume,
        inertia=inertia,
        bounding_radius=cell.farthest() + dilation,
        overlap_limit=float(cell.radius[0]) + dilation if one else dilation,
        lever=0.0,
        dilation=dilation,
        face_count=cell.faces,
        edge_count=cell.edges,
        vertex_count=cell.vertices,
        feature_centre=cell.centre,
        feature_radius=cell.radius + dilation,
        ring_axis=cell.axis,
        ring_radius=cell.rho,
        first_bound=cell.first_bound,
        bound=cell.bound,
        bound_offset=cell.offset,
        bound_next=cell.beyond,
    )
    n = np.concatenate([spread(SAMPLES), *shape._corner_normals()])
    lever = np.linalg.norm(np.cross(shape.support_points(n), n), axis=1).max()
    return replace(shape, lever=min(1.005 * lever, shape.bounding_radius))


def tangent_ball_polyhedron(
    points: ArrayLike,
    normals: ArrayLike,
    dilation: float,
    *,
    slack: float = SLACK,
    largest_radius: float = 10.0,
    name: str = "ball-polyhedron",
    normalise: bool = True,
) -> BallPolyhedron:
    """A rounded ball-polyhedron that touches a convex target at the points (n, 3) with the outward normals (n, 3).

    Each face ball is tangent there; its radius is `slack` times the least that holds all other points, at most
    largest_radius target sizes. dilation: in the unit of the points.
    Raises ValueError as `ball_polyhedron`, and if normals are not unit vectors or there are fewer than 4.
    """
    x, n = np.array(points, dtype=np.float64), np.array(normals, dtype=np.float64)
    if x.ndim != 2 or x.shape[1:] != (3,) or n.shape != x.shape or len(x) < 4:
        raise ValueError(f"points and normals have shapes {x.shape}, {n.shape}: must be (n, 3), n >= 4, both")
    if np.any(np.abs(np.linalg.norm(n, axis=1) - 1.0) > 1e-9):
        raise ValueError("normals: must be unit vectors")
    x = x - dilation * n
    size = 2.0 * np.linalg.norm(x - x.mean(axis=0), axis=1).max()
    radius = np.empty(len(x))
    for i in range(len(x)):
        away = x - x[i]
        drop = -2.0 * (away @ n[i])
        low = drop > 1e-9 * size
        radius[i] = slack * (np.sum(away[low] ** 2, axis=1) / drop[low]).max() if low.any() else np.inf
    radius = np.minimum(radius, largest_radius * size)
    return ball_polyhedron(x - radius[:, None] * n, radius, dilation, name=name, normalise=normalise)


def ball_of_faces(count: int, dilation: float = 0.02, slack: float = SLACK) -> BallPolyhedron:
    """The sphere of diameter 1 with `count` faces tangent to it (4 or more), or one face: the sphere itself."""
    if count == 1:
        return ball_polyhedron(np.zeros((1, 3)), [0.5 - dilation], dilation, name="sphere of 1 face")
    n = spread(count)
    return tangent_ball_polyhedron(0.5 * n, n, dilation, slack=slack, name=f"sphere of {count} faces")
