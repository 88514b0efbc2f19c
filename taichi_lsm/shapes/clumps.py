"""Clumps of full discs or spheres, arc chains as general patches, and how far an outline is approximated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .arc_chain import ArcChain
from .cone_patches import PatchGrain, from_patches
from .input_checks import check_at_least, number_array

if TYPE_CHECKING:
    import shapely

TRIAL_RADII = np.geomspace(0.02, 0.48, 40)  # of the discs of a clump, in equivalent diameters


def from_chain(chain: ArcChain, shrink: float = 0.0) -> PatchGrain:
    """The arcs of a chain as general patches.

    Parameters
    ----------
    chain : ArcChain
        A 2D shape.
    shrink : float
        Angle [rad] by which every half-angle is reduced, so that the cones leave gaps at the seams; negative: overlaps.

    Returns
    -------
    PatchGrain
        Grain whose mass, inertia and bounds are those of the chain.

    Raises
    ------
    InputError
        If the chain is 3D or a half-angle leaves (0, pi].
    """
    if chain.dim != 2:
        raise InputError(f"chain = {chain!r}: must be 2D")
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


def clump(
    centres: ArrayLike,
    radii: ArrayLike,
    *,
    name: str = "clump",
    measure: float | None = None,
    inertia: ArrayLike | None = None,
    normalise: bool = True,
) -> PatchGrain:
    """A clump of full discs (2D) or spheres (3D).

    Parameters
    ----------
    centres : array_like, (n, 2) or (n, 3)
        Centres of the discs or spheres, in any unit of length L.
    radii : array_like, (n,)
        Their radii > 0 [L].
    name : str
        What pictures and files call the shape.
    measure : float, optional
        Area [L^2] or volume [L^3]; by default that of the union.
    inertia : array_like, optional
        Second moments about the origin, (1,) [L^4] or principal (3,) [L^5]; by default those of the union about its
        centre of mass.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit L is kept.

    Returns
    -------
    PatchGrain
        The grain, in its body frame.

    Raises
    ------
    InputError
        As `from_patches`.
    """
    p = number_array("centres", centres)
    if p.ndim != 2:
        raise InputError(f"centres has shape {p.shape}: must be (n, 2) or (n, 3)")
    axis = np.zeros_like(p)
    axis[..., 0] = 1.0
    mass = {"measure": measure, "inertia": inertia}
    return from_patches(p, radii, axis, np.full(len(p), np.pi), name=name, **mass, normalise=normalise)


def equal_clump(shape: ArcChain, count: int) -> PatchGrain:
    """Equal discs along the outline of an arc chain, the radius chosen for the least outline error.

    Parameters
    ----------
    shape : ArcChain
        A 2D shape of equivalent diameter 1.
    count : int
        Number of discs, >= 1.

    Returns
    -------
    PatchGrain
        Clump whose mass and inertia are those of the chain, whose outline it stands for.

    Raises
    ------
    InputError
        If the shape is 3D or too slender for such discs, or count < 1.
    """
    import shapely

    check_at_least("count", count, 1)
    outline = shapely.Polygon(shape.outline(2000))
    best = None
    for radius in TRIAL_RADII:
        # Discs about even places of the outline drawn in by their radius touch the outline from inside.
        inner = outline.buffer(-radius, quad_segs=32)
        if inner.is_empty or not isinstance(inner, shapely.Polygon):
            continue
        ring = inner.exterior
        at = [ring.interpolate((i + 0.5) / count, normalized=True) for i in range(count)]
        centres = np.array([[q.x, q.y] for q in at])
        error = _distance_to(outline, centres, np.full(count, radius))
        if best is None or error < best[0]:
            best = (error, centres, radius)
    if best is None:
        raise InputError(f"shape = {shape!r}: no disc of radius {TRIAL_RADII[0]:g} to {TRIAL_RADII[-1]:g} fits inside")
    _, centres, radius = best
    return clump(
        centres,
        np.full(count, radius),
        name=f"{shape.name} as {count} discs",
        measure=shape.measure,
        inertia=shape.inertia,
        normalise=False,
    )


def _distance_to(outline: shapely.Polygon, centres: NDArray, radii: NDArray) -> float:
    """Hausdorff distance of the union of discs from an outline; infinite if the discs do not hang together."""
    import shapely

    body = shapely.union_all(shapely.buffer(shapely.points(centres), radii, quad_segs=64))
    if not isinstance(body, shapely.Polygon):
        return np.inf
    return float(shapely.hausdorff_distance(body.exterior, outline.exterior))


def outline_error(shape: ArcChain, approximation: ArcChain | PatchGrain) -> float:
    """Hausdorff distance between the outlines of a chain and of its approximation (2D).

    Parameters
    ----------
    shape : ArcChain
        The 2D shape that is approximated.
    approximation : ArcChain or PatchGrain
        Another chain, or a clump of full discs, in the same frame and unit.

    Returns
    -------
    float
        The distance [diameter]; infinite if the discs of a clump do not hang together.

    Raises
    ------
    InputError
        If one of the shapes is 3D.
    """
    import shapely

    outline = shapely.Polygon(shape.outline(4000))
    if isinstance(approximation, PatchGrain):
        if approximation.dim != 2:
            raise InputError(f"approximation = {approximation!r}: must be 2D")
        return _distance_to(outline, approximation.centre, approximation.radius)
    return float(shapely.hausdorff_distance(shapely.Polygon(approximation.outline(4000)).exterior, outline.exterior))
