"""Grains of general spherical patches, the structure of Abe & Mora (2003).

Every patch is tested by itself with the corrected cone test: directions that two cones cover count twice, directions
that none covers do not count. Only cones that tile the circle keep the energy; circular cones never tile the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .base import GrainShape, Patches, frozen_array
from .geometry import even_directions, principal_frame
from .input_checks import check_positive, number_array
from .patch_mass import DIRECTIONS, surface_moments, surface_of_patches

MOST_PATCHES = 1000
CLOSED = 0.05  # uncovered plus doubly covered share above which the patches enclose no definite area or volume


class Coverage(NamedTuple):
    """How well the cones of a grain tile all directions.

    Attributes
    ----------
    uncovered : float
        Share of the full angle (2D) or solid angle (3D) that no cone covers.
    doubly_covered : float
        Share that more than one cone covers.
    """

    uncovered: float
    doubly_covered: float


class Patch(NamedTuple):
    """One patch as a part of its grain; arrays of one row each, see `GrainShape.patches`."""

    dim: int
    centre: NDArray
    radius: NDArray
    axis: NDArray
    half_angle: NDArray

    @property
    def kind(self) -> str:
        """The contact geometry that reads the patch: cones."""
        return "cones"

    @property
    def patch_count(self) -> int:
        """Number of patches: 1."""
        return 1

    def patches(self) -> Patches:
        """See `GrainShape.patches`."""
        return self.centre, self.radius, self.axis, self.half_angle


@dataclass(frozen=True, eq=False, repr=False)
class PatchGrain(GrainShape):
    """A grain of any spherical patches, each with a cone of normals.

    Parameters
    ----------
    name, dim, measure, inertia, bounding_radius, overlap_limit, lever
        See `GrainShape`. The overlap limit is the least radius: contacts deeper than the sum of two are taken for far
        sides that face each other.
    centre : ndarray, (patches, dim)
        Centres of the patches [diameter], body frame.
    radius : ndarray, (patches,)
        Their radii > 0 [diameter].
    axis : ndarray, (patches, dim)
        Outward unit axes of the cones of normals, body frame.
    half_angle : ndarray, (patches,)
        Half-angles of the cones [rad], above 0 and at most pi (the full disc or sphere).

    Raises
    ------
    InputError
        If a field has the wrong form.

    References
    ----------
    Abe and Mora (2003), Efficient implementation of complex particle shapes in the lattice solid model, ICCS 2003.
    """

    centre: NDArray
    radius: NDArray
    axis: NDArray
    half_angle: NDArray

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("centre", "radius", "axis", "half_angle"):
            object.__setattr__(self, field, frozen_array(field, getattr(self, field)))
        _check_patches(self.dim, self.centre, self.radius, self.axis, self.half_angle)

    @property
    def kind(self) -> str:
        """The contact geometry that reads the surface: cones."""
        return "cones"

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return self.radius.size

    @property
    def parts(self) -> tuple[Patch, ...]:
        """Every patch is a part by itself, with its own contacts."""
        rows = zip(self.centre, self.radius, self.axis, self.half_angle, strict=True)
        return tuple(Patch(self.dim, *(np.array([value]) for value in row)) for row in rows)

    def patches(self) -> Patches:
        """See `GrainShape.patches`."""
        return self.centre, self.radius, self.axis, self.half_angle

    def part_bounds(self) -> tuple[NDArray, NDArray]:
        """Balls that hold the contact points of each patch, in the body frame.

        Returns
        -------
        centre : ndarray, (patches, dim)
            Centres of the balls [diameter].
        radius : ndarray, (patches,)
            Their radii [diameter].

        Notes
        -----
        That of a patch narrower than a half-space is the ball about the spherical cap, otherwise the ball of the patch;
        contacts lie up to the overlap limit within the surface, by which the balls of partial patches are widened.
        """
        narrow = self.half_angle < 0.5 * np.pi
        cos, sin = np.cos(self.half_angle), np.sin(self.half_angle)
        shift = np.where(narrow, self.radius * cos, 0.0)
        reach = np.where(narrow, self.radius * sin, self.radius)
        margin = np.where(self.half_angle < np.pi, self.overlap_limit, 0.0)
        return self.centre + shift[:, None] * self.axis, reach + margin

    def coverage(self) -> Coverage:
        """How well the cones tile all directions.

        Returns
        -------
        Coverage
            Shares of the directions that no cone and that more than one cone covers; exact in 2D, by 20000 directions
            in 3D.
        """
        if self.dim == 3:
            n = even_directions(DIRECTIONS)
            count = ((n @ self.axis.T) >= np.where(self.half_angle < np.pi, np.cos(self.half_angle), -2.0)).sum(axis=1)
            return Coverage(float((count == 0).mean()), float((count > 1).mean()))
        # Sweep over the ends of the cones, those of the periods before and after included, and count how many are open.
        full = 2.0 * np.pi
        start = np.mod(np.arctan2(self.axis[:, 1], self.axis[:, 0]) - self.half_angle, full)
        low = np.concatenate([start - full, start, start + full])
        ends = np.concatenate([low, low + np.tile(2.0 * self.half_angle, 3)])
        change = np.repeat([1, -1], len(low))
        order = np.argsort(ends)
        at, depth = ends[order], np.cumsum(change[order])
        inside = np.clip(at, 0.0, full)
        width = np.diff(inside)
        covered, twice = width[depth[:-1] >= 1].sum(), width[depth[:-1] > 1].sum()
        return Coverage(float(max(0.0, 1.0 - covered / full)), float(twice / full))


def _check_patches(dim: int, centre: NDArray, radius: NDArray, axis: NDArray, half_angle: NDArray) -> None:
    """Refuse arrays of the wrong form and values out of range."""
    count = radius.size
    if radius.ndim != 1 or not 1 <= count <= MOST_PATCHES or np.any(radius <= 0):
        raise InputError(f"radius has shape {radius.shape}: must be 1 to {MOST_PATCHES} values > 0")
    for field, value in (("centre", centre), ("axis", axis)):
        if value.shape != (count, dim):
            raise InputError(f"{field} has shape {value.shape}: must be {(count, dim)}")
    if half_angle.shape != (count,) or np.any((half_angle <= 0) | (half_angle > np.pi)):
        raise InputError(f"half_angle = {half_angle}: must be {count} values above 0 and at most pi rad")
    length = np.linalg.norm(axis, axis=1)
    if np.any(np.abs(length - 1.0) > 1e-9):
        raise InputError(f"axis has lengths {length}: must be unit vectors")


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

    Parameters
    ----------
    centre : array_like, (patches, dim)
        Centres of the patches, in any unit of length L; all arrays are in one frame.
    radius : array_like, (patches,)
        Their radii > 0 [L].
    axis : array_like, (patches, dim)
        Outward unit axes of the cones of normals.
    half_angle : array_like, (patches,)
        Half-angles of the cones [rad], above 0 and at most pi.
    name : str
        What pictures and files call the shape.
    measure : float, optional
        Area [L^2] or volume [L^3] > 0. Computed, as is the inertia, if not both are given.
    inertia : array_like, optional
        Second moments about the origin: (1,) polar [L^4] in 2D, (3,) principal [L^5] along the axes in 3D.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit L is kept.

    Returns
    -------
    PatchGrain
        The grain. If mass and inertia are computed it is moved to its centre of mass and, in 3D, rotated into the
        principal frame; otherwise it stays in the given frame, which must be the body frame.

    Raises
    ------
    InputError
        For values out of range, and if measure and inertia are not given though the cones leave or doubly cover more
        than 5 % of the directions (unless all patches are full).

    Notes
    -----
    `coverage()` of the result says how well the cones tile, which decides whether contacts keep the energy. Also called
    as `GrainShape.from_patches`.

    References
    ----------
    Abe and Mora (2003), Efficient implementation of complex particle shapes in the lattice solid model, ICCS 2003.
    """
    p, r = number_array("centre", centre), number_array("radius", radius)
    e, alpha = number_array("axis", axis), number_array("half_angle", half_angle)
    if p.ndim != 2 or p.shape[1] not in (2, 3):
        raise InputError(f"centre has shape {p.shape}: must be (patches, 2) or (patches, 3)")
    _check_patches(p.shape[1], p, r, e, alpha)
    if measure is None or inertia is None:
        p, e, measure, moments = _in_principal_frame(p, r, e, alpha)
    else:
        moments = number_array("inertia", inertia)
    return _normalised(name, p, r, e, alpha, measure, moments, normalise)


def _in_principal_frame(p: NDArray, r: NDArray, e: NDArray, alpha: NDArray) -> tuple[NDArray, NDArray, float, NDArray]:
    """(centres, axes, measure, moments) of patches about their centre of mass, in 3D along the principal axes."""
    _check_closed(p, r, e, alpha)
    measure, centroid, second = surface_moments(*surface_of_patches(p, r, e, alpha))
    moments, frame = principal_frame(second - measure * np.outer(centroid, centroid))
    p = p - centroid
    if p.shape[1] == 3:
        p, e = p @ frame, e @ frame
    return p, e, measure, moments


def _normalised(
    name: str,
    p: NDArray,
    r: NDArray,
    e: NDArray,
    alpha: NDArray,
    measure: float,
    moments: NDArray,
    normalise: bool,
) -> PatchGrain:
    """The grain of these patches, rescaled to the equivalent diameter 1 if asked for."""
    check_positive("measure", measure)
    dim = p.shape[1]
    if normalise:
        unit = np.pi / 4 if dim == 2 else np.pi / 6
        factor = (unit / measure) ** (1.0 / dim)
        p, r, measure, moments = p * factor, r * factor, unit, moments * factor ** (dim + 2)
    return _grain(name, dim, p, r, e, alpha, measure, moments)


def _check_closed(p: NDArray, r: NDArray, e: NDArray, alpha: NDArray) -> None:
    """Refuse partial patches whose cones leave gaps or overlap so much that they enclose no definite body."""
    dim = p.shape[1]
    gaps = _grain("trial", dim, p, r, e, alpha, 1.0, np.ones(1 if dim == 2 else 3)).coverage()
    if np.any(alpha < np.pi) and sum(gaps) > CLOSED:
        raise InputError(
            f"measure, inertia: must be given, for the patches enclose no definite body: {gaps.uncovered:.3g} of "
            f"the directions are uncovered and {gaps.doubly_covered:.3g} covered twice"
        )


def _grain(
    name: str, dim: int, p: NDArray, r: NDArray, e: NDArray, alpha: NDArray, measure: float, inertia: NDArray
) -> PatchGrain:
    """The grain of patches given in its body frame, with the bounds that follow from them."""
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
