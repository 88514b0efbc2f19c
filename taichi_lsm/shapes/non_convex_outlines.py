"""Non-convex grains from 2D outlines: convex parts that overlap inside only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from .apparent_stiffness import apparent_stiffness
from .arc_chain import ArcChain
from .geometry import polygon_integrals
from .grown_parts import grown_pieces
from .input_checks import check_between, check_corner_radius
from .outlines import STRAIGHT, scaled_points
from .polygon_fit import MOST_ARCS, arc_chain, chain_and_centre
from .polygon_parts import convex_pieces
from .union import Union, place_part, union

SIDE_HALF_WIDTH = 0.005  # rad: sides that bulge more would stand away from the ends of other parts
DISTANCES_EVERY = 0.005  # equivalent diameters along the outline
AREA_STEPS = 2
FIT_POINTS = 2000  # of the outline of a part


class PartsMisfit(NamedTuple):
    """How far a grain of convex parts is from what it was made of; lengths over the equivalent diameter.

    Attributes
    ----------
    measure : float
        Relative error of the area (2D) or volume (3D), before the grain is rescaled.
    inertia : float
        Greatest relative error of a principal moment of inertia at equal area or volume.
    greatest_distance, rms_distance : float
        Of the given outline or surface from that of the grain.
    parts : int
        Number of convex parts.
    least_radius : float
        Least radius of curvature of the grain.
    least_stiffness, greatest_stiffness : float
        Apparent stiffness along the outer surface, 1 where one part resists, see `apparent_stiffness`; junctions left
        out.
    doubled_share : float
        Share of the outer surface, junctions left out, where the apparent stiffness is above 1.1.
    junction_share : float
        Share of the outer surface from which a small ball touches two parts with different normals.
    repairs : tuple of str
        What was mended in the outline or the mesh.
    """

    measure: float
    inertia: float
    greatest_distance: float
    rms_distance: float
    parts: int
    least_radius: float
    least_stiffness: float
    greatest_stiffness: float
    doubled_share: float
    junction_share: float
    repairs: tuple[str, ...] = ()


def non_convex_outline(
    points: ArrayLike, corner_radius: float = 0.03, arcs_per_corner: int = 1, *, tolerance: float = 0.01
) -> tuple[Union | ArcChain, PartsMisfit]:
    """A grain from a closed outline that need not be convex, as a union of convex parts, and its misfit.

    Parameters
    ----------
    points : array_like, (k, 2)
        Points of the outline in order, either sense, k >= 3, in any unit of length and any place; the last is joined
        to the first.
    corner_radius : float
        Least radius of an arc in equivalent diameters of the outline, > 0 and at most the inscribed radius of every
        part.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.
    tolerance : float
        By how much chords across hollow stretches may stand out of the outline [equivalent diameters], 0.001 to 0.1:
        what a hollow arc costs in parts.

    Returns
    -------
    shape : Union or ArcChain
        Grain of equivalent diameter 1, body frame; an arc chain if one part is enough.
    misfit : PartsMisfit
        How far its outline is from the given one, and how stiff it seems along it.

    Raises
    ------
    InputError
        If the points are no simple outline, a parameter is out of range or a part is too thin for the corner radius.

    Notes
    -----
    The outline is cut into convex pieces. They grow into each other by more than rounding takes, so that their sides
    reach re-entrant corners. Where a cut ends at a smooth place, the outer surface passes from one part to the other by
    a step of 0.006 diameters, for two convex parts along the same curve would resist together. At last all radii change
    by the same length, so that the area is right.
    """
    check_corner_radius(corner_radius)
    check_between("tolerance", tolerance, 1e-3, 0.1)
    check_between("arcs_per_corner", arcs_per_corner, 1, MOST_ARCS)
    given, repairs = _centred(points)
    plain = shapely.remove_repeated_points(given.simplify(STRAIGHT), 1e-6)
    rings, filled = convex_pieces(plain, tolerance)
    if len(rings) > 1:
        rings = grown_pieces(rings, filled, corner_radius)
    members = _of_right_area([_rounded(ring, corner_radius, arcs_per_corner) for ring in rings], given)
    return _grain(members), _misfit(members, given)._replace(repairs=repairs)


def _rounded(ring: NDArray, corner_radius: float, arcs_per_corner: int) -> ArcChain:
    """The arc chain within a convex polygon, where the polygon lies."""
    chain, centre = chain_and_centre(ring, corner_radius, arcs_per_corner, "part", SIDE_HALF_WIDTH)
    return place_part(chain, centre)


def _of_right_area(members: list[ArcChain], given: shapely.Polygon) -> list[ArcChain]:
    """The parts with all radii changed by one length, which moves their surfaces out, so that the area is right."""
    for _ in range(AREA_STEPS):
        body = _covered(members)
        offset = max((given.area - body.area) / body.length, -0.5 * min(float(m.radius.min()) for m in members))
        members = [_moved_out(m, offset) for m in members]
    return members


def _moved_out(part: ArcChain, offset: float) -> ArcChain:
    """The part with all radii larger by `offset`. Its mass, which is not used, is that of before."""
    return replace(
        part,
        radius=part.radius + offset,
        bounding_radius=part.bounding_radius + offset,
        overlap_limit=part.overlap_limit + offset,
    )


def _covered(members: Sequence[ArcChain]) -> BaseGeometry:
    """What the parts cover."""
    return shapely.union_all([shapely.Polygon(m.outline(FIT_POINTS)) for m in members])


def _grain(members: Sequence[ArcChain]) -> Union | ArcChain:
    """The grain of these parts, of equivalent diameter 1."""
    if len(members) > 1:
        grain = union(members, name="outline")
        assert isinstance(grain, Union)
        return grain
    part = members[0]
    breaks = np.unwrap(np.arctan2(part.seam[:, 1], part.seam[:, 0]))
    return arc_chain(breaks, part.radius, name="outline")


def _misfit(members: Sequence[ArcChain], given: shapely.Polygon) -> PartsMisfit:
    """How far the parts are from an outline of equivalent diameter 1 about its centre."""
    body = _covered(members)
    along = shapely.points(shapely.get_coordinates(shapely.segmentize(given.exterior, DISTANCES_EVERY)))
    distance = shapely.distance(along, shapely.boundary(body))
    found = apparent_stiffness(members)
    return PartsMisfit(
        measure=float(body.area / given.area - 1.0),
        inertia=float(_polar(body) / _polar(given) * (given.area / body.area) ** 2 - 1.0),
        greatest_distance=float(distance.max()),
        rms_distance=float(np.sqrt((distance**2).mean())),
        parts=len(members),
        least_radius=min(float(m.radius.min()) for m in members),
        least_stiffness=found.least,
        greatest_stiffness=found.greatest,
        doubled_share=found.doubled_share,
        junction_share=found.junction_share,
    )


def _polar(body: BaseGeometry) -> float:
    """Polar second moment of a region about its centre."""
    total = 0.0
    centre = np.array(body.centroid.coords[0])
    for ring in shapely.get_parts(shapely.get_rings(shapely.get_parts(shapely.orient_polygons(body)))):
        total += float(np.trace(polygon_integrals(shapely.get_coordinates(ring)[:-1] - centre)[2])) / 24.0
    return total


def _centred(points: ArrayLike) -> tuple[shapely.Polygon, tuple[str, ...]]:
    """The outline about its centre of area, in units of its equivalent diameter, and what was mended in it."""
    from .outline_repair import simple_outline

    body, repairs = simple_outline(scaled_points(points)[0])
    size = float(np.sqrt(4.0 * body.area / np.pi))
    ring = shapely.get_coordinates(body.exterior) - np.array(body.centroid.coords[0])
    return shapely.Polygon(ring / size), repairs
