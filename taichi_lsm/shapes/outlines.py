"""Grains from 2D outlines: a closed list of points, whatever its unit, its origin and its small flaws."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .arc_chain import ArcChain
from .base import rescaled
from .input_checks import check_at_least, number_array
from .placement import Imported, Placement
from .polygon_fit import chain_and_centre

if TYPE_CHECKING:
    import shapely

STRAIGHT = 0.003  # of the equivalent diameter: points nearer to the line of their neighbours are left out
LEVEL = 1e-6  # of the extent: less is no change of z
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
    repairs : tuple of str
        What was mended in the outline.
    """

    area: float
    greatest_distance: float
    rms_distance: float
    repairs: tuple[str, ...] = ()


def from_outline(
    points: ArrayLike,
    corner_radius: float = 0.03,
    arcs_per_corner: int = 1,
    *,
    hull: bool = False,
    resolution: float = 0.0,
) -> Imported[ArcChain, OutlineMisfit]:
    """A grain from a closed convex outline, its misfit, and where the outline lies.

    Parameters
    ----------
    points : array_like, (k, 2) or (k, 3)
        Points of the outline in order, either sense, k >= 3, in any unit of length and any place; the last is joined
        to the first. A third column must be constant.
    corner_radius : float
        Least radius of an arc in equivalent diameters of the outline, > 0.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.
    hull : bool
        Whether to take the convex hull of an outline that is not convex; the misfit is then against the outline itself.
    resolution : float
        Length by which points may be off, such as a pixel [unit of the points], >= 0: concavities no deeper than that
        are none. Outlines of `outline_of_image` need none.

    Returns
    -------
    shape : ArcChain
        Grain of equivalent diameter 1, body frame.
    misfit : OutlineMisfit
        How far its outline is from the given one, and what was mended there.
    placement : Placement
        Centre, angle (0) and equivalent diameter of the outline, in the frame and unit of the points.

    Raises
    ------
    InputError
        If the points are no simple outline, or not convex and `hull` was not asked for, or a parameter is out of range.

    Notes
    -----
    Points nearer than 0.003 equivalent diameters to the line of their neighbours are left out before the fit. Doubled
    points are left out, swapped neighbours put in order, and spikes, overshoots and loops of up to 2 % of the area cut
    off; `misfit.repairs` says so.
    """
    import shapely

    from .outline_repair import simple_outline, without_steps

    xy, origin, extent = scaled_points(points)
    check_at_least("resolution", resolution, 0.0)
    body, repairs = simple_outline(xy)
    if resolution > 0.0:
        body = without_steps(body, resolution / extent)
    size = float(np.sqrt(4.0 * body.area / np.pi))
    excess = body.convex_hull.area / body.area - 1.0
    if excess > CONCAVE and not hull:
        remedy = "hull=True takes the hull, and resolution= tells how far points may be off"
        raise InputError(f"points: not convex, the hull is {100 * excess:.3g} % larger; {remedy}")
    convex = body.convex_hull.simplify(STRAIGHT * size).convex_hull
    corners = shapely.get_coordinates(shapely.get_exterior_ring(convex))[:-1]
    fitted, centre = chain_and_centre(corners, corner_radius * size, arcs_per_corner, "outline")
    misfit = _misfit(fitted, centre, body, size, repairs)
    shape = rescaled(fitted, 0.5 / fitted.equivalent_radius)
    return Imported(shape, misfit, Placement(origin + extent * centre, 0.0, extent * size))


def _misfit(
    fitted: ArcChain, centre: NDArray, body: shapely.Polygon, size: float, repairs: tuple[str, ...]
) -> OutlineMisfit:
    """Differences of a grain at `centre` from the outline of a body of equivalent diameter `size`."""
    import shapely

    mine = shapely.Polygon(fitted.outline(2000) + centre)
    ring = shapely.get_exterior_ring(mine)
    along = shapely.points(shapely.get_coordinates(shapely.segmentize(ring, 0.005 * size)))
    distance = shapely.distance(along, body.exterior) / size
    return OutlineMisfit(
        area=float(mine.area / body.area - 1.0),
        greatest_distance=float(shapely.hausdorff_distance(ring, body.exterior) / size),
        rms_distance=float(np.sqrt((distance**2).mean())),
        repairs=repairs,
    )


def scaled_points(points: ArrayLike) -> tuple[NDArray, NDArray, float]:
    """Points (k, 2) about the middle of their box, of extent 1; that middle (2,) and extent [unit of the points]."""
    xy = number_array("points", points)
    if xy.ndim != 2 or xy.shape[1] not in (2, 3) or len(xy) < 3 or not np.all(np.isfinite(xy)):
        raise InputError(f"points has shape {xy.shape}: must be (k, 2), k >= 3, all finite")
    if xy.shape[1] == 3 and np.ptp(xy[:, 2]) > LEVEL * np.ptp(xy[:, :2], axis=0).max():
        raise InputError(
            f"points: z from {xy[:, 2].min():g} to {xy[:, 2].max():g}, must be constant; "
            "turn the outline into its plane, or give x and y"
        )
    xy = xy[:, :2]
    low, high = xy.min(axis=0), xy.max(axis=0)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        middle, extent = 0.5 * low + 0.5 * high, float((high - low).max())
        scaled = (xy - middle) / extent
    if not (0.0 < extent < np.inf and np.all(np.isfinite(scaled))):
        raise InputError(f"points: extent {extent:g}, must be above 0 and finite")
    return scaled, middle, extent
