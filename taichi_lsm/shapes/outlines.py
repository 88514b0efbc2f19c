"""Grains from 2D outlines: a closed list of points, or the contour of an image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arc_chain import ArcChain
from .polygon_fit import from_polygon

STRAIGHT = 0.003  # of the equivalent diameter: points nearer to the line of their neighbours are left out
CONCAVE = 0.02  # part by which the hull may exceed an outline that counts as convex


class OutlineMisfit(NamedTuple):
    """How far a grain is from its outline, over the equivalent diameter; area before the rescaling."""

    area: float
    greatest_distance: float
    rms_distance: float


def from_outline(
    points: ArrayLike, corner_radius: float = 0.03, arcs_per_corner: int = 1, *, hull: bool = False
) -> tuple[ArcChain, OutlineMisfit]:
    """A grain of equivalent diameter 1 from a closed convex outline (k, 2), and its misfit.

    corner_radius: least radius, in equivalent diameters of the outline. hull: take the convex hull of an outline that
    is not convex; the misfit is then against the outline itself.
    Raises ValueError if the points are no simple outline, or not convex and `hull` was not asked for.
    """
    import shapely
    from shapely.affinity import translate

    xy = np.array(points, dtype=np.float64)
    if xy.ndim != 2 or xy.shape[1] != 2 or len(xy) < 3 or not np.all(np.isfinite(xy)):
        raise ValueError(f"points has shape {xy.shape}: must be (k, 2), k >= 3, all finite")
    body = shapely.Polygon(xy)
    if not body.is_valid or body.area <= 0:
        raise ValueError(f"points: no simple outline ({shapely.is_valid_reason(body)})")
    size = float(np.sqrt(4.0 * body.area / np.pi))
    excess = body.convex_hull.area / body.area - 1.0
    if excess > CONCAVE and not hull:
        raise ValueError(f"points: not convex, the hull is {100 * excess:.3g} % larger; hull=True takes the hull")
    convex = body.convex_hull.simplify(STRAIGHT * size).convex_hull
    corners = np.array(convex.exterior.coords)[:-1]
    fitted = from_polygon(corners, corner_radius * size, arcs_per_corner=arcs_per_corner, normalise=False)
    mine = shapely.Polygon(fitted.outline(2000))
    mine = translate(mine, *(np.array(body.centroid.coords[0]) - np.array(mine.centroid.coords[0])))
    along = shapely.points(np.array(shapely.segmentize(mine.exterior, 0.005 * size).coords))
    distance = shapely.distance(along, body.exterior) / size
    misfit = OutlineMisfit(
        area=float(mine.area / body.area - 1.0),
        greatest_distance=float(shapely.hausdorff_distance(mine.exterior, body.exterior) / size),
        rms_distance=float(np.sqrt((distance**2).mean())),
    )
    shape = from_polygon(corners, corner_radius * size, arcs_per_corner=arcs_per_corner, name="outline")
    return shape, misfit


def outline_of_image(image: ArrayLike, level: float) -> NDArray:
    """The largest closed contour (k, 2) of a 2D array at `level`, in pixels. Raises ValueError if there is none."""
    import shapely
    from contourpy import contour_generator

    values = np.array(image, dtype=np.float64)
    if values.ndim != 2 or min(values.shape) < 3 or not np.all(np.isfinite(values)):
        raise ValueError(f"image has shape {values.shape}: must be 2D, at least 3 x 3, all finite")
    lines = contour_generator(z=values).lines(level)
    closed = [line for line in lines if len(line) > 3 and np.array_equal(line[0], line[-1])]
    if not closed:
        raise ValueError(f"level = {level}: no closed contour; values range from {values.min()} to {values.max()}")
    return max(closed, key=lambda line: shapely.Polygon(line).area)[:-1]
