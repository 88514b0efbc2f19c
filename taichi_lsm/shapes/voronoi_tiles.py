"""Periodic Voronoi tiles, the raw material of angular grains, and the measures by which they are chosen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .geometry import polygon_integrals
from .input_checks import Seed, check_at_least, check_positive, number_array, random_generator

SHORT_SIDE = 1e-6  # of the equivalent diameter: sides below it come from four nearly cocircular sites


class PolygonMeasures(NamedTuple):
    """Measures of a simple polygon, in the unit L of its vertices.

    Attributes
    ----------
    sides : int
        Number of sides longer than 1e-6 equivalent diameters.
    aspect : float
        Square root of the ratio of the principal second moments, >= 1; a/b for an a x b rectangle.
    area : float
        Area [L^2].
    diameter : float
        Diameter of the disc of equal area [L].
    centroid : ndarray, (2,)
        Centre of mass [L].
    """

    sides: int
    aspect: float
    area: float
    diameter: float
    centroid: NDArray


def polygon_measures(vertices: ArrayLike) -> PolygonMeasures:
    """Measures of a counter-clockwise polygon.

    Parameters
    ----------
    vertices : array_like, (k, 2)
        Corners in order, k >= 3, in any unit of length L.

    Returns
    -------
    PolygonMeasures
        Sides, aspect, area, equivalent diameter and centroid, in that unit.

    Raises
    ------
    InputError
        If the polygon is not one or has no positive area.

    Notes
    -----
    The aspect is taken from the second moments and not from a bounding rectangle: it is smooth in the vertices and
    weighs the whole tile instead of its tips.
    """
    points = number_array("vertices", vertices)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.all(np.isfinite(points)):
        raise InputError(f"vertices has shape {points.shape}: must be (k, 2) with k >= 3, all finite")
    origin = points.mean(axis=0)  # far from the origin the products of the integrals would cancel
    a = points - origin
    twice_area, six_first, second_24 = polygon_integrals(a)
    area = 0.5 * twice_area
    if area <= 0:
        raise InputError(f"vertices enclose the area {area}: must be > 0, vertices counter-clockwise")
    offset = six_first / (6 * area)
    second = second_24 / 24 - area * np.outer(offset, offset)
    least, greatest = np.linalg.eigvalsh(second)
    diameter = np.sqrt(4 * area / np.pi)
    return PolygonMeasures(
        sides=int(np.sum(np.linalg.norm(np.roll(a, -1, axis=0) - a, axis=1) > SHORT_SIDE * diameter)),
        aspect=float(np.sqrt(greatest / least)),
        area=float(area),
        diameter=float(diameter),
        centroid=origin + offset,
    )


def voronoi_tiles(count: int, length: float, seed: Seed, relaxations: int = 3) -> list[NDArray]:
    """Voronoi tiles of random sites in a square that is periodic in both directions.

    Parameters
    ----------
    count : int
        Number of sites and tiles, >= 4.
    length : float
        Side of the square, > 0, in any unit of length L.
    seed : int or anything else that numpy.random.default_rng takes
        Decides the sites.
    relaxations : int
        Lloyd steps >= 0, which move each site to the centroid of its tile and make the tiles rounder.

    Returns
    -------
    list of ndarray, (k, 2)
        One convex polygon for each site, counter-clockwise [L]; tiles that cross the border are whole, and the areas
        sum to length^2.

    Raises
    ------
    InputError
        For count < 4, length <= 0, relaxations < 0 or a seed that is none.

    References
    ----------
    Lloyd (1982), IEEE Trans. Inf. Theory 28, 129-137.
    """
    check_at_least("count", count, 4, ", or a tile could touch itself across the border")
    check_positive("length", length)
    check_at_least("relaxations", relaxations, 0)
    sites = random_generator(seed).random((count, 2))
    tiles = _unit_tiles(sites)
    for _ in range(relaxations):
        sites = np.array([polygon_measures(tile).centroid for tile in tiles]) % 1.0
        tiles = _unit_tiles(sites)
    return [length * tile for tile in tiles]


def _unit_tiles(sites: NDArray) -> list[NDArray]:
    """Tiles of the sites (count, 2) in the periodic unit square: those of the middle copy of 3 x 3."""
    shifts = np.array([(0, 0)] + [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)])
    diagram = scipy.spatial.Voronoi((sites + shifts[:, None, :]).reshape(-1, 2))
    tiles = []
    for k, site in enumerate(sites):
        corners = diagram.vertices[diagram.regions[diagram.point_region[k]]]
        around = corners - site
        tiles.append(corners[np.argsort(np.arctan2(around[:, 1], around[:, 0]))])
    return tiles
