"""The generator of Abe & Mora (2003): an area or a volume split into tiles, one grain fitted to each."""

import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation
from shapely.geometry import Polygon

from .arc_chain import from_polygon
from .grain import rescaled
from .patch import ArcChain
from .polyhedra import placed_from_planes, voronoi_cells
from .tiling import voronoi_tiles


def pave(count, length, seed, corner_radius, gap, arcs_per_corner=4):
    """Random grains that fill a periodic square, one per Voronoi tile: (shapes, position (n, 2), diameter (n,)).

    length [L]: side of the square; corner_radius [L]: least patch radius; gap [L]: distance kept from the sides of
    the tile. The shapes have equivalent diameter 1; diameter [L] scales them back to their tile.
    Raises ValueError if a tile is too small for the corner radius.
    """
    shapes, places, diameters = [], [], []
    for tile in voronoi_tiles(count, length, seed):
        inset = np.array(Polygon(tile).buffer(-gap, join_style="mitre").exterior.coords)[:-1]
        fitted = from_polygon(inset, corner_radius, arcs_per_corner=arcs_per_corner, normalise=False)
        diameter = float(np.sqrt(4.0 * fitted.measure / np.pi))
        shapes.append(rescaled(fitted, 1.0 / diameter))
        places.append(_place(fitted, inset))
        diameters.append(diameter)
    return shapes, np.array(places), np.array(diameters)


def pave_volume(count, length, seed, corner_radius, gap):
    """Random grains that fill a periodic cube, one per Voronoi cell.

    length [L]: side of the cube; corner_radius [L]: dilation of each grain; gap [L]: distance kept from the planes of
    the cell. Returns (shapes of equivalent diameter 1, position (n, 3) [L], diameter (n,) [L], orientation (n, 4) as
    unit quaternions w, x, y, z). Raises ValueError if a cell is too small for the corner radius.
    """
    shapes, places, diameters, turns = [], [], [], []
    for k, (site, normals, distances) in enumerate(voronoi_cells(count, seed)):
        room = length * distances - gap
        shape, centre, frame = placed_from_planes(normals, room, corner_radius, name=f"tile {k}")
        diameter = (6.0 * shape.measure / np.pi) ** (1.0 / 3.0)
        shapes.append(shape.rescaled(1.0 / diameter))
        places.append(length * site + centre)
        diameters.append(diameter)
        turns.append(Rotation.from_matrix(frame).as_quat(scalar_first=True))
    return shapes, np.array(places), np.array(diameters), np.array(turns)


def _place(shape: ArcChain, polygon) -> np.ndarray:
    """Where the shape's centre of mass must lie for the shape to be as far as possible from all sides (2,) [L]."""
    side = np.roll(polygon, -1, axis=0) - polygon
    area = 0.5 * np.sum(polygon[:, 0] * np.roll(polygon[:, 1], -1) - polygon[:, 1] * np.roll(polygon[:, 0], -1))
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1) * np.sign(area)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    free = np.sum(normal * polygon, axis=1) - shape.support(normal)
    rows = np.column_stack([normal, np.ones(len(normal))])
    answer = linprog([0.0, 0.0, -1.0], A_ub=rows, b_ub=free, bounds=[(None, None)] * 3, method="highs")
    return answer.x[:2]
