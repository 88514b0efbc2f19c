"""Rounded ball-polyhedra (3D): the common part of balls, dilated by a small ball.

K is the intersection of balls B(p_i, R_i); the grain is K dilated by a ball of radius r. Its faces are spherical
patches of radius R_i + r, its vertices patches of radius r, and its edges torus strips that close the surface, so that
the outward normal is continuous. Spherical patches alone cannot do that in 3D: two spheres share a normal at one point
only. Every feature owns the normals n of a cone, and the cones tile the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .base import WIDTHS, Balls, GrainShape, Patches, counted, frozen_array
from .geometry import convex_mesh, even_directions
from .input_checks import check_at_least, check_positive

CORNER_ROUNDING = 1e-9  # of a bound: a corner of a narrow cone is known no better
AT_ONCE = 256  # normals whose features are sought at once: what they need fits the cache
PATCH_SAMPLES = 8000  # directions that find the mean normal and the cone of each patch
ARRAYS = ("feature_centre", "feature_radius", "ring_axis", "ring_radius", "bound", "bound_offset")
INDICES = ("first_bound", "bound_next")


@dataclass(frozen=True, eq=False, repr=False)
class BallPolyhedron(GrainShape):
    """A convex 3D grain: balls intersected and dilated; its features are in the order faces, edges, vertices.

    Parameters
    ----------
    name, dim, measure, inertia, bounding_radius, overlap_limit, lever
        See `GrainShape`.
    dilation : float
        r, the radius that rounds edges and vertices [diameter].
    face_count, edge_count, vertex_count : int
        Numbers of features of each sort.
    feature_centre : ndarray, (features, 3)
        Centre of the ball of a face, of the circle of an edge; the point of a vertex [diameter], body frame.
    feature_radius : ndarray, (features,)
        Radius of the surface, dilation included: R_i + r of a face, else r [diameter].
    ring_axis : ndarray, (features, 3)
        Unit axis of the circle of an edge, else 0; body frame.
    ring_radius : ndarray, (features,)
        Radius of the circle of an edge [diameter], else 0.
    first_bound : ndarray of int, (features + 1,)
        Row where the bounds of the cone of each feature begin.
    bound : ndarray, (bounds, 3)
        Unit vectors a, body frame.
    bound_offset : ndarray, (bounds,)
        Offsets b: a normal n is in the cone if a . n <= b for all its bounds.
    bound_next : ndarray of int, (bounds,)
        The feature beyond each bound; there the same bound is stored with both signs reversed.

    Raises
    ------
    InputError
        If a field has the wrong form.
    """

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

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ARRAYS:
            object.__setattr__(self, field, frozen_array(field, getattr(self, field)))
        for field in INDICES:
            index = np.array(getattr(self, field), dtype=np.int64)
            index.setflags(write=False)
            object.__setattr__(self, field, index)
        self._check()

    def _check(self) -> None:
        """Refuse arrays whose forms do not belong together and values out of range."""
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
                raise InputError(f"{field} has shape {getattr(self, field).shape}: must be {shape}")
        if self.dim != 3:
            raise InputError(f"dim = {self.dim}: a ball-polyhedron is 3D")
        if min(self.face_count, self.edge_count, self.vertex_count) < 0 or count == 0:
            raise InputError(f"face_count, edge_count, vertex_count: must be >= 0, and not all 0, in all {count}")
        if self.first_bound[0] != 0 or np.any(np.diff(self.first_bound) < 0):
            raise InputError("first_bound: must begin with 0 and not decrease")
        if not 0 < self.dilation <= self.overlap_limit:
            raise InputError(
                f"dilation = {self.dilation}: must be > 0 and at most overlap_limit = {self.overlap_limit}"
            )
        if np.any(self.feature_radius < self.dilation) or np.any(self.ring_radius < 0):
            raise InputError("feature_radius, ring_radius: must be at least the dilation, and >= 0")
        if bounds and not 0 <= self.bound_next.min() <= self.bound_next.max() < count:
            raise InputError(f"bound_next: must name one of the {count} features")

    @property
    def kind(self) -> str:
        """The contact geometry that reads the surface: polyhedron."""
        return "polyhedron"

    @property
    def patch_count(self) -> int:
        """Number of spherical patches: faces and vertices."""
        return self.face_count + self.vertex_count

    def _content(self) -> tuple[str, ...]:
        """Numbers of features."""
        return (
            counted(self.face_count, "face", "faces"),
            counted(self.edge_count, "edge", "edges"),
            counted(self.vertex_count, "vertex", "vertices"),
        )

    def feature_of(self, normals: ArrayLike) -> NDArray:
        """Feature whose cone holds each normal.

        Parameters
        ----------
        normals : array_like, (k, 3)
            Outward unit normals, body frame.

        Returns
        -------
        ndarray of int, (k,)
            Rows of the features.
        """
        n = np.asarray(normals, dtype=np.float64)
        owner = np.zeros(len(n), int)
        filled = np.flatnonzero(np.diff(self.first_bound)) if self.bound.size else np.zeros(0, int)
        for block in range(0, len(n) if filled.size else 0, AT_ONCE):
            own = slice(block, block + AT_ONCE)
            out = self.bound @ n[own].T - self.bound_offset[:, None]
            # How far each normal is beyond the nearest bound of each cone; the feature owns it if that is least.
            worst = np.full((len(self.feature_radius), out.shape[1]), -1.0)
            worst[filled] = np.maximum.reduceat(out, self.first_bound[:-1][filled], axis=0)
            owner[own] = np.argmin(worst, axis=0)
        return owner

    def support_points(self, normals: ArrayLike) -> NDArray:
        """Point of the surface with each outward normal.

        Parameters
        ----------
        normals : array_like, (k, 3)
            Outward unit normals, body frame.

        Returns
        -------
        ndarray, (k, 3)
            Points [diameter], body frame.
        """
        n = np.asarray(normals, dtype=np.float64)
        f = self.feature_of(n)
        axis, rho = self.ring_axis[f], self.ring_radius[f]
        flat = n - np.sum(n * axis, axis=1, keepdims=True) * axis
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        return self.feature_centre[f] + rho[:, None] * flat + self.feature_radius[f, None] * n

    def support(self, normals: ArrayLike) -> NDArray:
        """Support function h(n) = max over the surface of x . n.

        Parameters
        ----------
        normals : array_like, (k, 3)
            Outward unit normals, body frame.

        Returns
        -------
        ndarray, (k,)
            Distance of the tangent plane from the origin [diameter].
        """
        n = np.asarray(normals, dtype=np.float64)
        return np.sum(self.support_points(n) * n, axis=1)

    def _directions(self) -> NDArray:
        """See `GrainShape`: the mean corner normals of the faces, and even ones."""
        corners = self.corner_normals()[: self.face_count]
        faces = np.array([n.mean(axis=0) / np.linalg.norm(n.mean(axis=0)) for n in corners if len(n) > 2])
        return np.concatenate([faces.reshape(-1, 3), even_directions(WIDTHS[3])])

    def _reach_along(self, n: NDArray) -> NDArray:
        """See `GrainShape`."""
        return self.support(n)

    def spanning_balls(self) -> Balls:
        """See `GrainShape`: a ball at the middle of each face, edge and vertex."""
        corners = self.corner_normals()
        middle = [n.mean(axis=0) / np.linalg.norm(n.mean(axis=0)) for n in corners if len(n)]
        # Whole balls, and faces that a single circle bounds, have no corners: even directions find them.
        normal = np.array(middle) if len(middle) == len(corners) else even_directions(WIDTHS[3])
        radius = np.full(len(normal), self.overlap_limit)
        return self.support_points(normal) - self.overlap_limit * normal, radius

    def patches(self) -> Patches:
        """See `GrainShape.patches`: faces, then vertices, each with the least cone about its mean normal."""
        kept = np.r_[: self.face_count, self.face_count + self.edge_count : len(self.feature_radius)]
        n = even_directions(PATCH_SAMPLES)
        owner = self.feature_of(n)
        axis, angle = np.zeros((kept.size, 3)), np.zeros(kept.size)
        corner = self.corner_normals()
        for row, f in enumerate(kept):
            own = np.concatenate([n[owner == f], corner[f]])
            mean = own.sum(axis=0) if self.bound.size else np.array([1.0, 0.0, 0.0])
            axis[row] = mean / np.linalg.norm(mean)
            angle[row] = np.arccos(np.clip((own @ axis[row]).min(), -1.0, 1.0)) if self.bound.size else np.pi
        return self.feature_centre[kept], self.feature_radius[kept], axis, angle

    def corner_normals(self) -> list[NDArray]:
        """Normals at the corners of the cone of each feature, where two of its bounds meet inside the others.

        Returns
        -------
        list of ndarray, (m, 3)
            Unit normals for each feature, body frame; none where a cone has no corner.
        """
        result = [np.zeros((0, 3))] * len(self.feature_radius)
        counts = np.diff(self.first_bound)
        for count in np.unique(counts[counts > 1]):
            # All features with equally many bounds at once: a (f, count, 3), b (f, count).
            features = np.flatnonzero(counts == count)
            rows = self.first_bound[features, None] + np.arange(count)
            a, b = self.bound[rows], self.bound_offset[rows]
            # The planes a_i . n = b_i and a_j . n = b_j meet in a line, given by its point nearest to 0 (foot) and its
            # direction; it pierces the unit sphere in two normals.
            i, j = np.triu_indices(count, 1)
            line = np.cross(a[:, i], a[:, j])
            length = np.sum(line**2, axis=2)
            crossing = length > 1e-20  # else the planes are parallel
            length = np.where(crossing, length, 1.0)
            foot = np.cross(b[:, i, None] * a[:, j] - b[:, j, None] * a[:, i], line) / length[..., None]
            rest = 1.0 - np.sum(foot**2, axis=2)
            crossing &= rest > 0
            along = np.sqrt(np.where(crossing, rest, 0.0) / length)[..., None] * line
            n = np.concatenate([foot + along, foot - along], axis=1)
            out = (n @ a.transpose(0, 2, 1) - b[:, None]).max(axis=2)
            out[~np.concatenate([crossing, crossing], axis=1)] = np.inf
            kept = out <= np.maximum(CORNER_ROUNDING, out.min(axis=1, keepdims=True))
            for f, own, chosen, least in zip(features, n, kept, out.min(axis=1), strict=True):
                if np.isfinite(least):
                    result[f] = own[chosen]
        return result

    def mesh(self, points: int = 2000) -> tuple[NDArray, NDArray]:
        """Triangles of the surface, for pictures and misfits.

        Parameters
        ----------
        points : int
            Number of directions whose points of the surface are joined, besides those at the corners; >= 4.

        Returns
        -------
        vertices : ndarray, (m, 3)
            Points of the surface [diameter], body frame.
        triangles : ndarray of int, (t, 3)
            Rows of the corners of each triangle, counter-clockwise seen from outside.

        Raises
        ------
        InputError
            For fewer than 4 points.
        """
        check_at_least("points", points, 4)
        return convex_mesh(self.support_points(np.concatenate([even_directions(points), *self.corner_normals()])))

    def moved(self, rotation: NDArray | None = None, shift: ArrayLike = (0.0, 0.0, 0.0)) -> BallPolyhedron:
        """The same surface rotated, then shifted: a part of another grain.

        Parameters
        ----------
        rotation : ndarray, (3, 3), optional
            Rotation matrix; by default the identity.
        shift : array_like, (3,)
            By which the rotated surface is moved [diameter].

        Returns
        -------
        BallPolyhedron
            The part in the frame of the whole. Mass and inertia are kept as they are: those of the part about its own
            centre of mass, in its own frame.
        """
        matrix = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
        centre = self.feature_centre @ matrix.T + np.asarray(shift, dtype=np.float64)
        return replace(self, feature_centre=centre, ring_axis=self.ring_axis @ matrix.T, bound=self.bound @ matrix.T)

    def rescaled(self, factor: float) -> BallPolyhedron:
        """The same shape with all lengths multiplied by a factor.

        Parameters
        ----------
        factor : float
            Ratio of the new lengths to the old ones, finite and > 0.

        Returns
        -------
        BallPolyhedron
            A new shape; the volume scales as factor^3, the second moments as factor^5.

        Raises
        ------
        InputError
            If the factor is not finite and > 0.
        """
        check_positive("factor", factor)
        lengths = ("dilation", "feature_centre", "feature_radius", "ring_radius")
        lengths += ("bounding_radius", "overlap_limit", "lever")
        changed = {name: getattr(self, name) * factor for name in lengths}
        return replace(self, **changed, measure=self.measure * factor**3, inertia=self.inertia * factor**5)

    def normalised(self) -> BallPolyhedron:
        """The same shape rescaled to the equivalent diameter 1.

        Returns
        -------
        BallPolyhedron
            A new shape of volume pi/6.
        """
        return self.rescaled((np.pi / 6.0 / self.measure) ** (1.0 / 3.0))
