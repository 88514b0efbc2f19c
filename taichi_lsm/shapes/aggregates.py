"""Grains that can break: angular pieces cut from a tiling, with the pairs of pieces that share a side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arc_chain import ArcChain
from .base import Balls, counted
from .input_checks import Seed, check_at_least, check_corner_radius
from .voronoi_grains import fitted_grain
from .voronoi_tiles import voronoi_tiles

TILES = 4  # tiles of the plane per piece that is taken from it
LEAST_SIDE = 0.1  # length of a side that counts as shared, in diameters of a piece


@dataclass(frozen=True, eq=False, repr=False)
class Aggregate:
    """Pieces that together have the area of a disc of diameter 1, about their common centre of mass.

    Parameters
    ----------
    shapes : list of ArcChain
        The m pieces, each of equivalent diameter 1, body frame.
    position : ndarray, (m, 2)
        Centres of mass of the pieces [diameter of the aggregate].
    diameter : ndarray, (m,)
        Equivalent diameters of the pieces [diameter of the aggregate].
    pairs : ndarray, (p, 2)
        Pieces that share a side; together the pairs join all of them.
    reach : float
        Distance of the farthest point from the centre [diameter of the aggregate].
    """

    shapes: list[ArcChain]
    position: NDArray
    diameter: NDArray
    pairs: NDArray
    reach: float

    def __repr__(self) -> str:
        pieces, pairs = (
            counted(len(rows), noun, f"{noun}s") for rows, noun in ((self.shapes, "piece"), (self.pairs, "pair"))
        )
        return f"Aggregate({pieces}, {pairs}, reach {self.reach:.3g})"

    def spanning_balls(self) -> Balls:
        """Balls that span all pieces, see `GrainShape.spanning_balls` [diameter of the aggregate]."""
        pieces = [
            (place + size * centre, size * radius)
            for place, size, (centre, radius) in zip(
                self.position, self.diameter, (shape.spanning_balls() for shape in self.shapes), strict=True
            )
        ]
        centres, radii = zip(*pieces, strict=True)
        return np.concatenate(centres), np.concatenate(radii)


def angular_aggregate(pieces: int, seed: Seed, corner_radius: float, arcs_per_corner: int = 4) -> Aggregate:
    """An aggregate of Voronoi tiles (2D), those of a tiling that lie nearest to one point.

    Parameters
    ----------
    pieces : int
        Number of pieces, >= 2.
    seed : int or anything else that numpy.random.default_rng takes
        Decides the tiles.
    corner_radius : float
        Least radius of curvature in equivalent diameters of an average piece, above 0 and below 0.5.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.

    Returns
    -------
    Aggregate
        Pieces that touch and do not overlap.

    Raises
    ------
    InputError
        For numbers out of range and for tiles too small for the corner radius.
    """
    check_at_least("pieces", pieces, 2)
    check_corner_radius(corner_radius)
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


def _shared(a: NDArray, b: NDArray) -> float:
    """Length of the side that two tiles share; 0 if there is none."""
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    common = a[(apart < 1e-9).any(axis=1)]
    return float(np.linalg.norm(common[0] - common[1])) if len(common) == 2 else 0.0
