"""Grains of general spherical patches, the structure of Abe & Mora (2003), and clumps of full discs or spheres.

Every patch is tested by itself with the corrected cone test: directions that two cones cover count twice, directions
that none covers do not count. Only cones that tile the circle keep the energy; circular cones never tile the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arc_chain import ArcChain
from .ball_cells import spread
from .base import GrainShape, frozen_array

MOST_PATCHES = 1000
CLOSED = 0.05  # uncovered plus doubly covered part above which the patches enclose no definite area or volume
DIRECTIONS = 20_000  # that measure solid angles, to about 1e-4 of the sphere
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


class Coverage(NamedTuple):
    """Parts of the full angle (2D) or solid angle (3D) that no cone covers, and that more than one covers."""

    uncovered: float
    doubly_covered: float


class Patch(NamedTuple):
    """One patch as a part of its grain; arrays of one row each, see `GrainShape.patches`."""

    dim: int
    centre: NDArray
    radius: NDArray
    axis: NDArray
    half_angle: NDArray
    kind: ClassVar[str] = "cones"
    patch_count: ClassVar[int] = 1

    def patches(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """See GrainShape."""
        return self.centre, self.radius, self.axis, self.half_angle


@dataclass(frozen=True, eq=False)
class PatchGrain(GrainShape):
    """A grain of any patches: centre (patches, dim), radius (patches,), outward unit axis (patches, dim) and
    half_angle (patches,) [rad] of the cone of normals, above 0 and at most pi (the full disc or sphere).

    cap_radius is the least radius: contacts deeper than the sum of two are taken for far sides that face each other.
    """

    kind = "cones"

    centre: NDArray
    radius: NDArray
    axis: NDArray
    half_angle: NDArray

    def __post_init__(self):
        super().__post_init__()
        for field in ("centre", "radius", "axis", "half_angle"):
            object.__setattr__(self, field, frozen_array(field, getattr(self, field)))
        _check_patches(self.dim, self.centre, self.radius, self.axis, self.half_angle)

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return self.radius.size

    @property
    def parts(self) -> tuple[Patch, ...]:
        """Every patch is a part by itself, with its own contacts."""
        rows = zip(self.centre, self.radius, self.axis, self.half_angle, strict=True)
        return tuple(Patch(self.dim, *(np.array([value]) for value in row)) for row in rows)

    def patches(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """See GrainShape."""
        return self.centre, self.radius, self.axis, self.half_angle

    def part_bounds(self) -> tuple[NDArray, NDArray]:
        """Balls (patches, dim), (patches,) that hold the contact points of each patch.

        That of a patch within its cone is the ball of the cap; contacts lie up to cap_radius within the surface.
        """
        narrow = self.half_angle < 0.5 * np.pi
        cos, sin = np.cos(self.half_angle), np.sin(self.half_angle)
        shift = np.where(narrow, self.radius * cos, 0.0)
        reach = np.where(narrow, self.radius * sin, self.radius)
        return self.centre + shift[:, None] * self.axis, reach + np.where(
            self.half_angle < np.pi, self.overlap_limit, 0.0
        )

    def coverage(self) -> Coverage:
        """How well the cones tile: exact in 2D, by 20000 directions in 3D."""
        if self.dim == 3:
            n = spread(DIRECTIONS)
            count = ((n @ self.axis.T) >= np.where(self.half_angle < np.pi, np.cos(self.half_angle), -2.0)).sum(axis=1)
            return Coverage(float((count == 0).mean()), float((count > 1).mean()))
        turn = 2.0 * np.pi
        start = np.mod(np.arctan2(self.axis[:, 1], self.axis[:, 0]) - self.half_angle, turn)
        low = np.concatenate([start - turn, start, start + turn])
        ends = np.concatenate([low, low + np.tile(2.0 * self.half_angle, 3)])
        change = np.repeat([1, -1], len(low))
        order = np.argsort(ends)
        at, depth = ends[order], np.cumsum(change[order])
        inside = np.clip(at, 0.0, turn)
        width = np.diff(inside)
        covered, twice = width[depth[:-1] >= 1].sum(), width[depth[:-1] > 1].sum()
        return Coverage(max(0.0, 1.0 - covered / turn), twice / turn)


def _check_patches(dim: int, centre: NDArray, radius: NDArray, axis: NDArray, half_angle: NDArray) -> None:
    count = radius.size
    if radius.ndim != 1 or not 1 <= count <= MOST_PATCHES or np.any(radius <= 0):
        raise ValueError(f"radius has shape {radius.shape}: must be 1 to {MOST_PATCHES} values > 0")
    for field, value in (("centre", centre), ("axis", axis)):
        if value.shape != (count, dim):
            raise ValueError(f"{field} has shape {value.shape}: must be {(count, dim)}")
    if half_angle.shape != (count,) or np.any((half_angle <= 0) | (half_angle > np.pi)):
        raise ValueError(f"half_angle = {half_angle}: must be {count} values above 0 and at most pi rad")
    length = np.linalg.norm(axis, axis=1)
    if np.any(np.abs(length - 1.0) > 1e-9):
        raise ValueError(f"axis has lengths {length}: must be unit vectors")


def from_patches(
    centre: ArrayLike,
    radius: ArrayLike,
    axis: ArrayLike,
    half_angle: ArrayLike,
    *,
    name: str = "patches",
    measure: float | None = None,
    inertia: ArrayLike | None = None,
    normalise: bool = True,
) -> PatchGrain:
    """A grain of any 1 to 1000 spherical patches, the structure of Abe & Mora (2003), in 2D or 3D.

    centre (patches, dim), radius (patches,) > 0, axis (patches, dim) outward unit vectors, half_angle (patches,) [rad]
    above 0 and at most pi, in one frame and any unit of length. measure and inertia are computed if the cones tile to
    5 % or all are full, else they must be given. Moved to the centre of mass then, and in 3D into the principal frame;
    normalise: rescale to equivalent diameter 1. `coverage()` of the result says how well the cones tile, which decides
    whether contacts keep the energy. Also called as `GrainShape.from_patches`.
    Raises ValueError for values out of range.
    """
    p, r, e, alpha = (np.array(v, dtype=np.float64) for v in (centre, radius, axis, half_angle))
    if p.ndim != 2 or p.shape[1] not in (2, 3):
        raise ValueError(f"centre has shape {p.shape}: must be (patches, 2) or (patches, 3)")
    dim = p.shape[1]
    _check_patches(dim, p, r, e, alpha)
    if measure is None or inertia is None:
        trial = _grain(name, dim, p, r, e, alpha, 1.0, np.ones(1 if dim == 2 else 3))
        gaps = trial.coverage()
        if np.any(alpha < np.pi) and sum(gaps) > CLOSED:
            raise ValueError(
                f"measure, inertia: must be given, for the patches enclose no definite body: {gaps.uncovered:.3g} of "
                f"the directions are uncovered and {gaps.doubly_covered:.3g} covered twice"
            )
        x, n, weight = _surface(p, r, e, alpha)
        measure, centroid, second = _moments(x, n, weight)
        p = p - centroid
        second = second - measure * np.outer(centroid, centroid)
        if dim == 2:
            inertia = [np.trace(second)]
        else:
            tensor = np.trace(second) * np.eye(3) - second
            inertia, frame = np.linalg.eigh(tensor)
            frame = frame * np.sign(np.linalg.det(frame))
            p, e = p @ frame, e @ frame
    inertia = np.array(inertia, dtype=np.float64)
    if normalise:
        unit = np.pi / 4 if dim == 2 else np.pi / 6
        factor = (unit / measure) ** (1.0 / dim)
        p, r, measure, inertia = p * factor, r * factor, unit, inertia * factor ** (dim + 2)
    return _grain(name, dim, p, r, e, alpha, measure, inertia)


def _grain(name, dim, p, r, e, alpha, measure, inertia) -> PatchGrain:
    away = np.linalg.norm(p, axis=1)
    towards = np.sum(p * e, axis=1) / np.maximum(away, 1e-300)
    off = np.maximum(0.0, np.arccos(np.clip(towards, -1.0, 1.0)) - alpha)  # from p to the nearest normal of the cone
    reach = np.sqrt(away**2 + r**2 + 2.0 * away * r * np.cos(np.where(away > 0, off, 0.0)))
    return PatchGrain(
        name=name,
        dim=dim,
        measure=measure,
        inertia=inertia,
        bounding_radius=float(reach.max()),
        overlap_limit=float(r.min()),
        lever=float(min(away.max(), reach.max())),
        centre=p,
        radius=r,
        axis=e,
        half_angle=alpha,
    )


def _surface(p: NDArray, r: NDArray, e: NDArray, alpha: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Points (k, dim), normals (k, dim) and weights (k,) of all patches; of full ones only what others do not hide."""
    if np.all(alpha == np.pi):
        return _exposed(p, r)
    if p.shape[1] == 2:
        angle = np.arctan2(e[:, 1], e[:, 0])[:, None] + alpha[:, None] * _NODES
        n = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        weight = (r * alpha)[:, None] * _WEIGHTS
    else:
        height = np.cos(alpha)[:, None] + 0.5 * (1.0 - np.cos(alpha))[:, None] * (_NODES + 1.0)
        turn = 2.0 * np.pi * np.arange(16) / 16
        across = np.array([np.linalg.svd(axis[None])[2][1:] for axis in e])
        ring = (
            np.cos(turn)[:, None, None] * across[:, None, None, 0]
            + np.sin(turn)[:, None, None] * across[:, None, None, 1]
        )
        ring = ring.reshape(len(p), 1, 16, 3)
        n = height[..., None, None] * e[:, None, None] + np.sqrt(1.0 - height**2)[..., None, None] * ring
        n = n.reshape(len(p), -1, 3)
        area = (r**2 * (1.0 - np.cos(alpha)))[:, None] * 0.5 * _WEIGHTS
        weight = np.repeat(area * 2.0 * np.pi / 16, 16, axis=1)
    x = p[:, None] + r[:, None, None] * n
    return x.reshape(-1, p.shape[1]), n.reshape(-1, p.shape[1]), weight.ravel()


def _exposed(p: NDArray, r: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """The outer surface of a union of discs (exact up to the corners between nodes) or of spheres (to about 1e-3)."""
    points, normals, weights = [], [], []
    n = spread(DIRECTIONS)
    for i in range(len(p)):
        others = np.arange(len(p)) != i
        if p.shape[1] == 3:
            x = p[i] + r[i] * n
            free = np.all(np.linalg.norm(x[:, None] - p[others], axis=2) >= r[others], axis=1)
            points.append(x[free])
            normals.append(n[free])
            weights.append(np.full(free.sum(), 4.0 * np.pi * r[i] ** 2 / DIRECTIONS))
            continue
        for low, high in _free_arcs(p[i], r[i], p[others], r[others]):
            angle = 0.5 * (low + high) + 0.5 * (high - low) * _NODES
            normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            points.append(p[i] + r[i] * normal)
            normals.append(normal)
            weights.append(0.5 * r[i] * (high - low) * _WEIGHTS)
    return np.concatenate(points), np.concatenate(normals), np.concatenate(weights)


def _free_arcs(p: NDArray, r: float, others: NDArray, radii: NDArray) -> list[tuple[float, float]]:
    """Arcs (low, high) [rad] of a circle that lie in none of the other discs, none longer than a quarter."""
    away = others - p
    distance = np.linalg.norm(away, axis=1)
    if np.any(distance <= radii - r):
        return []
    cutting = (distance < r + radii) & (distance > r - radii)
    away, distance, radii = away[cutting], distance[cutting], radii[cutting]
    half = np.arccos(np.clip((distance**2 + r**2 - radii**2) / (2.0 * distance * r), -1.0, 1.0))
    low = np.mod(np.arctan2(away[:, 1], away[:, 0]) - half, 2.0 * np.pi)
    hidden = sorted([(a + s, a + s + 2.0 * h) for a, h in zip(low, half) for s in (-2.0 * np.pi, 0.0)])
    arcs, reached = [], 0.0
    for a, b in [*hidden, (2.0 * np.pi, 2.0 * np.pi)]:
        if a > reached:
            count = int(np.ceil((min(a, 2.0 * np.pi) - reached) / (0.5 * np.pi)))
            edge = np.linspace(reached, min(a, 2.0 * np.pi), count + 1)
            arcs += list(zip(edge[:-1], edge[1:]))
        reached = max(reached, b)
    return arcs


def _moments(x: NDArray, n: NDArray, weight: NDArray) -> tuple[float, NDArray, NDArray]:
    """(area or volume, centre of mass, second moments int x x^T) by the divergence theorem."""
    dim = x.shape[1]
    flux = np.sum(x * n, axis=1) * weight
    measure = flux.sum() / dim
    centroid = (flux[:, None] * x).sum(axis=0) / ((dim + 1) * measure)
    second = np.einsum("k,ki,kj->ij", flux, x, x) / (dim + 2)
    return float(measure), centroid, second


def from_chain(chain: ArcChain, shrink: float = 0.0) -> PatchGrain:
    """The arcs of a chain as general patches; every half-angle is reduced by `shrink` [rad], so that seams are missed.

    Mass, inertia and bounds are those of the chain.
    """
    centre, radius, axis, angle = chain.patches()
    return PatchGrain(
        name=f"{chain.name} as {chain.patch_count} cones",
        dim=2,
        measure=chain.measure,
        inertia=chain.inertia,
        bounding_radius=chain.bounding_radius,
        overlap_limit=chain.overlap_limit,
        lever=chain.lever,
        centre=centre,
        radius=radius,
        axis=axis,
        half_angle=angle - shrink if chain.patch_count > 1 else angle,
    )


def clump(centres: ArrayLike, radii: ArrayLike, *, name: str = "clump", **mass) -> PatchGrain:
    """A clump of full discs (centres (n, 2)) or spheres (n, 3); mass: measure and inertia if not those of the union,
    normalise as in `GrainShape.from_patches`."""
    p = np.array(centres, dtype=np.float64)
    axis = np.zeros_like(p)
    axis[..., 0] = 1.0
    return from_patches(p, radii, axis, np.full(len(p), np.pi), name=name, **mass)


def equal_clump(shape: ArcChain, count: int) -> PatchGrain:
    """`count` equal discs along the outline of an arc chain, the radius chosen for the least outline error.

    Mass and inertia are those of the chain, whose outline the clump stands for.
    """
    import shapely

    outline = shapely.Polygon(shape.outline(2000))
    best = None
    for radius in np.geomspace(0.02, 0.48, 40):
        inner = outline.buffer(-radius, quad_segs=32)
        if inner.is_empty or inner.geom_type != "Polygon":
            continue
        ring = inner.exterior
        at = [ring.interpolate((i + 0.5) / count, normalized=True) for i in range(count)]
        centres = np.array([[q.x, q.y] for q in at])
        error = _distance_to(outline, centres, np.full(count, radius))
        if best is None or error < best[0]:
            best = (error, centres, radius)
    _, centres, radius = best
    return clump(
        centres,
        np.full(count, radius),
        name=f"{shape.name} as {count} discs",
        measure=shape.measure,
        inertia=shape.inertia,
        normalise=False,
    )


def _distance_to(outline, centres: NDArray, radii: NDArray) -> float:
    import shapely

    body = shapely.union_all(shapely.buffer(shapely.points(centres), radii, quad_segs=64))
    if body.geom_type != "Polygon":
        return np.inf
    return float(shapely.hausdorff_distance(body.exterior, outline.exterior))


def outline_error(shape: ArcChain, approximation: GrainShape) -> float:
    """Hausdorff distance between the outlines of a chain and of its approximation, in equivalent diameters (2D)."""
    import shapely

    outline = shapely.Polygon(shape.outline(4000))
    if approximation.kind == "cones":
        return _distance_to(outline, approximation.centre, approximation.radius)
    return float(shapely.hausdorff_distance(shapely.Polygon(approximation.outline(4000)).exterior, outline.exterior))
