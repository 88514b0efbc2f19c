"""Periodic Voronoi tiles, the raw material of angular grains, and the measures by which they are chosen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

SHORT_SIDE = 1e-6  # of the equivalent diameter: sides below it come from four nearly cocircular sites


class PolygonMeasures(NamedTuple):
    """Measures of a simple polygon, in the unit L of its vertices."""

    sides: int  # sides longer than SHORT_SIDE equivalent diameters
    aspect: float  # sqrt of the ratio of the principal second moments, >= 1; a/b for an a x b rectangle
    area: float  # [L^2]
    diameter: float  # of the disc of equal area [L]
    centroid: NDArray  # (2,) [L]


def polygon_measures(vertices: ArrayLike) -> PolygonMeasures:
    """Measures of a counter-clockwise polygon, vertices (k, 2).

    The aspect is taken from the second moments and not from a bounding rectangle: it is smooth in the
    vertices and weighs the whole tile instead of its tips. Raises ValueError if the polygon is not one or has
    no positive area.
    """
    points = np.asarray(vertices, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.all(np.isfinite(points)):
        raise ValueError(f"vertices has shape {points.shape}: must be (k, 2) with k >= 3, all finite")
    origin = points.mean(axis=0)  # far from the origin the products below would cancel
    a = points - origin
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = 0.5 * cross.sum()
    if area <= 0:
        raise ValueError(f"vertices enclose the area {area}: must be > 0, vertices counter-clockwise")
    offset = ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
    # integral of x x^T over the triangle (0, a, b) is cross/24 times the sum below
    outer = np.einsum("ki,kj->kij", a, a) + np.einsum("ki,kj->kij", b, b)
    outer += np.einsum("ki,kj->kij", a + b, a + b)
    second = np.einsum("k,kij->ij", cross, outer) / 24 - area * np.outer(offset, offset)
    least, greatest = np.linalg.eigvalsh(second)
    diameter = np.sqrt(4 * area / np.pi)
    return PolygonMeasures(
        sides=int(np.sum(np.linalg.norm(b - a, axis=1) > SHORT_SIDE * diameter)),
        aspect=float(np.sqrt(greatest / least)),
        area=float(area),
        diameter=float(diameter),
        centroid=origin + offset,
    )


def voronoi_tiles(count: int, length: float, seed, relaxations: int = 3) -> list[NDArray]:
    """Voronoi tiles of `count` random sites in a square of side `length`, periodic in both directions.

    seed: anything numpy.random.default_rng takes. relaxations: Lloyd steps, which move each site to the
    centroid of its tile and make the tiles rounder. Returns `count` convex polygons (k, 2),
    counter-clockwise, in the unit of length; tiles that cross the border are whole, and the areas sum to
    length^2.
    Raises ValueError for count < 4, length <= 0 or relaxations < 0.
    """
    if count < 4:
        raise ValueError(f"count = {count}: must be at least 4, or a tile could touch itself across the border")
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"length = {length}: must be finite and > 0")
    if relaxations < 0:
        raise ValueError(f"relaxations = {relaxations}: must be >= 0")
    sites = np.random.default_rng(seed).random((count, 2))
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
