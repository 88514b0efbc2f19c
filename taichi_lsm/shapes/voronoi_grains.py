"""Angular grains from Voronoi tiles (2D), a Voronoi packing of them, and regular polygons."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .arc_chain import ArcChain
from .base import rescaled
from .geometry import cross_2d, deepest_point
from .input_checks import Seed, check_at_least, check_cells, check_corner_radius
from .polygon_fit import SIDE_HALF_WIDTH, check_side_half_width, from_polygon
from .voronoi_tiles import polygon_measures, voronoi_tiles

TILES_PER_BATCH = 256  # fixed, so that the first n shapes of a seed do not depend on how many are asked for
BARREN_BATCHES = 8  # batches without one acceptable tile after which the request counts as impossible
CORNER_TOLERANCE = 1e-11  # of the equivalent diameter
CORNER_STEPS = 60  # of the iteration for the corner radius, which needs 20 at most


def random_angular_shapes(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    sides: tuple[int, int] = (5, 7),
    max_aspect: float = 1.5,
    made: Callable[[int], None] | None = None,
    *,
    side_half_width: float = SIDE_HALF_WIDTH,
) -> list[ArcChain]:
    """Angular 2D grains: relaxed Voronoi tiles with rounded corners; tiles too slender to hold these are left out.

    Parameters
    ----------
    count : int
        Number of grains, >= 0.
    seed : int
        Decides the tiles, >= 0; the first n shapes of a seed are the same whatever the count.
    corner_radius : float
        Least radius of each grain in its own equivalent diameters, above 0 and below 0.5; met to 1e-11.
    sides : tuple of int
        Fewest and most sides of a tile, both included, fewest >= 3.
    max_aspect : float
        Tiles are kept if their aspect (`polygon_measures`) is below it; > 1.
    made : callable, optional
        Called with the number of shapes there are, after each one: a layer's take tens of seconds.
    side_half_width : float
        As of `from_polygon` [rad]; smaller ones make flatter sides.

    Returns
    -------
    list of ArcChain
        Shapes of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        If a parameter is out of range or no tile meets the request.
    """
    check_cells(count, corner_radius, "sides", sides, 3, max_aspect)
    check_side_half_width(side_half_width)
    shapes: list[ArcChain] = []
    barren = batch = 0
    while len(shapes) < count:
        before = len(shapes)
        for tile in voronoi_tiles(TILES_PER_BATCH, 1.0, [seed, batch]):
            measures = polygon_measures(tile)
            if not (sides[0] <= measures.sides <= sides[1] and measures.aspect < max_aspect):
                continue
            asked = corner_radius * measures.diameter
            name = f"angular {seed}-{len(shapes)}"
            shape = _with_corner_radius(tile, corner_radius, asked, 1, side_half_width, name)
            if shape is not None and abs(shape.overlap_limit - corner_radius) <= CORNER_TOLERANCE:
                shapes.append(shape)
                if made:
                    made(len(shapes))
            if len(shapes) == count:
                break
        batch += 1
        barren = barren + 1 if len(shapes) == before else 0
        if barren == BARREN_BATCHES:
            raise _no_tile(sides, max_aspect, corner_radius)
    return shapes


def _no_tile(sides: tuple[int, int], max_aspect: float, corner_radius: float) -> InputError:
    """The refusal of a request that no tile meets."""
    return InputError(
        f"sides = {sides}, max_aspect = {max_aspect}, corner_radius = {corner_radius}: none of "
        f"{BARREN_BATCHES * TILES_PER_BATCH} tiles has so many sides, an aspect below the greatest and space for such "
        "corners; widen one of them"
    )


def _with_corner_radius(
    polygon: NDArray, corner_radius: float, asked: float, arcs_per_corner: int, side_half_width: float, name: str
) -> ArcChain | None:
    """The fit to a polygon whose least radius is nearest to corner_radius after normalisation; None if none fits.

    The radius c to ask of the fit solves c = corner_radius d(c), d the equivalent diameter of the fitted grain; `asked`
    is the first guess. Rounding removes an area of order c^2, so d hardly depends on c and the iteration contracts by
    about corner_radius^2 a step. It stays off CORNER_TOLERANCE where the sides, whose radii are bounded, are too round
    for such a corner.
    """
    shape = None
    for _ in range(CORNER_STEPS):
        try:
            shape = from_polygon(polygon, asked, side_half_width, arcs_per_corner, name=name)
        except InputError:  # the polygon is convex, so the radius exceeds its inscribed radius
            return None
        if abs(shape.overlap_limit - corner_radius) <= CORNER_TOLERANCE:
            break
        asked *= corner_radius / shape.overlap_limit
    return shape


def regular_polygon(
    sides: int, corner_radius: float = 0.05, arcs_per_corner: int = 1, *, side_half_width: float = SIDE_HALF_WIDTH
) -> ArcChain:
    """A regular polygon with rounded corners.

    Parameters
    ----------
    sides : int
        Number of sides, >= 3.
    corner_radius : float
        Least radius in equivalent diameters of the grain, above 0 and below 0.5; see Notes.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.
    side_half_width : float
        As of `from_polygon` [rad]; smaller ones make flatter sides.

    Returns
    -------
    ArcChain
        Shape of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        For fewer than 3 sides, a corner radius out of range or too large for the polygon, or no arc at a corner.

    Notes
    -----
    The corner radius is met to 1e-11, but for triangles with sharp corners: their sides are arcs that turn by 6 degrees
    with at most 10 equivalent diameters, too round for a corner radius below 0.0771, unless `side_half_width` is
    smaller. `overlap_limit` of the shape is the least radius that came out.
    """
    check_at_least("sides", sides, 3)
    check_corner_radius(corner_radius)
    check_at_least("arcs_per_corner", arcs_per_corner, 1)
    check_side_half_width(side_half_width)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    name = f"regular polygon of {sides} sides"
    shape = _with_corner_radius(corners, corner_radius, corner_radius, arcs_per_corner, side_half_width, name)
    if shape is None:
        raise InputError(f"corner_radius = {corner_radius}: too large for a regular polygon of {sides} sides")
    return shape


def voronoi_packing(
    count: int, length: float, seed: Seed, corner_radius: float, gap: float, arcs_per_corner: int = 4
) -> tuple[list[ArcChain], NDArray, NDArray]:
    """Random grains that fill a periodic square, one for each Voronoi tile.

    Parameters
    ----------
    count : int
        Number of grains, >= 4.
    length : float
        Side of the square, > 0, in any unit of length L.
    seed : int or anything else that numpy.random.default_rng takes
        Decides the tiles.
    corner_radius : float
        Least radius of an arc [L], > 0.
    gap : float
        Distance of a grain from the sides of its tile [L], >= 0.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.

    Returns
    -------
    shapes : list of ArcChain
        Shapes of equivalent diameter 1, body frame.
    position : ndarray, (count, 2)
        Centres of mass [L].
    diameter : ndarray, (count,)
        Equivalent diameters [L], which scale the shapes back to their tiles; they are not rotated.

    Raises
    ------
    InputError
        If a number is out of range or a tile is too small for the corner radius and the gap.
    """
    import shapely

    if not (np.isfinite(gap) and gap >= 0):
        raise InputError(f"gap = {gap}: must be finite and >= 0")
    shapes, places, diameters = [], [], []
    for tile in voronoi_tiles(count, length, seed):
        inner = shapely.Polygon(tile).buffer(-gap, join_style="mitre")
        if inner.is_empty:
            raise InputError(f"gap = {gap}: leaves nothing of a tile; must be smaller than its inscribed radius")
        inset = shapely.get_coordinates(shapely.get_exterior_ring(inner))[:-1]
        shape, place, diameter = fitted_grain(inset, corner_radius, arcs_per_corner)
        shapes.append(shape)
        places.append(place)
        diameters.append(diameter)
    return shapes, np.array(places), np.array(diameters)


def fitted_grain(polygon: NDArray, corner_radius: float, arcs_per_corner: int = 4) -> tuple[ArcChain, NDArray, float]:
    """Grain inside a convex polygon (k, 2) [L]: (shape of equivalent diameter 1, its place (2,) [L], diameter [L])."""
    fitted = from_polygon(polygon, corner_radius, arcs_per_corner=arcs_per_corner, normalise=False)
    diameter = float(np.sqrt(4.0 * fitted.measure / np.pi))
    return rescaled(fitted, 1.0 / diameter), _place(fitted, polygon), diameter


def _place(shape: ArcChain, polygon: NDArray) -> NDArray:
    """Centre of mass (2,) [L] for which the shape is as far as possible from all sides of the polygon."""
    side = np.roll(polygon, -1, axis=0) - polygon
    twice_area = np.sum(cross_2d(polygon, np.roll(polygon, -1, axis=0)))  # negative if it runs clockwise
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1) * np.sign(twice_area)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return deepest_point(normal, np.sum(normal * polygon, axis=1) - shape.support(normal))[0]
