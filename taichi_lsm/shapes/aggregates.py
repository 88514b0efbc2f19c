"""Grains that can break: angular pieces, with the pairs of them that share a side or a face; those of tiles in 2D."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from ..core.errors import InputError
from .arc_chain import ArcChain
from .ball_polyhedron import BallPolyhedron
from .base import Balls, counted
from .input_checks import Seed, check_at_least, check_corner_radius, random_generator
from .voronoi_grains import fitted_grain
from .voronoi_tiles import voronoi_tiles

TILES = 4  # tiles of the plane per piece that is taken from it
DRAWS = 8  # of tiles until the pieces are joined
LEAST_SIDE = 0.1  # length of a side that counts as shared, in diameters of a piece


@dataclass(frozen=True, eq=False, repr=False)
class Aggregate:
    """Pieces that together have the area of a disc, or the volume of a sphere, of diameter 1.

    Their common centre of mass is the origin.

    Parameters
    ----------
    shapes : sequence of ArcChain or BallPolyhedron
        The m pieces, each of equivalent diameter 1, body frame.
    position : ndarray, (m, dim)
        Centres of mass of the pieces [diameter of the aggregate].
    diameter : ndarray, (m,)
        Equivalent diameters of the pieces [diameter of the aggregate].
    rotation : ndarray
        From the body frame of each piece to that of the aggregate: angles (m,) [rad] in 2D, unit quaternions w, x, y, z
        (m, 4) in 3D.
    pairs : ndarray, (p, 2)
        Pieces that share a side or a face; together the pairs join all of them.
    area : ndarray, (p,)
        Length of the side [diameter of the aggregate], or area of the face [its square], that a pair shares.
    reach : float
        Distance of the farthest point from the centre [diameter of the aggregate].
    """

    shapes: Sequence[ArcChain | BallPolyhedron]
    position: NDArray
    diameter: NDArray
    rotation: NDArray
    pairs: NDArray
    area: NDArray
    reach: float

    def __repr__(self) -> str:
        pieces, pairs = (
            counted(len(rows), noun, f"{noun}s") for rows, noun in ((self.shapes, "piece"), (self.pairs, "pair"))
        )
        return f"Aggregate({pieces}, {pairs}, reach {self.reach:.3g})"

    def spanning_balls(self) -> Balls:
        """Balls that span all pieces, see `GrainShape.spanning_balls` [diameter of the aggregate]."""
        centres, radii = [], []
        for place, size, shape, rotation in zip(self.position, self.diameter, self.shapes, self.rotation, strict=True):
            centre, radius = shape.spanning_balls()
            if shape.dim == 3:
                centre = Rotation.from_quat(rotation, scalar_first=True).apply(centre)
            centres.append(place + size * centre)
            radii.append(size * radius)
        return np.concatenate(centres), np.concatenate(radii)

    def support(self, normals: NDArray) -> NDArray:
        """Support function max x . n over all points x (k,) [diameter of the aggregate]; n: unit normals (k, dim)."""
        reach = []
        for place, size, shape, rotation in zip(self.position, self.diameter, self.shapes, self.rotation, strict=True):
            body = normals
            if shape.dim == 3:
                body = Rotation.from_quat(rotation, scalar_first=True).inv().apply(normals)
            reach.append(normals @ place + size * shape.support(body))
        return np.max(reach, axis=0)


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
        For numbers out of range, for tiles too small for the corner radius, and if no tiles of 8 draws are joined.
    """
    check_at_least("pieces", pieces, 2)
    check_corner_radius(corner_radius)
    tiles, pairs, sides = _joined_tiles(pieces, random_generator(seed))
    fitted = [fitted_grain(tile, corner_radius, arcs_per_corner) for tile in tiles]
    shapes, places, diameters = (list(column) for column in zip(*fitted))
    position, diameter = np.array(places), np.array(diameters)
    mass = diameter**2
    position -= mass @ position / mass.sum()
    size = float(np.sqrt(mass.sum()))
    reach = (np.linalg.norm(position, axis=1) + diameter * [s.bounding_radius for s in shapes]).max()
    angle = np.zeros(pieces)  # tiles are fitted as they lie
    return Aggregate(shapes, position / size, diameter / size, angle, pairs, sides / size, float(reach / size))


def _joined_tiles(pieces: int, rng: Generator) -> tuple[list[NDArray], NDArray, NDArray]:
    """Tiles about one point that their shared sides join, the pairs (p, 2) that share one, and its lengths (p,)."""
    count = max(16, TILES * pieces)
    length = float(np.sqrt(count * np.pi / 4.0))  # an average tile has equivalent diameter 1
    for _ in range(DRAWS):
        tiles = voronoi_tiles(count, length, rng)
        middle = np.array([tile.mean(axis=0) for tile in tiles])
        nearest = np.argsort(np.linalg.norm(middle - 0.5 * length, axis=1), kind="stable")[:pieces]
        tiles = [tiles[i] for i in nearest]
        shared = {(i, j): _shared(tiles[i], tiles[j]) for i in range(pieces) for j in range(i)}
        shared = {pair: side for pair, side in shared.items() if side > LEAST_SIDE}
        ends = np.array(list(shared)).reshape(-1, 2)
        if connected_components(coo_array((np.ones(len(ends)), ends.T), (pieces, pieces)), directed=False)[0] == 1:
            return tiles, ends, np.array(list(shared.values()))
    raise InputError(f"pieces = {pieces}: no tiles of {DRAWS} draws are joined by their sides; take another seed")


def _shared(a: NDArray, b: NDArray) -> float:
    """Length of the side that two tiles share; 0 if there is none."""
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    common = a[(apart < 1e-9).any(axis=1)]
    return float(np.linalg.norm(common[0] - common[1])) if len(common) == 2 else 0.0
