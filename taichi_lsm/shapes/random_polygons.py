"""Irregular rounded polygons (2D), as `random_polyhedra` in 3D: sides that touch an ellipse all round."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from .arc_chain import ArcChain
from .ball_polyhedron import SLACK
from .corner_radius import meeting_corner
from .ellipses import unit_normals
from .polygon_fit import arc_chain

FLATTEST = 5.0  # radius of a side's arc, in sizes of the ellipse
TRIES = 20  # draws of one random grain


def tangent_arcs(points: NDArray, normals: NDArray, radius: NDArray, corner_radius: float, name: str) -> ArcChain:
    """Discs that touch `points` (n, 2) from inside cut each other; their common part, rounded, equivalent diameter 1.

    normals (n, 2): outward, in counter-clockwise order; radius (n,) of the sides' arcs and corner_radius of the arcs
    between them, in the unit of the points. Raises ValueError if some disc has no part in the outline.
    """
    inner = radius - corner_radius
    centre = points - radius[:, None] * normals
    way = np.roll(centre, -1, axis=0) - centre
    apart = np.linalg.norm(way, axis=1)
    along = 0.5 * (apart**2 + inner**2 - np.roll(inner, -1) ** 2) / apart
    if np.any(inner <= 0) or np.any(np.abs(along) >= inner):
        raise ValueError("radius: two neighbouring sides do not meet")
    unit = way / apart[:, None]
    aside = np.stack([unit[:, 1], -unit[:, 0]], axis=1)  # the corner lies to the right of the way between the centres
    reach = np.sqrt(inner**2 - along**2)[:, None]
    first, other = (s * reach * aside + along[:, None] * unit for s in (1.0, -1.0))
    outer = np.sum((first - other) * (normals + np.roll(normals, -1, axis=0)), axis=1, keepdims=True) > 0
    corner = centre + np.where(outer, first, other)
    before = np.roll(corner, 1, axis=0) - centre
    after = corner - centre
    breaks = np.unwrap(np.ravel(np.column_stack([np.arctan2(*before.T[::-1]), np.arctan2(*after.T[::-1])])))
    span = np.diff(breaks, append=breaks[0] + 2.0 * np.pi)
    if np.any(span <= 0):
        raise ValueError("radius: a side vanishes between its neighbours")
    return arc_chain(breaks, np.ravel(np.column_stack([radius, np.full(len(radius), corner_radius)])), name=name)


def random_polygons(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    sides: tuple[int, int] = (6, 10),
    elongation: float = 1.0,
    angularity: float = 1.0,
) -> list[ArcChain]:
    """`count` irregular 2D grains that touch an ellipse all round, equivalent diameter 1, two arcs for each side.

    sides: fewest and most sides, both included, drawn evenly. elongation: axis ratio of the ellipse, 1 to 4.
    angularity: share of the roundness that the sides give up to the corners, 0 to 1; the curvature of a side is
    1 - angularity times that of the roundest sides (SLACK times the least disc that leaves the others their place),
    but never less than 1/FLATTEST sizes. corner_radius: in units of the grain's equivalent diameter, met to 1e-10. The
    sides touch at even angles of the ellipse, moved by up to a quarter of their distance. Deterministic in the seed,
    and the first n shapes are the same whatever the count.
    Raises ValueError if a number is out of range or none of TRIES draws gives a grain.
    """
    if count < 0:
        raise ValueError(f"count = {count}: must be >= 0")
    if not 4 <= sides[0] <= sides[1]:
        raise ValueError(f"sides = {sides}: must be (fewest, most) with 4 <= fewest <= most")
    if not 1 <= elongation <= 4:
        raise ValueError(f"elongation = {elongation}: must be from 1 to 4")
    if not 0 <= angularity <= 1:
        raise ValueError(f"angularity = {angularity}: must be from 0 to 1")
    if not 0 < corner_radius < 0.5:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.5, which is a disc")
    axes = 0.5 * np.sqrt(elongation) ** np.array([1.0, -1.0])
    slack = SLACK / max(1.0 - angularity, 1e-6)

    def grain(k: int) -> ArcChain:
        rng = np.random.default_rng([seed, k])
        name = f"random polygon {seed}-{k}"
        for _ in range(TRIES):
            m = int(rng.integers(sides[0], sides[1] + 1))
            u = unit_normals((np.arange(m) + rng.uniform() + rng.uniform(-0.25, 0.25, m)) * 2.0 * np.pi / m)
            n = u / axes / np.linalg.norm(u / axes, axis=1, keepdims=True)
            try:
                return meeting_corner(partial(_touching, axes * u, n, slack, name), corner_radius, axes[1])
            except ValueError as failure:  # a side without room: another draw
                error = failure
        raise ValueError(
            f"sides = {sides}, elongation = {elongation}, angularity = {angularity}, corner_radius = {corner_radius}: "
            f"no grain in {TRIES} draws ({error})"
        )

    return [grain(k) for k in range(count)]


def _touching(points: NDArray, normals: NDArray, slack: float, name: str, corner_radius: float) -> ArcChain:
    return tangent_arcs(points, normals, _radii(points, normals, corner_radius, slack), corner_radius, name)


def _radii(points: NDArray, normals: NDArray, corner_radius: float, slack: float) -> NDArray:
    """Radii (n,) of the sides: `slack` times the least disc that holds the points of all others, with the corners."""
    inset = points - corner_radius * normals
    away = inset - inset[:, None]
    drop = -2.0 * np.einsum("ijk,ik->ij", away, normals)
    np.fill_diagonal(drop, np.inf)
    if np.any(drop <= 0):
        raise ValueError("points: must be those of a convex body that holds the corner radius")
    least = (np.sum(away**2, axis=2) / drop).max(axis=1)
    return np.minimum(slack * least, FLATTEST * np.ptp(points, axis=0).max()) + corner_radius
