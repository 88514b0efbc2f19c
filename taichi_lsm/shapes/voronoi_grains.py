"""Ready-made families of grains."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from .arc_chain import ArcChain
from .base import rescaled
from .polygon_fit import from_polygon
from .voronoi_tiles import polygon_measures, voronoi_tiles

TILES_PER_BATCH = 256  # fixed, so that the first n shapes of a seed do not depend on how many are asked for
BARREN_BATCHES = 8  # batches without one acceptable tile after which the request counts as impossible
CORNER_TOLERANCE = 1e-11  # of the equivalent diameter


def random_angular_shapes(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    sides: tuple[int, int] = (5, 7),
    max_aspect: float = 1.5,
) -> list[ArcChain]:
    """`count` angular 2D grains: relaxed Voronoi tiles with rounded corners, equivalent diameter 1.

    Tiles are kept if their number of sides lies in `sides` (both included) and their aspect
    (`polygon_measures`) is below max_aspect. corner_radius: least radius of each grain in units of the
    grain's own equivalent diameter, met to 1e-11. Tiles too slender to hold it are passed over. Deterministic
    in the seed, and the first n shapes are the same whatever the count. Raises ValueError if a parameter is
    out of range or no tile meets the request.
    """
    if count < 0:
        raise ValueError(f"count = {count}: must be >= 0")
    if not 0 < corner_radius < 0.5:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.5, which is a disc")
    if not 3 <= sides[0] <= sides[1]:
        raise ValueError(f"sides = {sides}: must be (fewest, most) with 3 <= fewest <= most")
    if not max_aspect > 1:
        raise ValueError(f"max_aspect = {max_aspect}: must be above 1")
    shapes: list[ArcChain] = []
    barren = batch = 0
    while len(shapes) < count:
        before = len(shapes)
        for tile in voronoi_tiles(TILES_PER_BATCH, 1.0, [seed, batch]):
            measures = polygon_measures(tile)
            if not (sides[0] <= measures.sides <= sides[1] and measures.aspect < max_aspect):
                continue
            shape = _with_corner_radius(tile, corner_radius, f"angular {seed}-{len(shapes)}")
            if shape is not None:
                shapes.append(shape)
            if len(shapes) == count:
                break
        batch += 1
        barren = barren + 1 if len(shapes) == before else 0
        if barren == BARREN_BATCHES:
            raise ValueError(
                f"no tile of {barren * TILES_PER_BATCH} has sides = {sides}, an aspect below "
                f"max_aspect = {max_aspect} and room for corner_radius = {corner_radius}: widen one of them"
            )
    return shapes


def _with_corner_radius(tile: NDArray, corner_radius: float, name: str) -> ArcChain | None:
    """The fit to the tile whose least radius is corner_radius after normalisation; None if there is none.

    The radius c to be asked of the fit solves c = corner_radius d(c), d the equivalent diameter of the fitted
    grain. Rounding removes an area of order c^2, so d hardly depends on c and the iteration contracts by
    about corner_radius^2 a step.
    """
    asked = corner_radius * polygon_measures(tile).diameter
    for _ in range(50):
        try:
            shape = from_polygon(tile, asked, name=name)
        except ValueError:  # the tile is convex, so the radius exceeds its inscribed radius
            return None
        if abs(shape.overlap_limit - corner_radius) <= CORNER_TOLERANCE:
            return shape
        asked *= corner_radius / shape.overlap_limit
    return None


def regular_polygon(sides: int, corner_radius: float = 0.05, arcs_per_corner: int = 1) -> ArcChain:
    """A regular polygon with rounded corners, corner_radius in units of its equivalent diameter, to 1e-10.

    Raises ValueError for fewer than 3 sides or a corner radius out of range.
    """
    if sides < 3:
        raise ValueError(f"sides = {sides}: must be at least 3")
    if not 0 < corner_radius < 0.5:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.5, which is a disc")
    angle = 2.0 * np.pi * np.arange(sides) / sides
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    asked = corner_radius
    for _ in range(60):
        shape = from_polygon(corners, asked, arcs_per_corner=arcs_per_corner, name=f"regular polygon of {sides} sides")
        if abs(shape.overlap_limit - corner_radius) <= CORNER_TOLERANCE:
            break
        asked *= corner_radius / shape.overlap_limit
    return shape


def voronoi_packing(count, length, seed, corner_radius, gap, arcs_per_corner=4):
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
