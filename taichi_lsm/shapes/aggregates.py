"""Grains that can break: angular pieces cut from a tiling, with the pairs of pieces that share a side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arc_chain import ArcChain
from .voronoi_grains import fitted_grain
from .voronoi_tiles import voronoi_tiles

TILES = 4  # tiles of the plane per piece that is taken from it
LEAST_SIDE = 0.1  # length of a side that counts as shared, in diameters of a piece


@dataclass(frozen=True, eq=False)
class Aggregate:
    """Pieces that together have the area of a disc of diameter 1, about their common centre of mass.

    shapes    pieces, each of equivalent diameter 1
    position  (m, 2) where their centres of mass lie
    diameter  (m,) by which each is scaled
    pairs     (p, 2) pieces that share a side; together they join all of them
    reach     distance of the farthest point from the centre
    """

    shapes: list[ArcChain]
    position: NDArray
    diameter: NDArray
    pairs: NDArray
    reach: float


def angular_aggregate(pieces, seed, corner_radius, arcs_per_corner=4):
    """Aggregate of `pieces` Voronoi tiles (2D), those of a tiling that lie nearest to one point.

    pieces >= 2; corner_radius: least radius of curvature, in equivalent diameters of an average piece; the pieces touch
    and do not overlap. Raises ValueError for numbers out of range and for tiles too small for the corner radius.
    """
    if pieces < 2:
        raise ValueError(f"pieces = {pieces}: must be at least 2")
    if not 0 < corner_radius < 0.5:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.5")
    count = max(16, TILES * pieces)
    length = float(np.sqrt(count * np.pi / 4.0))  # an average tile has equivalent diameter 1
    tiles = voronoi_tiles(count, length, seed)
    middle = np.array([tile.mean(axis=0) for tile in tiles])
    nearest = np.argsort(np.linalg.norm(middle - 0.5 * length, axis=1), kind="stable")[:pieces]
    tiles = [tiles[i] for i in nearest]
    fitted = [fitted_grain(tile, corner_radius, arcs_per_corner) for tile in tiles]
    shapes, places, diameters = (list(column) for column in zip(*fitted))
    position, diameter = np.array(places), np.array(diameters)
    mass = diameter**2
    position -= mass @ position / mass.sum()
    size = float(np.sqrt(mass.sum()))
    pairs = np.array([(i, j) for i in range(pieces) for j in range(i) if _shared(tiles[i], tiles[j]) > LEAST_SIDE])
    reach = (np.linalg.norm(position, axis=1) + diameter * [s.bounding_radius for s in shapes]).max()
    return Aggregate(shapes, position / size, diameter / size, pairs, float(reach / size))


def _shared(a, b):
    """Length of the side that two tiles share; 0 if there is none."""
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    common = a[(apart < 1e-9).any(axis=1)]
    return float(np.linalg.norm(common[0] - common[1])) if len(common) == 2 else 0.0
