"""Tiles of a periodic cube (3D): Voronoi, or Laguerre if the tiles are to differ in size, and a grain for each tile."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from .ball_polyhedron import BallPolyhedron
from .polyhedra import corners_of, inscribed_ball, placed_from_planes

FITS = 8  # fits of one grain: each removes nearly all that the one before sticks out of its tile
CHAMFER = 0.15  # depth of the cut of a corner, in its distance from the middle of the tile
INSIDE = 1e-12  # of the tile's diameter: by how much rounding may let a grain pass a plane


@dataclass(frozen=True, eq=False)
class Tile:
    """A convex cell of a periodic tiling, all lengths in the unit of the cube's side.

    site       (3,) the point that owns the tile, inside the cube; the tile itself may cross the border and is whole
    normals    (m, 3) outward unit normals of the tile's planes
    distances  (m,) of the planes from the site: the tile is (x - site) . normals[i] <= distances[i]
    neighbours (m,) the tile behind each plane
    vertices   (k, 3) corners
    volume     of the tile
    """

    site: NDArray
    normals: NDArray
    distances: NDArray
    neighbours: NDArray
    vertices: NDArray
    volume: float


def laguerre_tiles(count: int, length: float, seed, relaxations: int = 3, radii: ArrayLike | None = None) -> list[Tile]:
    """`count` tiles of a periodic cube of side `length`; their volumes sum to length^3.

    A tile holds the points x whose power |x - site|^2 - radius^2 is least, images of the sites included. radii
    (count,) >= 0, in the unit of length, are thus the sizes of balls whose tiles are wanted: a larger ball gets the
    larger tile. Without them the tiling is Voronoi's. seed: anything numpy.random.default_rng takes. relaxations:
    Lloyd steps, which move each site to the centre of mass of its tile and make the tiles rounder, while the radii
    grow from 0 to those that were asked for.
    Aurenhammer (1987), SIAM J. Comput. 16, 78-96.
    Raises ValueError if a number is out of range or the radii leave a site without a tile.
    """
    if count < 1:
        raise ValueError(f"count = {count}: must be at least 1")
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"length = {length}: must be finite and > 0")
    if relaxations < 0:
        raise ValueError(f"relaxations = {relaxations}: must be >= 0")
    # The tessellation has tolerances of fixed length, so it is made with about one unit of volume for each tile.
    side = count ** (1.0 / 3.0)
    weights = np.zeros(count)
    if radii is not None:
        sizes = np.array(radii, dtype=np.float64)
        if sizes.shape != (count,) or not np.all(np.isfinite(sizes) & (sizes >= 0)):
            raise ValueError(f"radii = {radii}: must be {count} finite lengths >= 0")
        weights = (sizes * side / length) ** 2
    sites = side * np.random.default_rng(seed).random((count, 3))
    # Random sites lie so close together in places that a large ball would swallow small ones: its weight grows while
    # the sites move apart.
    for step in range(relaxations):
        cells = _cells(sites, side, weights * step / relaxations)
        sites = np.mod([cell["site"] + _centre_of_mass(cell) for cell in cells], side)
    cells = _cells(sites, side, weights)
    return [_tile(cells, k, side, weights, length / side) for k in range(count)]


def _cells(sites: NDArray, side: float, weights: NDArray) -> list[dict]:
    """Cells of the sites (n, 3) in the periodic cube, in their order, with vertices relative to the site."""
    import pyvoro2

    cells = pyvoro2.compute(
        sites,
        domain=pyvoro2.OrthorhombicCell(((0.0, side),) * 3),
        mode="power",
        weights=weights,
        return_face_shifts=True,
        include_empty=True,
        output="cells",
    )
    cells.sort(key=lambda cell: cell["id"])
    empty = [cell["id"] for cell in cells if cell["volume"] <= 0.0]
    if empty:
        raise ValueError(f"radii: sites {empty} get no tile, for larger ones swallow them; let the radii differ less")
    for cell in cells:
        cell["site"] = sites[cell["id"]]
        cell["corners"] = np.array(cell["vertices"]) - cell["site"]
    return cells


def _centre_of_mass(cell: dict) -> NDArray:
    """Centre of mass (3,) of a cell, from its site: the sum over the pyramids that stand on triangles of its faces."""
    corners = cell["corners"]
    origin = corners.mean(axis=0)
    fans = [(f["vertices"][0], a, b) for f in cell["faces"] for a, b in zip(f["vertices"][1:-1], f["vertices"][2:])]
    a, b, c = (corners[[fan[i] for fan in fans]] - origin for i in range(3))
    volume = np.abs(np.sum(a * np.cross(b, c), axis=1))
    return origin + volume @ (a + b + c) / (4.0 * volume.sum())


def _tile(cells: list[dict], k: int, side: float, weights: NDArray, scale: float) -> Tile:
    """The tile of cell k, with every length times `scale`; its planes follow from the sites and not from corners,
    so that both sides of a plane have it in the same place."""
    cell = cells[k]
    beyond = np.array([face["adjacent_cell"] for face in cell["faces"]])
    shifts = np.array([face["adjacent_shift"] for face in cell["faces"]])
    way = np.array([cells[b]["site"] for b in beyond]) + side * shifts - cell["site"]
    apart = np.linalg.norm(way, axis=1)
    return Tile(
        site=scale * cell["site"],
        normals=way / apart[:, None],
        distances=scale * 0.5 * (apart**2 + weights[k] - weights[beyond]) / apart,
        neighbours=beyond,
        vertices=scale * (cell["site"] + cell["corners"]),
        volume=float(scale**3 * cell["volume"]),
    )


def laguerre_packing(
    count: int,
    length: float,
    seed,
    corner_radius: float,
    gap: float,
    relaxations: int = 3,
    radii: ArrayLike | None = None,
    chamfers: int = 0,
) -> tuple[list[BallPolyhedron], NDArray, NDArray, NDArray]:
    """Random grains that fill a periodic cube, one for each tile of `laguerre_tiles`.

    length [L]: side of the cube; corner_radius [L]: dilation of each grain; gap >= 0 [L]: least distance of a grain
    from the planes of its tile; chamfers >= 0: how many of a tile's sharpest corners are cut, which adds a face each
    to the thirteen that tiles have on average. Returns (shapes of equivalent diameter 1, position (n, 3) [L] of the
    centres of mass, diameter (n,) [L], orientation (n, 4): unit quaternions w, x, y, z from the shape's frame to the
    cube's).
    Raises ValueError as `laguerre_tiles`, and if a tile is too small for the corner radius and the gap.
    """
    if not (np.isfinite(gap) and gap >= 0):
        raise ValueError(f"gap = {gap}: must be finite and >= 0")
    shapes, places, diameters, turns = [], [], [], []
    for k, tile in enumerate(laguerre_tiles(count, length, seed, relaxations, radii)):
        shape, centre, frame = grain_in_tile(without_corners(tile, chamfers), corner_radius, gap, f"tile {k}")
        diameter = float((6.0 * shape.measure / np.pi) ** (1.0 / 3.0))
        shapes.append(shape.rescaled(1.0 / diameter))
        places.append(centre)
        diameters.append(diameter)
        turns.append(scipy.spatial.transform.Rotation.from_matrix(frame).as_quat(scalar_first=True))
    return shapes, np.array(places), np.array(diameters), np.array(turns)


def without_corners(tile: Tile, count: int) -> Tile:
    """The tile with `count` corners cut, each time the one that is farthest from the largest ball within it.

    A cut is a plane across the line from the ball's centre to the corner, CHAMFER of that line below the corner. Its
    neighbour is -1: there is no tile behind it. The volume stays that of the whole tile.
    """
    if count < 0:
        raise ValueError(f"chamfers = {count}: must be >= 0")
    for _ in range(count):
        middle, _ = inscribed_ball(tile.normals, tile.distances)
        ways = corners_of(tile.normals, tile.distances, middle) - middle
        farthest = ways[np.argmax(np.linalg.norm(ways, axis=1))]
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
    from all planes, and fitted once more to planes drawn in by as much as is still missing.
    Raises ValueError if the tile is too small for the corner radius and the gap.
    """
    room = tile.distances - gap
    inset = 0.0
    for _ in range(FITS):
        try:
            shape, _, frame = placed_from_planes(tile.normals, room - inset, corner_radius, name=name)
        except ValueError as error:
            raise ValueError(f"{name}, gap = {gap}: too small for such a grain: {error}") from None
        place, spare = _farthest_from(tile.normals, room - shape.support(tile.normals @ frame))
        if spare >= -INSIDE * shape.bounding_radius:
            return shape, tile.site + place, frame
        inset += -1.01 * spare
    raise ValueError(f"{name}: sticks out of its planes by {-spare:.3g} after {FITS} fits")


def _farthest_from(normals: NDArray, free: NDArray) -> tuple[NDArray, float]:
    """(x (3,), t): the x of the greatest t with normals[i] . x + t <= free[i]."""
    rows = np.column_stack([normals, np.ones(len(normals))])
    anywhere = [(None, None)] * 4
    answer = scipy.optimize.linprog([0.0, 0.0, 0.0, -1.0], rows, free, bounds=anywhere, method="highs")
    return answer.x[:3], float(np.min(free - normals @ answer.x[:3]))
