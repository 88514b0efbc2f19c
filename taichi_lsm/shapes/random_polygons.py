"""Irregular rounded polygons (2D), as `random_polyhedra` in 3D: sides that touch an ellipse all round."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from ..core.errors import InputError
from .arc_chain import ArcChain
from .corner_radius import radius_for_corner
from .geometry import unit_normals
from .input_checks import check_fewest_and_most
from .polygon_fit import arc_chain
from .random_draws import check_request, closed_grains, slack_of

FLATTEST = 5.0  # default radius of the arcs of the flattest sides, in sizes of the ellipse
JITTER = 0.25  # of the distance of neighbouring sides: by how much their directions are moved


def tangent_arcs(points: NDArray, normals: NDArray, radius: NDArray, corner_radius: float, name: str) -> ArcChain:
    """The common part of discs that touch `points` (n, 2) from inside, rounded, of equivalent diameter 1.

    normals (n, 2): outward, in counter-clockwise order; radius (n,) of the sides' arcs and corner_radius of the arcs
    between them, in the unit of the points. InputError if some disc has no share in the outline.
    """
    inner = radius - corner_radius
    centre = points - radius[:, None] * normals
    branch = np.roll(centre, -1, axis=0) - centre
    apart = np.linalg.norm(branch, axis=1)
    along = 0.5 * (apart**2 + inner**2 - np.roll(inner, -1) ** 2) / apart
    if np.any(inner <= 0) or np.any(np.abs(along) >= inner):
        raise InputError("radius: two neighbouring sides do not meet")
    # Neighbouring circles meet in two points to either side of the line between their centres; the corner is the outer
    # one, and the arc of a side runs from the corner before it to the corner after it.
    unit = branch / apart[:, None]
    aside = np.stack([unit[:, 1], -unit[:, 0]], axis=1)
    reach = np.sqrt(inner**2 - along**2)[:, None]
    first, other = (s * reach * aside + along[:, None] * unit for s in (1.0, -1.0))
    outer = np.sum((first - other) * (normals + np.roll(normals, -1, axis=0)), axis=1, keepdims=True) > 0
    corner = centre + np.where(outer, first, other)
    before = np.roll(corner, 1, axis=0) - centre
    after = corner - centre
    ends = np.column_stack([np.arctan2(*before.T[::-1]), np.arctan2(*after.T[::-1])])  # of the arc of each side
    breaks = np.asarray(np.unwrap(np.ravel(ends)), dtype=np.float64)
    span = np.diff(breaks, append=breaks[0] + 2.0 * np.pi)
    if np.any(span <= 0):
        raise InputError("radius: a side vanishes between its neighbours")
    return arc_chain(breaks, np.ravel(np.column_stack([radius, np.full(len(radius), corner_radius)])), name=name)


def random_polygons(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    sides: tuple[int, int] = (6, 10),
    elongation: float = 1.0,
    angularity: float = 1.0,
    *,
    flatness: float = FLATTEST,
) -> list[ArcChain]:
    """Irregular 2D grains whose sides touch an ellipse all round, two arcs for each side.

    Parameters
    ----------
    count : int
        Number of grains, >= 0.
    seed : int
        Decides the grains, >= 0; the first n shapes of a seed are the same whatever the count.
    corner_radius : float
        Least radius of each grain in its own equivalent diameters, above 0 and below 0.5; met to 1e-10.
    sides : tuple of int
        Fewest and most sides, both included, drawn evenly; fewest >= 4.
    elongation : float
        Ratio of the axes of the ellipse, 1 to 4.
    angularity : float
        Share of the roundness that the sides give up to the corners, 0 to 1.
    flatness : float
        Greatest radius of the arc of a side in sizes of the ellipse, > 0.

    Returns
    -------
    list of ArcChain
        Shapes of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        If a number is out of range or none of 20 draws gives a grain.

    Notes
    -----
    The curvature of a side is 1 - angularity times that of the roundest sides (1.25 times the radius of the least disc
    that leaves the others their place), but never less than the inverse of flatness times the size of the ellipse. The
    sides touch at even angles of the ellipse, moved by up to a quarter of their distance.
    """
    check_request(count, elongation, angularity, corner_radius, flatness)
    check_fewest_and_most("sides", sides, 4)
    axes = 0.5 * np.sqrt(elongation) ** np.array([1.0, -1.0])
    slack = slack_of(angularity)

    def draw(rng: Generator, name: str) -> ArcChain:
        """A grain of a random number of sides, whose normals are even over the ellipse but for jitter."""
        m = int(rng.integers(sides[0], sides[1] + 1))
        u = unit_normals((np.arange(m) + rng.uniform() + rng.uniform(-JITTER, JITTER, m)) * 2.0 * np.pi / m)
        n = u / axes / np.linalg.norm(u / axes, axis=1, keepdims=True)
        fit = partial(_touching, axes * u, n, slack, flatness, name)
        return fit(radius_for_corner(lambda asked: fit(asked).overlap_limit, corner_radius, axes[1]))

    request = f"{sides = }, {elongation = }, {angularity = }, {corner_radius = }"
    return closed_grains(draw, count, seed, "random polygon", request)


def _touching(
    points: NDArray, normals: NDArray, slack: float, flatness: float, name: str, corner_radius: float
) -> ArcChain:
    """The grain whose sides touch `points` with the radii that `slack` gives."""
    radius = _radii(points, normals, corner_radius, slack, flatness)
    return tangent_arcs(points, normals, radius, corner_radius, name)


def _radii(points: NDArray, normals: NDArray, corner_radius: float, slack: float, flatness: float) -> NDArray:
    """Radii (n,) of the sides: `slack` times the least disc that holds the points of all others, with the corners."""
    inset = points - corner_radius * normals
    away = inset - inset[:, None]
    drop = -2.0 * np.einsum("ijk,ik->ij", away, normals)  # (i, j): twice the depth of point j under the tangent at i
    np.fill_diagonal(drop, np.inf)
    if np.any(drop <= 0):
        raise InputError("points: must be those of a convex body that holds the corner radius")
    least = (np.sum(away**2, axis=2) / drop).max(axis=1)
    return np.minimum(slack * least, flatness * np.ptp(points, axis=0).max()) + corner_radius
