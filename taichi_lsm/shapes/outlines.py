"""Grains from 2D outlines: a closed list of points, or the contour of an image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .arc_chain import ArcChain
from .input_checks import number_array
from .polygon_fit import from_polygon

STRAIGHT = 0.003  # of the equivalent diameter: points nearer to the line of their neighbours are left out
CONCAVE = 0.02  # share of its area by which the hull may exceed an outline that counts as convex


class OutlineMisfit(NamedTuple):
    """How far a grain is from the outline that it was made from.

    Attributes
    ----------
    area : float
        Relative error of the area, before the grain is rescaled.
    greatest_distance : float
        Hausdorff distance of the two outlines, over the equivalent diameter.
    rms_distance : float
        Root mean square distance of the grain's outline from the given one, over the equivalent diameter.
    """

    area: float
    greatest_distance: float
    rms_distance: float


def from_outline(
    points: ArrayLike, corner_radius: float = 0.03, arcs_per_corner: int = 1, *, hull: bool = False
) -> tuple[ArcChain, OutlineMisfit]:
    """A grain from a closed convex outline, and its misfit.

    Parameters
    ----------
    points : array_like, (k, 2)
        Points of the outline in order, k >= 3, in any unit of length; the last is joined to the first.
    corner_radius : float
        Least radius of an arc in equivalent diameters of the outline, > 0.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.
    hull : bool
        Whether to take the convex hull of an outline that is not convex; the misfit is then against the outline itself.

    Returns
    -------
    shape : ArcChain
        Grain of equivalent diameter 1, body frame.
    misfit : OutlineMisfit
        How far its outline is from the given one, centres of mass on each other.

    Raises
    ------
    InputError
        If the points are no simple outline, or not convex and `hull` was not asked for, or a parameter is out of range.

    Notes
    -----
    Points nearer than 0.003 equivalent diameters to the line of their neighbours are left out before the fit.
    """
    import shapely
    from shapely.affinity import translate

    xy = number_array("points", points)
    if xy.ndim != 2 or xy.shape[1] != 2 or len(xy) < 3 or not np.all(np.isfinite(xy)):
        raise InputError(f"points has shape {xy.shape}: must be (k, 2), k >= 3, all finite")
    body = shapely.Polygon(xy)
    if not body.is_valid or body.area <= 0:
        raise InputError(f"points: no simple outline ({shapely.is_valid_reason(body)})")
    size = float(np.sqrt(4.0 * body.area / np.pi))
    excess = body.convex_hull.area / body.area - 1.0
    if excess > CONCAVE and not hull:
        raise InputError(f"points: not convex, the hull is {100 * excess:.3g} % larger; hull=True takes the hull")
    convex = body.convex_hull.simplify(STRAIGHT * size).convex_hull
    corners = shapely.get_coordinates(shapely.get_exterior_ring(convex))[:-1]
    fitted = from_polygon(corners, corner_radius * size, arcs_per_corner=arcs_per_corner, normalise=False)
    mine = shapely.Polygon(fitted.outline(2000))
    mine = translate(mine, *(np.array(body.centroid.coords[0]) - np.array(mine.centroid.coords[0])))
    ring = shapely.get_exterior_ring(mine)
    along = shapely.points(shapely.get_coordinates(shapely.segmentize(ring, 0.005 * size)))
    distance = shapely.distance(along, body.exterior) / size
    misfit = OutlineMisfit(
        area=float(mine.area / body.area - 1.0),
        greatest_distance=float(shapely.hausdorff_distance(ring, body.exterior) / size),
        rms_distance=float(np.sqrt((distance**2).mean())),
    )
    shape = from_polygon(corners, corner_radius * size, arcs_per_corner=arcs_per_corner, name="outline")
    return shape, misfit


def outline_of_image(image: ArrayLike, level: float) -> NDArray:
    """The largest closed contour of an image.

    Parameters
    ----------
    image : array_like, (rows, columns)
        Values of the pixels, at least 3 x 3.
    level : float
        Value that the contour follows.

    Returns
    -------
    ndarray, (k, 2)
        Points x (column), y (row) [pixel] of the contour that encloses the largest area, the first not repeated.

    Raises
    ------
    InputError
        If the image is no such array or no contour at this level is closed.
    """
    import shapely
    from contourpy import contour_generator

    values = number_array("image", image)
    if values.ndim != 2 or min(values.shape) < 3 or not np.all(np.isfinite(values)):
        raise InputError(f"image has shape {values.shape}: must be 2D, at least 3 x 3, all finite")
    lines = [np.asarray(line) for line in contour_generator(z=values).lines(level)]
    closed = [line for line in lines if len(line) > 3 and np.array_equal(line[0], line[-1])]
    if not closed:
        raise InputError(f"level = {level}: no closed contour; values range from {values.min()} to {values.max()}")
    return max(closed, key=lambda line: shapely.Polygon(line).area)[:-1]
