"""Tiles of a periodic cube (3D): Voronoi, or Laguerre if the tiles are to differ in size, and a grain for each tile."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .ball_polyhedron import BallPolyhedron
from .geometry import deepest_point
from .input_checks import Seed, check_at_least, check_positive, number_array, random_generator
from .polyhedra import corners_of, from_planes_and_frame

FITS = 8  # fits of one grain: each removes nearly all that the one before sticks out of its tile
CHAMFER = 0.15  # depth of the cut of a corner, in its distance from the middle of the tile
INSIDE = 1e-12  # of the tile's diameter: by how much rounding may let a grain pass a plane


@dataclass(frozen=True, eq=False)
class Tile:
    """A convex cell of a periodic tiling, all lengths in the unit L of the side of the cube.

    Parameters
    ----------
    site : ndarray, (3,)
        The point that owns the tile, inside the cube [L]; the tile itself may cross the border and is whole.
    normals : ndarray, (m, 3)
        Outward unit normals of the planes of the tile.
    distances : ndarray, (m,)
        Distances of the planes from the site [L]: the tile is (x - site) . normals[i] <= distances[i].
    neighbours : ndarray of int, (m,)
        The tile behind each plane, -1 behind the cut of a corner.
    vertices : ndarray, (k, 3)
        Corners [L].
    volume : float
        Volume [L^3], that of the whole tile if corners are cut.
    """

    site: NDArray
    normals: NDArray
    distances: NDArray
    neighbours: NDArray
    vertices: NDArray
    volume: float


def laguerre_tiles(
    count: int, length: float, seed: Seed, relaxations: int = 3, radii: ArrayLike | None = None
) -> list[Tile]:
    """Tiles of random sites in a periodic cube, Voronoi or Laguerre.

    Parameters
    ----------
    count : int
        Number of sites and tiles, >= 1.
    length : float
        Side of the cube, > 0, in any unit of length L.
    seed : int or anything else that numpy.random.default_rng takes
        Decides the sites.
    relaxations : int
        Lloyd steps >= 0, which move each site to the centre of mass of its tile and make the tiles rounder, while the
        radii grow from 0 to those that were asked for.
    radii : array_like, (count,), optional
        Radii >= 0 of balls about the sites [L]: a larger ball gets the larger tile. Without them the tiling is
        Voronoi's.

    Returns
    -------
    list of Tile
        One tile for each site; their volumes sum to length^3.

    Raises
    ------
    InputError
        If a number is out of range or the radii leave a site without a tile.

    Notes
    -----
    A tile holds the points x whose power |x - site|^2 - radius^2 is least, images of the sites included.

    References
    ----------
    Aurenhammer (1987), SIAM J. Comput. 16, 78-96.
    """
    check_at_least("count", count, 1)
    check_positive("length", length)
    check_at_least("relaxations", relaxations, 0)
    # The tessellation has tolerances of fixed length, so it is made with about one unit of volume for each tile.
    side = count ** (1.0 / 3.0)
    weights = np.zeros(count)
    if radii is not None:
        sizes = number_array("radii", radii)
        if sizes.shape != (count,) or not np.all(np.isfinite(sizes) & (sizes >= 0)):
            raise InputError(f"radii = {radii}: must be {count} finite lengths >= 0")
        weights = (sizes * side / length) ** 2
    sites = side * random_generator(seed).random((count, 3))
    # Random sites lie so close together in places that a large ball would swallow small ones: its weight grows while
    # the sites move apart.
    for step in range(relaxations):
        cells = _cells(sites, side, weights * step / relaxations)
        sites = np.mod([cell["site"] + _centre_of_mass(cell) for cell in cells], side)
    cells = _cells(sites, side, weights)
    return [_tile(cells, k, side, weights, length / side) for k in range(count)]


def _cells(sites: NDArray, side: float, weights: NDArray) -> list[dict[str, Any]]:
    """Cells of the sites (n, 3) in the periodic cube, in their order, with vertices relative to the site."""
    import pyvoro2

    period = (0.0, side)
    answer = pyvoro2.compute(
        sites,
        domain=pyvoro2.OrthorhombicCell((period, period, period)),
        mode="power",
        weights=weights,
        return_face_shifts=True,
        include_empty=True,
        output="cells",
    )
    cells = cast("list[dict[str, Any]]", answer)  # which it is for output="cells"
    cells.sort(key=lambda cell: cell["id"])
    empty = [cell["id"] for cell in cells if cell["volume"] <= 0.0]
    if empty:
        raise InputError(f"radii: sites {empty} get no tile, for larger ones swallow them; let the radii differ less")
    for cell in cells:
        cell["site"] = sites[cell["id"]]
        cell["corners"] = np.array(cell["vertices"]) - cell["site"]
    return cells


def _centre_of_mass(cell: dict[str, Any]) -> NDArray:
    """Centre of mass (3,) of a cell, from its site: the sum over the pyramids that stand on triangles of its faces."""
    corners = cell["corners"]
    origin = corners.mean(axis=0)
    fans = [(f["vertices"][0], a, b) for f in cell["faces"] for a, b in zip(f["vertices"][1:-1], f["vertices"][2:])]
    a, b, c = (corners[[fan[i] for fan in fans]] - origin for i in range(3))
    volume = np.abs(np.sum(a * np.cross(b, c), axis=1))
    return origin + volume @ (a + b + c) / (4.0 * volume.sum())


def _tile(cells: list[dict[str, Any]], k: int, side: float, weights: NDArray, unit: float) -> Tile:
    """The tile of cell k, with every length times `unit`.

    Its planes follow from the sites and not from corners, so that both sides of a plane have it in the same place.
    """
    cell = cells[k]
    beyond = np.array([face["adjacent_cell"] for face in cell["faces"]])
    shifts = np.array([face["adjacent_shift"] for face in cell["faces"]])
    branch = np.array([cells[b]["site"] for b in beyond]) + side * shifts - cell["site"]
    apart = np.linalg.norm(branch, axis=1)
    return Tile(
        site=unit * cell["site"],
        normals=branch / apart[:, None],
        distances=unit * 0.5 * (apart**2 + weights[k] - weights[beyond]) / apart,
        neighbours=beyond,
        vertices=unit * (cell["site"] + cell["corners"]),
        volume=float(unit**3 * cell["volume"]),
    )


def laguerre_packing(
    count: int,
    length: float,
    seed: Seed,
    corner_radius: float,
    gap: float,
    relaxations: int = 3,
    radii: ArrayLike | None = None,
    chamfers: int = 0,
) -> tuple[list[BallPolyhedron], NDArray, NDArray, NDArray]:
    """Random grains that fill a periodic cube, one for each tile of `laguerre_tiles`.

    Parameters
    ----------
    count : int
        Number of grains, >= 1.
    length : float
        Side of the cube, > 0, in any unit of length L.
    seed : int or anything else that numpy.random.default_rng takes
        Decides the tiles.
    corner_radius : float
        Dilation of each grain [L], > 0.
    gap : float
        Least distance of a grain from the planes of its tile [L], >= 0.
    relaxations, radii
        See `laguerre_tiles`.
    chamfers : int
        Number >= 0 of the corners of each tile, those farthest from the largest ball within it, that are cut; each adds
        a face to the thirteen that tiles have on average.

    Returns
    -------
    shapes : list of BallPolyhedron
        Shapes of equivalent diameter 1, body frame.
    position : ndarray, (count, 3)
        Centres of mass [L], frame of the cube.
    diameter : ndarray, (count,)
        Equivalent diameters [L].
    orientation : ndarray, (count, 4)
        Unit quaternions w, x, y, z from the body frame of each shape to the frame of the cube.

    Raises
    ------
    InputError
        As `laguerre_tiles`, and if a tile is too small for the corner radius and the gap.
    """
    if not (np.isfinite(gap) and gap >= 0):
        raise InputError(f"gap = {gap}: must be finite and >= 0")
    shapes, places, diameters, orientations = [], [], [], []
    for k, tile in enumerate(laguerre_tiles(count, length, seed, relaxations, radii)):
        shape, centre, frame = grain_in_tile(without_corners(tile, chamfers), corner_radius, gap, f"tile {k}")
        diameter = float((6.0 * shape.measure / np.pi) ** (1.0 / 3.0))
        shapes.append(shape.rescaled(1.0 / diameter))
        places.append(centre)
        diameters.append(diameter)
        orientations.append(scipy.spatial.transform.Rotation.from_matrix(frame).as_quat(scalar_first=True))
    return shapes, np.array(places), np.array(diameters), np.array(orientations)


def without_corners(tile: Tile, count: int) -> Tile:
    """The tile with `count` corners cut, each time the one that is farthest from the largest ball within it.

    A cut is a plane across the line from the ball's centre to the corner, CHAMFER of that line below the corner. Its
    neighbour is -1: there is no tile behind it. The volume stays that of the whole tile.
    """
    check_at_least("chamfers", count, 0)
    for _ in range(count):
        middle, _ = deepest_point(tile.normals, tile.distances)
        arms = corners_of(tile.normals, tile.distances, middle) - middle
        farthest = arms[np.argmax(np.linalg.norm(arms, axis=1))]
        n = farthest / np.linalg.norm(farthest)
        normals = np.vstack([tile.normals, n])
        distances = np.append(tile.distances, n @ (middle + (1.0 - CHAMFER) * farthest))
        tile = replace(
            tile,
            normals=normals,
            distances=distances,
            neighbours=np.append(tile.neighbours, -1),
            vertices=tile.site + corners_of(normals, distances, middle),
        )
    return tile


def grain_in_tile(
    tile: Tile, corner_radius: float, gap: float, name: str = "tile"
) -> tuple[BallPolyhedron, NDArray, NDArray]:
    """The grain of one tile, in the tile's unit of length: (shape, centre of mass (3,), rotation matrix (3, 3)).

    The fit leaves faces out that are very small, and may stick out there. So the grain is put where it is farthest
    from all planes, and fitted once more to planes drawn in by as much as is still missing. InputError if the tile is
    too small for the corner radius and the gap.
    """
    distances = tile.distances - gap
    inset, spare = 0.0, -np.inf
    for _ in range(FITS):
        try:
            shape, _, frame = from_planes_and_frame(tile.normals, distances - inset, corner_radius, name=name)
        except ValueError as error:
            raise InputError(f"{name}, gap = {gap}: too small for such a grain: {error}") from None
        free = distances - shape.support(tile.normals @ frame)
        place, _ = deepest_point(tile.normals, free)
        spare = float(np.min(free - tile.normals @ place))
        if spare >= -INSIDE * shape.bounding_radius:
            return shape, tile.site + place, frame
        inset += -1.01 * spare
    raise InputError(
        f"{name}: sticks out of its planes by {-spare:.3g} after {FITS} fits; ask for a larger gap or fewer chamfers"
    )
