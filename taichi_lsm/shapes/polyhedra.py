"""Rounded polyhedra (3D) from planes, superellipsoids and the Platonic solids."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .ball_polyhedron import BallPolyhedron
from .corner_radius import radius_for_corner
from .dilated_balls import ball_polyhedron_and_frame, corner_of_balls, tangent_ball_polyhedron
from .geometry import deepest_point, even_directions, polygon_integrals
from .input_checks import check_at_least, check_between, check_flatness, check_positive, number_array

FLATNESS = 5.0  # default radius of faces that should be flat, in sizes of the body
ON_PLANE = 1e-7  # of the size: the library that finds the corners merges planes that nearly meet in one
LEAST_FACE = 1e-3  # of a tile's squared size: smaller faces are left to the rounding
LEAST_SECTION = 1e-2  # of the mean cross-section parallel to the face: likewise
STRETCHED = 0.75  # power of the axes: 0 gives even normals, 1 points as even as on a sphere that is stretched
LARGEST_MISFIT = 0.1  # of the extents of an ellipsoid
LARGEST_BULGE = 0.125  # of the width of the body: by how much a face may stand out


def from_planes(
    normals: ArrayLike,
    distances: ArrayLike,
    corner_radius: float,
    *,
    flatness: float | None = None,
    name: str = "rounded polyhedron",
    normalise: bool = True,
) -> BallPolyhedron:
    """The convex polyhedron normals[i] . x <= distances[i] with slightly bulging faces and rounded edges.

    Parameters
    ----------
    normals : array_like, (n, 3)
        Outward unit normals of the planes, n >= 4.
    distances : array_like, (n,)
        Distances of the planes from the origin, in any unit of length L.
    corner_radius : float
        Radius of edges and vertices [L], above 0 and below the radius of the largest ball within the planes.
    flatness : float, optional
        Radius of the balls of the faces in sizes of the body, > 0; by default 5, and for long or flat bodies as much
        as keeps every face from standing out by more than an eighth of the width of the body there. Then extents are
        those of the planes, but the volume of a cube is 9 % less and that of a rod of 26 to 1 16 %, the moments of
        inertia up to 17 % and 28 %; with 2000 all are within 1 %.
    name : str
        What pictures and files call the shape.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit L is kept.

    Returns
    -------
    BallPolyhedron
        The grain, in its body frame.

    Raises
    ------
    InputError
        If the planes enclose nothing that holds a ball of the corner radius.

    Notes
    -----
    Each ball touches its plane at the centre of the face, inset by the corner radius; planes without a face, and with
    one that is tiny, are left out. A ball of radius R falls back by rho^2/(2 R) at a corner at the distance rho from
    there.
    """
    shape, _, _ = from_planes_and_frame(normals, distances, corner_radius, flatness, name)
    return shape.normalised() if normalise else shape


def from_planes_and_frame(
    normals: ArrayLike, distances: ArrayLike, corner_radius: float, flatness: float | None = None, name: str = "tile"
) -> tuple[BallPolyhedron, NDArray, NDArray]:
    """As `from_planes` in the unit of the planes: (shape, its centre of mass (3,), its frame (3, 3)).

    The frame is the rotation matrix from the body frame to the frame of the planes.
    """
    n, h = number_array("normals", normals), number_array("distances", distances)
    if n.ndim != 2 or n.shape[1] != 3 or h.shape != n.shape[:1] or len(n) < 4:
        raise InputError(f"normals and distances have shapes {n.shape}, {h.shape}: must be (n, 3), (n,), n >= 4")
    check_flatness(flatness)
    middle, inscribed = deepest_point(n, h)
    if not 0 < corner_radius < inscribed:
        raise InputError(
            f"corner_radius = {corner_radius}: must be above 0 and below the inscribed radius, {inscribed:.6g}"
        )
    centres, radii = _balls_of_planes(n, h, middle, corner_radius, flatness)
    return ball_polyhedron_and_frame(centres, radii, corner_radius, name)


def _balls_of_planes(
    n: NDArray, h: NDArray, inside: NDArray, corner_radius: float, flatness: float | None = None
) -> tuple[NDArray, NDArray]:
    """Centres (m, 3) and radii (m,) of the balls of the faces, given a point inside: see `from_planes`."""
    vertices = corners_of(n, h - corner_radius, inside)
    points, kept, reach = _face_centres(vertices, n, h - corner_radius)
    size = 2.0 * np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    if flatness is None:
        width = h[kept] + corner_radius - (n[kept] @ vertices.T).min(axis=1)
        radius = max(FLATNESS * size, (reach**2 / (2.0 * LARGEST_BULGE * width)).max())
    else:
        radius = flatness * size
    return points - radius * n[kept], np.full(len(kept), radius)


def corners_of(n: NDArray, h: NDArray, inside: NDArray) -> NDArray:
    """Vertices (m, 3) of the polyhedron n . x <= h, given a point inside; InputError if it is not bounded."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):  # vertices at infinity
            vertices = scipy.spatial.HalfspaceIntersection(np.column_stack([n, -h]), inside).intersections
    except scipy.spatial.QhullError as error:
        raise InputError(f"normals, distances: the planes enclose no body ({error})") from None
    if not np.all(np.isfinite(vertices)):
        raise InputError("normals, distances: the planes enclose no bounded body; add planes on its open side")
    return vertices


def _face_centres(vertices: NDArray, n: NDArray, h: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Centroid (m, 3) of each face that is not tiny, which planes those are (m,), and how far their corners are (m,).

    A face is tiny by LEAST_FACE and, so that rods keep their ends, by LEAST_SECTION too.
    """
    size = np.ptp(vertices, axis=0).max()
    planes = np.linalg.svd(n[:, None])[2][:, 1:]  # two axes (2, 3) of each
    centres, kept, reach = [], [], []
    for i, across in enumerate(planes):
        own = vertices[np.abs(vertices @ n[i] - h[i]) < ON_PLANE * size]
        if len(own) < 3:
            continue
        # The corners of the face in its own plane, in order round their mean, for the centroid of the polygon.
        flat = (own - own.mean(axis=0)) @ across.T
        hull = flat[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))]
        twice_area, six_first, _ = polygon_integrals(hull)
        if 0.5 * twice_area < LEAST_FACE * size**2:
            section = scipy.spatial.ConvexHull(vertices).volume / (h[i] - (vertices @ n[i]).min())
            if 0.5 * twice_area < LEAST_SECTION * section:
                continue
        middle = six_first / (3.0 * twice_area)
        centres.append(own.mean(axis=0) + middle @ across)
        kept.append(i)
        reach.append(np.linalg.norm(flat - middle, axis=1).max())
    if not kept:
        raise InputError("normals, distances: the planes enclose no body with a face that is not tiny")
    return np.array(centres), np.array(kept), np.array(reach)


def superellipsoid(
    axes: ArrayLike, exponent: float = 2.0, faces: int = 60, corner_radius: float = 0.05, *, name: str | None = None
) -> BallPolyhedron:
    """A superellipsoid |x/a|^p + |y/b|^p + |z/c|^p <= 1 fitted with tangent balls.

    Parameters
    ----------
    axes : array_like, (3,)
        Semi-axes a, b, c > 0 in any unit of length; only their ratios count.
    exponent : float
        p, 1.2 to 20; 2 is the ellipsoid.
    faces : int
        Number of tangent balls, >= 6.
    corner_radius : float
        Radius > 0 of edges and vertices, over the diameter 2 (a b c)^(1/3) of the ball of equal product of axes.
    name : str, optional
        What pictures and files call the shape; by default the family and the number of faces.

    Returns
    -------
    BallPolyhedron
        Grain of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        If a value is out of range or the balls give no closed surface.
    """
    a = number_array("axes", axes)
    if a.shape != (3,) or not np.all(np.isfinite(a) & (a > 0)):
        raise InputError(f"axes = {axes}: must be three lengths > 0")
    check_between("exponent", exponent, 1.2, 20.0)
    check_at_least("faces", faces, 6)
    check_positive("corner_radius", corner_radius)
    # Points of the surface with normals n: the gradient of h(n) = (sum of |a_i n_i|^q)^(1/q), 1/p + 1/q = 1.
    n = even_directions(faces) / a**STRETCHED
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    q = exponent / (exponent - 1.0)
    y = np.abs(n) * a
    h = (y**q).sum(axis=1) ** (1.0 / q)
    points = np.sign(n) * a * y ** (q - 1.0) * h[:, None] ** (1.0 - q)
    size = 2.0 * a.prod() ** (1.0 / 3.0)
    family = "ellipsoid" if exponent == 2.0 else "superellipsoid"
    try:
        shape = tangent_ball_polyhedron(points, n, corner_radius * size, name=name or f"{family} of {faces} faces")
    except InputError as error:
        raise InputError(f"axes = {a.tolist()}: {faces} balls give no closed body, as {error}; raise faces") from error
    _require_extents(shape, a, faces, corner_radius)
    return shape


def _require_extents(shape: BallPolyhedron, axes: NDArray, faces: int, corner_radius: float) -> None:
    """Refuse a body whose extents, but for its size, are not those of the axes (3,): it would be another one."""
    got = np.sort(shape.support(np.eye(3)) + shape.support(-np.eye(3)))
    wanted = np.sort(axes) / np.cbrt(axes.prod()) * np.cbrt(got.prod())
    off = np.abs(got / wanted - 1.0).max()
    if off > LARGEST_MISFIT:
        raise InputError(
            f"axes = {axes.tolist()} of {faces} faces with a corner radius of {corner_radius:g}: extents are "
            f"{100 * off:.0f} % off, must be within {100 * LARGEST_MISFIT:.0f} %; raise faces or lower corner_radius"
        )


def ellipsoid(axes: ArrayLike, faces: int = 60, corner_radius: float = 0.05) -> BallPolyhedron:
    """An ellipsoid fitted with tangent balls.

    Of 60 faces the extents are within 2 % up to axes of 10 to 1, and of 150 faces within 1.2 %; a rim that is sharper
    than the corner radius is cut: flat bodies need a smaller one.

    Parameters
    ----------
    axes : array_like, (3,)
        Semi-axes > 0 in any unit of length; only their ratios count.
    faces : int
        Number of tangent balls, >= 6.
    corner_radius : float
        Radius > 0 of edges and vertices, in equivalent diameters of the ellipsoid.

    Returns
    -------
    BallPolyhedron
        Grain of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        If a value is out of range, the balls give no closed surface, or its extents are more than 10 % off.
    """
    return superellipsoid(axes, 2.0, faces, corner_radius)


def regular_polyhedron(faces: int, corner_radius: float = 0.05, *, flatness: float | None = None) -> BallPolyhedron:
    """A Platonic solid with rounded edges and vertices.

    Parameters
    ----------
    faces : int
        4, 6, 8, 12 or 20.
    corner_radius : float
        Dilation in equivalent diameters of the grain, above 0 and below 0.5; met to 1e-10.
    flatness : float, optional
        Radius of the balls of the faces, as of `from_planes`.

    Returns
    -------
    BallPolyhedron
        Grain of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        For another number of faces, or a corner radius out of range or too large for the solid.
    """
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    signs = np.array(np.meshgrid([1, -1], [1, -1], [1, -1])).reshape(3, -1).T.astype(float)
    cyclic = [np.roll([0.0, s, t * golden], k) for k in range(3) for s in (1, -1) for t in (1, -1)]
    dodeca = [np.roll([0.0, s / golden, t * golden], k) for k in range(3) for s in (1, -1) for t in (1, -1)]
    normals = {
        4: signs[signs.prod(axis=1) > 0],
        6: np.concatenate([np.eye(3), -np.eye(3)]),
        8: signs,
        12: np.array(cyclic),
        20: np.concatenate([signs, dodeca]),
    }
    if faces not in normals:
        raise InputError(f"faces = {faces}: must be one of {sorted(normals)}")
    n = normals[faces] / np.linalg.norm(normals[faces], axis=1, keepdims=True)
    name = f"regular polyhedron of {faces} faces"
    return rounded_polyhedron(n, np.ones(len(n)), corner_radius, name, flatness)


def rounded_polyhedron(
    n: NDArray, h: NDArray, corner_radius: float, name: str, flatness: float | None = None
) -> BallPolyhedron:
    """`from_planes` whose dilation is corner_radius in units of its own equivalent diameter, to CORNER_TOLERANCE."""
    check_flatness(flatness)
    middle, inscribed = deepest_point(n, h)

    def balls(asked: float) -> tuple[NDArray, NDArray]:
        return _balls_of_planes(n, h, middle, asked, flatness)

    asked = radius_for_corner(lambda asked: corner_of_balls(*balls(asked), asked), corner_radius, inscribed)
    return ball_polyhedron_and_frame(*balls(asked), asked, name)[0].normalised()
