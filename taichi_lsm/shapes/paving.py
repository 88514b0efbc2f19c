"""The generator of Abe & Mora (2003): an area split into tiles, one grain fitted to each."""

import numpy as np
import scipy

from .arc_chain import ArcChain
from .base import rescaled
from .polygon_fit import from_polygon
from .voronoi_tiles import voronoi_tiles


def pave(count, length, seed, corner_radius, gap, arcs_per_corner=4):
    """Random grains that fill a periodic square, one per Voronoi tile: (shapes, position (n, 2), diameter (n,)).

    length [L]: side of the square; corner_radius [L]: least patch radius; gap [L]: distance kept from the sides of
    the tile. The shapes have equivalent diameter 1; diameter [L] scales them back to their tile.
    Raises ValueError if a tile is too small for the corner radius.
    """
    import shapely

    shapes, places, diameters = [], [], []
    for tile in voronoi_tiles(count, length, seed):
        inset = np.array(shapely.Polygon(tile).buffer(-gap, join_style="mitre").exterior.coords)[:-1]
        shape, place, diameter = fitted_grain(inset, corner_radius, arcs_per_corner)
        shapes.append(shape)
        places.append(place)
        diameters.append(diameter)
    return shapes, np.array(places), np.array(diameters)


def fitted_grain(polygon, corner_radius, arcs_per_corner=4):
    """Grain inside a convex polygon (k, 2) [L]: (shape of equivalent diameter 1, its place (2,) [L], diameter [L])."""
    fitted = from_polygon(polygon, corner_radius, arcs_per_corner=arcs_per_corner, normalise=False)
    diameter = float(np.sqrt(4.0 * fitted.measure / np.pi))
    return rescaled(fitted, 1.0 / diameter), _place(fitted, polygon), diameter


def _place(shape: ArcChain, polygon) -> np.ndarray:
    """Where the shape's centre of mass must lie for the shape to be as far as possible from all sides (2,) [L]."""
    side = np.roll(polygon, -1, axis=0) - polygon
    area = 0.5 * np.sum(polygon[:, 0] * np.roll(polygon[:, 1], -1) - polygon[:, 1] * np.roll(polygon[:, 0], -1))
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1) * np.sign(area)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    free = np.sum(normal * polygon, axis=1) - shape.support(normal)
    rows = np.column_stack([normal, np.ones(len(normal))])
    answer = scipy.optimize.linprog([0.0, 0.0, -1.0], A_ub=rows, b_ub=free, bounds=[(None, None)] * 3, method="highs")
    return answer.x[:2]
