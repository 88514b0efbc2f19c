"""Grains that can break (3D): a convex polyhedron cut into Voronoi cells, each of which holds a rounded piece."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.errors import InputError
from .aggregates import Aggregate
from .ball_polyhedron import BallPolyhedron
from .geometry import even_directions, polygon_integrals, polyhedron_integrals, principal_frame
from .input_checks import Seed, check_at_least, check_corner_radius, random_generator
from .laguerre_tiles import Tile, grain_in_tile
from .polyhedra import corners_of
from .random_polyhedra import voronoi_cells

CELLS = 16  # of the tiling from which a whole grain is taken
FACES = (10, 18)  # of a whole grain, as of unbreakable ones
MOST_ASPECT = 1.5  # likewise
RELAXATIONS = 3  # Lloyd steps, which make the pieces rounder and more equal
DRAWS = 8  # of a grain until all of its pieces hold the corner radius
LEAST_AREA = 0.01  # of a face that counts as shared, in squared diameters of a piece
DIRECTIONS, CLIMBS = 500, 12  # in which the farthest point of a piece is looked for
ON_FACE = 1e-7  # of the size of a piece: distance of its corners from a plane on which they lie

Planes = tuple[NDArray, NDArray]  # outward unit normals (k, 3) and distances from the origin (k,)


def polyhedral_aggregate(pieces: int, seed: Seed, corner_radius: float) -> Aggregate:
    """An aggregate of ball-polyhedra (3D), the Voronoi cells of points inside one convex grain.

    Parameters
    ----------
    pieces : int
        Number of pieces, >= 2.
    seed : int or anything else that numpy.random.default_rng takes
        Decides the grain and its pieces.
    corner_radius : float
        Radius of edges and corners in equivalent diameters of an average piece, above 0 and below 0.5.

    Returns
    -------
    Aggregate
        Pieces that touch and do not overlap. Their masses are exactly those of a sphere of diameter 1 together; the
        space between their rounded edges belongs to none of them.

    Raises
    ------
    InputError
        For numbers out of range, and if none of 8 grains has pieces that hold the corner radius.

    Notes
    -----
    The whole grain is a cell of a relaxed Voronoi tiling with 10 to 18 faces and an aspect below 1.5, as the angular
    grains of `random_angular_polyhedra` are. A piece holds the points of the grain that are nearer to its own point
    than to that of any other piece; three Lloyd steps move each point to the centre of mass of its piece.
    """
    check_at_least("pieces", pieces, 2)
    check_corner_radius(corner_radius)
    rng, reason = random_generator(seed), ""
    for _ in range(DRAWS):
        try:
            return _rounded(cut_grain(whole_grain(rng), pieces, rng), corner_radius)
        except InputError as error:
            reason = str(error)
    raise InputError(
        f"pieces = {pieces}, corner_radius = {corner_radius}: none of {DRAWS} grains has pieces that hold such "
        f"corners; lower one of the two ({reason})"
    )


def whole_grain(rng: Generator) -> Planes:
    """Planes of a convex grain about its Voronoi site: see the notes of `polyhedral_aggregate`."""
    while True:
        for _, normals, distances in voronoi_cells(CELLS, rng):
            _, _, second = polyhedron_integrals(corners_of(normals, distances, np.zeros(3)))
            moments, _ = principal_frame(second)
            axes = moments.sum() / 2.0 - moments  # second moments along the principal axes
            if FACES[0] <= len(normals) <= FACES[1] and np.sqrt(axes.max() / axes.min()) < MOST_ASPECT:
                return normals, distances


def cut_grain(planes: Planes, pieces: int, rng: Generator) -> list[Tile]:
    """The Voronoi cells, within the planes of a grain, of random points that Lloyd steps have moved apart.

    `neighbours` of a tile: the tile behind each plane, -1 where that is a plane of the grain.
    """
    normals, distances = planes
    corners = corners_of(normals, distances, np.zeros(3))
    low, high = corners.min(axis=0), corners.max(axis=0)
    sites = np.zeros((0, 3))
    while len(sites) < pieces:
        points = rng.uniform(low, high, (pieces, 3))
        sites = np.concatenate([sites, points[np.all(points @ normals.T < distances, axis=1)]])[:pieces]
    tiles = [_tile(planes, sites, i) for i in range(pieces)]
    for _ in range(RELAXATIONS):
        sites = np.array([polyhedron_integrals(tile.vertices)[1] for tile in tiles])
        tiles = [_tile(planes, sites, i) for i in range(pieces)]
    return tiles


def _tile(planes: Planes, sites: NDArray, i: int) -> Tile:
    """The cell of site i (3D): half-spaces of the grain and those nearer to it than to each other site."""
    branch = np.delete(sites, i, axis=0) - sites[i]
    apart = np.linalg.norm(branch, axis=1)
    normals = np.concatenate([planes[0], branch / apart[:, None]])
    distances = np.concatenate([planes[1] - planes[0] @ sites[i], 0.5 * apart])
    others = np.concatenate([np.full(len(planes[0]), -1), np.delete(np.arange(len(sites)), i)])
    vertices = corners_of(normals, distances, np.zeros(3))
    volume, _, _ = polyhedron_integrals(vertices)
    return Tile(sites[i], normals, distances, others, sites[i] + vertices, volume)


def shared_area(tile: Tile, other: int) -> float:
    """Area of the face that a tile of `cut_grain` shares with another one; 0 if there is none."""
    (row,) = np.flatnonzero(tile.neighbours == other)
    n, arms = tile.normals[row], tile.vertices - tile.site
    own = arms[np.abs(arms @ n - tile.distances[row]) < ON_FACE * np.ptp(arms, axis=0).max()]
    if len(own) < 3:
        return 0.0
    # The corners in the plane of the face, in order round their mean.
    flat = (own - own.mean(axis=0)) @ np.linalg.svd(n[None])[2][1:].T
    twice_area, _, _ = polygon_integrals(flat[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))])
    return 0.5 * twice_area


def _rounded(tiles: list[Tile], corner_radius: float) -> Aggregate:
    """The aggregate of the grains that lie in tiles; InputError if one is too small for the corner radius."""
    mean = (6.0 / np.pi * sum(tile.volume for tile in tiles) / len(tiles)) ** (1.0 / 3.0)
    shapes, position, diameter, rotation = [], [], [], []
    for k, tile in enumerate(tiles):
        shape, place, frame = grain_in_tile(tile, corner_radius * mean, 0.0, f"piece {k}")
        own = float((6.0 / np.pi * shape.measure) ** (1.0 / 3.0))
        shapes.append(shape.rescaled(1.0 / own))
        position.append(place)
        diameter.append(own)
        rotation.append(Rotation.from_matrix(frame).as_quat(scalar_first=True))
    position, diameter = np.array(position), np.array(diameter)
    mass = diameter**3
    position -= mass @ position / mass.sum()
    size = float(mass.sum() ** (1.0 / 3.0))
    areas = {(i, j): shared_area(tiles[i], j) for j in range(len(tiles)) for i in range(j)}
    joined = {pair: area for pair, area in areas.items() if area > LEAST_AREA * mean**2}
    reach = max(_farthest(*piece) for piece in zip(shapes, position, diameter, rotation, strict=True))
    return Aggregate(
        shapes,
        position / size,
        diameter / size,
        np.array(rotation),
        np.array(list(joined)),
        np.array(list(joined.values())) / size**2,
        reach / size,
    )


def _farthest(shape: BallPolyhedron, place: NDArray, diameter: float, rotation: NDArray) -> float:
    """Greatest distance of a piece from the origin.

    The outward normal at the farthest point x is x/|x|. So the support point along x/|x| of any point x is as far away
    or farther, and its repetition climbs to the farthest one; it begins with the best of even directions.
    """
    middle = Rotation.from_quat(rotation, scalar_first=True).inv().apply(place)  # in the body frame
    n, far = even_directions(DIRECTIONS), middle
    for _ in range(CLIMBS):
        x = middle + diameter * shape.support_points(n)
        far = x[np.argmax(np.linalg.norm(x, axis=1))]
        n = far[None] / np.linalg.norm(far)
    return float(np.linalg.norm(far))
