"""Outlines of 2D grains as polygons whose vertices lie on the surface."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from .geometry import polygon_integrals, unit_normals
from .patch_surfaces import Body, PatchSurface, bodies_of

SAG = 1e-3  # of area over perimeter: greatest height of an arc over its chord
ROUGH = 0.3  # rad, chords of the polygon that tells area and perimeter


def outline_of(surface: PatchSurface) -> NDArray:
    """The outline of a 2D grain as a polygon.

    Parameters
    ----------
    surface : PatchSurface
        Its patches, see `patch_surface`.

    Returns
    -------
    ndarray, (k, 2)
        Vertices, counter-clockwise, the first not repeated; frame and unit of the patches. Of a grain with holes or in
        separate pieces the rings hang together by bridges of no width.

    Notes
    -----
    A polygon whose sides have the sag s lacks at most 2/3 s P of the area A within its perimeter P. With s = SAG A/P
    that is 0.07 % of it.
    """
    rings = [_ring(body, patches) for body, patches in bodies_of(surface)]
    return rings[0] if len(rings) == 1 else _united(rings)


def points_of_arcs(patches: PatchSurface, is_open: bool = False) -> tuple[NDArray, NDArray]:
    """Points (k, 2) along the arcs of one body, one after the other, and the outward normals (k, 2) there.

    Chords between them have the sag of `outline_of`. In a chain the next arc begins where one ends; the ends of open
    arcs are points.
    """
    rough, _ = _along(patches, np.full(len(patches.radius), ROUGH), is_open)
    perimeter = np.linalg.norm(np.roll(rough, -1, axis=0) - rough, axis=1).sum()
    sag = SAG * 0.5 * abs(polygon_integrals(rough)[0]) / perimeter
    return _along(patches, 2.0 * np.arccos(1.0 - np.minimum(sag / patches.radius, 0.1)), is_open)


def _ring(body: Body, patches: PatchSurface) -> NDArray:
    """Vertices (k, 2) on the outline of one body."""
    points, _ = points_of_arcs(patches, body is Body.OPEN)
    return points[scipy.spatial.ConvexHull(points).vertices] if body is Body.OPEN else points


def _along(patches: PatchSurface, step: NDArray, is_open: bool) -> tuple[NDArray, NDArray]:
    """See `points_of_arcs`; each arc is cut into equal chords over angles of at most `step` (patches,) [rad]."""
    count = np.ceil(2.0 * patches.half_angle / step).astype(int)
    arc = np.repeat(np.arange(len(count)), count + is_open)
    place = np.arange(len(arc)) - np.repeat(np.cumsum(count + is_open) - count - is_open, count + is_open)
    first = np.arctan2(patches.axis[:, 1], patches.axis[:, 0]) - patches.half_angle
    normals = unit_normals(first[arc] + 2.0 * patches.half_angle[arc] * place / count[arc])
    return patches.centre[arc] + patches.radius[arc, None] * normals, normals


def _united(rings: list[NDArray]) -> NDArray:
    """Outline (k, 2) of the union of polygons."""
    import shapely
    from shapely.geometry.polygon import orient

    union = shapely.union_all([shapely.Polygon(ring) for ring in rings])
    pieces = [orient(piece) for piece in shapely.get_parts(union)]  # outer rings counter-clockwise, holes clockwise
    found = [shapely.get_coordinates(ring)[:-1] for piece in pieces for ring in (piece.exterior, *piece.interiors)]
    outline, start = found[0], found[0][:1]
    for ring in found[1:]:  # there, round, and back
        outline = np.concatenate([outline, start, ring, ring[:1]])
    return outline
