"""Families of rounded polyhedra (3D)."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from .ball_cells import spread
from .ball_polyhedron import SLACK, BallPolyhedron, placed_ball_polyhedron, tangent_ball_polyhedron
from .corner_radius import meeting_corner

FLATNESS = 5.0  # default radius of faces that should be flat, in sizes of the body
TILES_PER_BATCH = 64  # fixed, so that the first n shapes of a seed do not depend on how many are asked for
BARREN_BATCHES = 8  # batches without one acceptable tile after which the request counts as impossible
TRIES = 20  # draws of one random grain
ON_PLANE = 1e-7  # of the size: the library that finds the corners merges planes that nearly meet in one
LEAST_FACE = 1e-3  # of a tile's squared size: smaller faces are left to the rounding


def from_planes(
    normals: ArrayLike,
    distances: ArrayLike,
    corner_radius: float,
    *,
    flatness: float = FLATNESS,
    name: str = "rounded polyhedron",
    normalise: bool = True,
) -> BallPolyhedron:
    """The convex polyhedron normals[i] . x <= distances[i] with slightly bulging faces and rounded edges.

    normals (n, 3) unit vectors, distances (n,) and corner_radius in any unit; flatness: radius of the face balls in
    sizes of the body. Each ball touches its plane at the centre of the face, inset by the corner radius; planes
    without a face are left out. Raises ValueError if the planes enclose nothing that holds a ball of the corner radius.
    """
    shape, _, _ = placed_from_planes(normals, distances, corner_radius, flatness, name)
    return shape.rescaled((np.pi / 6.0 / shape.measure) ** (1.0 / 3.0)) if normalise else shape


def placed_from_planes(
    normals: ArrayLike, distances: ArrayLike, corner_radius: float, flatness: float = FLATNESS, name: str = "tile"
) -> tuple[BallPolyhedron, NDArray, NDArray]:
    """As `from_planes` in the given unit of length: (shape, its centre of mass (3,), its frame (3, 3))."""
    n, h = np.array(normals, dtype=np.float64), np.array(distances, dtype=np.float64)
    if n.ndim != 2 or n.shape[1] != 3 or h.shape != n.shape[:1] or len(n) < 4:
        raise ValueError(f"normals and distances have shapes {n.shape}, {h.shape}: must be (n, 3), (n,), n >= 4")
    middle, room = inscribed_ball(n, h)
    if not 0 < corner_radius < room:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below the inscribed radius, {room:.6g}")
    vertices = corners_of(n, h - corner_radius, middle)
    points, kept = _face_centres(vertices, n, h - corner_radius)
    radius = flatness * 2.0 * np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    return placed_ball_polyhedron(points - radius * n[kept], np.full(len(kept), radius), corner_radius, name)


def inscribed_ball(n: NDArray, h: NDArray) -> tuple[NDArray, float]:
    """Centre (3,) and radius of the largest ball within the planes."""
    rows = np.column_stack([n, np.ones(len(n))])
    answer = scipy.optimize.linprog([0, 0, 0, -1], A_ub=rows, b_ub=h, bounds=[(None, None)] * 4)
    if answer.status != 0:
        raise ValueError("normals, distances: the planes enclose no body")
    return answer.x[:3], float(answer.x[3])


def corners_of(n: NDArray, h: NDArray, inside: NDArray) -> NDArray:
    """Vertices (m, 3) of the polyhedron n . x <= h, given a point inside."""
    try:
        return scipy.spatial.HalfspaceIntersection(np.column_stack([n, -h]), inside).intersections
    except scipy.spatial.QhullError as error:
        raise ValueError(f"normals, distances: the planes enclose no body ({error})") from None


def _face_centres(vertices: NDArray, n: NDArray, h: NDArray) -> tuple[NDArray, NDArray]:
    """Centroid (m, 3) of each face that is not tiny, and which planes those are (m,)."""
    size = np.ptp(vertices, axis=0).max()
    centres, kept = [], []
    for i in range(len(n)):
        own = vertices[np.abs(vertices @ n[i] - h[i]) < ON_PLANE * size]
        if len(own) < 3:
            continue
        across = np.linalg.svd(n[i][None])[2][1:]
        flat = (own - own.mean(axis=0)) @ across.T
        try:
            hull = flat[scipy.spatial.ConvexHull(flat).vertices]
        except scipy.spatial.QhullError:  # a face without width
            continue
        a, b = hull, np.roll(hull, -1, axis=0)
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        if 0.5 * cross.sum() < LEAST_FACE * size**2:
            continue
        centre = ((a + b) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
        centres.append(own.mean(axis=0) + centre @ across)
        kept.append(i)
    return np.array(centres), np.array(kept)


def superellipsoid(
    axes: ArrayLike, exponent: float = 2.0, faces: int = 60, corner_radius: float = 0.05, *, name: str | None = None
) -> BallPolyhedron:
    """The body |x/a|^p + |y/b|^p + |z/c|^p <= 1 fitted with `faces` tangent balls; p = 2 is the ellipsoid.

    axes (3,) > 0 in any ratio; exponent p from 1.2 to 20; corner_radius: in equivalent diameters of the target.
    Equivalent diameter 1. Raises ValueError for values out of range.
    """
    a = np.array(axes, dtype=np.float64)
    if a.shape != (3,) or not np.all(np.isfinite(a) & (a > 0)):
        raise ValueError(f"axes = {axes}: must be three lengths > 0")
    if not 1.2 <= exponent <= 20.0:
        raise ValueError(f"exponent = {exponent}: must be from 1.2 to 20")
    if faces < 6:
        raise ValueError(f"faces = {faces}: must be at least 6")
    n = spread(faces)
    q = exponent / (exponent - 1.0)
    y = np.abs(n) * a
    h = (y**q).sum(axis=1) ** (1.0 / q)
    points = np.sign(n) * a * y ** (q - 1.0) * h[:, None] ** (1.0 - q)
    size = 2.0 * a.prod() ** (1.0 / 3.0)
    kind = "ellipsoid" if exponent == 2.0 else "superellipsoid"
    return tangent_ball_polyhedron(points, n, corner_radius * size, name=name or f"{kind} of {faces} faces")


def ellipsoid(axes: ArrayLike, faces: int = 60, corner_radius: float = 0.05) -> BallPolyhedron:
    """The ellipsoid of these semi-axes (3,) by `faces` tangent balls; see `superellipsoid`."""
    return superellipsoid(axes, 2.0, faces, corner_radius)


def regular_polyhedron(faces: int, corner_radius: float = 0.05) -> BallPolyhedron:
    """A Platonic solid of 4, 6, 8, 12 or 20 faces, corners rounded with corner_radius [equivalent diameters]."""
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
        raise ValueError(f"faces = {faces}: must be one of {sorted(normals)}")
    n = normals[faces] / np.linalg.norm(normals[faces], axis=1, keepdims=True)
    return _with_corner(n, np.ones(len(n)), corner_radius, f"regular polyhedron of {faces} faces")


def _with_corner(n: NDArray, h: NDArray, corner_radius: float, name: str) -> BallPolyhedron:
    """`from_planes` whose dilation is corner_radius in units of its own equivalent diameter, to CORNER_TOLERANCE."""
    room = inscribed_ball(n, h)[1]
    return meeting_corner(lambda asked: from_planes(n, h, asked, name=name), corner_radius, room)


def random_polyhedra(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    faces: tuple[int, int] = (12, 20),
    elongation: float = 1.0,
    angularity: float = 1.0,
) -> list[BallPolyhedron]:
    """`count` irregular 3D grains that touch an ellipsoid all round, equivalent diameter 1.

    faces: fewest and most faces, both included, drawn evenly. elongation: longest over shortest axis of the ellipsoid,
    1 to 4; the middle axis is their geometric mean. angularity: share of the roundness that the faces give up to the
    edges, 0 to 1; the curvature of a face is 1 - angularity times that of the roundest faces (SLACK times the least
    ball that leaves the others their place), but never less than 1/FLATNESS sizes. corner_radius: dilation in units of
    the grain's equivalent diameter, met to 1e-10. Directions are evenly spread, moved by a quarter of their distance
    and turned at random. Deterministic in the seed, and the first n shapes are the same whatever the count.
    Raises ValueError if a number is out of range or none of TRIES draws gives a grain.
    """
    if count < 0:
        raise ValueError(f"count = {count}: must be >= 0")
    if not 6 <= faces[0] <= faces[1]:
        raise ValueError(f"faces = {faces}: must be (fewest, most) with 6 <= fewest <= most")
    if not 1 <= elongation <= 4:
        raise ValueError(f"elongation = {elongation}: must be from 1 to 4")
    if not 0 <= angularity <= 1:
        raise ValueError(f"angularity = {angularity}: must be from 0 to 1")
    if not 0 < corner_radius < 0.5:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.5, which is a sphere")
    axes = 0.5 * np.sqrt(elongation) ** np.array([1.0, 0.0, -1.0])
    slack = SLACK / max(1.0 - angularity, 1e-6)

    def grain(k: int) -> BallPolyhedron:
        rng = np.random.default_rng([seed, k])
        for _ in range(TRIES):
            u = spread(int(rng.integers(faces[0], faces[1] + 1)))
            u = u + 0.25 * np.sqrt(4.0 * np.pi / len(u)) * rng.uniform(-1.0, 1.0, u.shape)
            u = u @ scipy.spatial.transform.Rotation.random(rng=rng).as_matrix().T
            u /= np.linalg.norm(u, axis=1, keepdims=True)
            n = u / axes / np.linalg.norm(u / axes, axis=1, keepdims=True)
            make = partial(
                tangent_ball_polyhedron, axes * u, n, slack=slack, largest_radius=FLATNESS, name=f"random {seed}-{k}"
            )
            try:
                return meeting_corner(make, corner_radius, axes[2])
            except ValueError as failure:  # slivers: another draw
                error = failure
        raise ValueError(
            f"faces = {faces}, elongation = {elongation}, angularity = {angularity}, corner_radius = {corner_radius}: "
            f"no grain in {TRIES} draws ({error})"
        )

    return [grain(k) for k in range(count)]


def random_angular_polyhedra(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    faces: tuple[int, int] = (10, 18),
    max_aspect: float = 1.5,
) -> list[BallPolyhedron]:
    """`count` angular 3D grains: cells of a relaxed Voronoi tiling with rounded corners, equivalent diameter 1.

    Cells are kept if their number of faces lies in `faces` (both included) and their aspect, the ratio of the longest
    to the shortest axis of the ellipsoid of equal moments, is below max_aspect. corner_radius: dilation in units of
    the grain's equivalent diameter, met to 1e-10. Deterministic in the seed, and the first n shapes are the same
    whatever the count. Raises ValueError if a parameter is out of range or no cell meets the request.
    """
    if count < 0:
        raise ValueError(f"count = {count}: must be >= 0")
    if not 4 <= faces[0] <= faces[1]:
        raise ValueError(f"faces = {faces}: must be (fewest, most) with 4 <= fewest <= most")
    shapes, batch, barren = [], 0, 0
    while len(shapes) < count:
        before = len(shapes)
        for _, n, h in voronoi_cells(TILES_PER_BATCH, (seed, batch)):
            if len(shapes) == count:
                break
            try:
                shape = _with_corner(n, h, corner_radius, f"angular polyhedron {seed}-{len(shapes)}")
            except ValueError:
                if corner_radius <= 0 or corner_radius >= 0.5:
                    raise
                continue  # too slender for the corner radius, or a sliver
            moments = shape.inertia.sum() / 2.0 - shape.inertia
            if faces[0] <= shape.face_count <= faces[1] and np.sqrt(moments.max() / moments.min()) < max_aspect:
                shapes.append(shape)
        batch += 1
        barren = barren + 1 if len(shapes) == before else 0
        if barren == BARREN_BATCHES:
            raise ValueError(f"faces = {faces}, max_aspect = {max_aspect}, corner_radius = {corner_radius}: none found")
    return shapes


def voronoi_cells(count: int, seed, relaxations: int = 2) -> list[tuple[NDArray, NDArray, NDArray]]:
    """(site (3,), normals (m, 3), distances from it (m,)) of the cells of a relaxed periodic Voronoi tiling."""
    sites = np.random.default_rng(seed).random((count, 3))
    shifts = np.array(np.meshgrid(*[[0, -1, 1]] * 3, indexing="ij")).reshape(3, -1).T
    for step in range(relaxations + 1):
        copies = (sites + shifts[:, None]).reshape(-1, 3)
        diagram = scipy.spatial.Voronoi(copies)
        if step < relaxations:
            sites = (
                np.array([_centroid(diagram.vertices[diagram.regions[r]]) for r in diagram.point_region[:count]]) % 1
            )
    planes = [([], []) for _ in range(count)]
    for a, b in diagram.ridge_points:
        for k, other in ((a, b), (b, a)):
            if k < count:
                way = copies[other] - copies[k]
                length = np.linalg.norm(way)
                planes[k][0].append(way / length)
                planes[k][1].append(0.5 * length)
    return [(site, np.array(n), np.array(h)) for site, (n, h) in zip(sites, planes, strict=True)]


def _centroid(vertices: NDArray) -> NDArray:
    """Centre of mass of the convex hull of points (m, 3)."""
    hull = scipy.spatial.ConvexHull(vertices)
    a, b, c = (vertices[hull.simplices[:, i]] for i in range(3))
    origin = vertices.mean(axis=0)
    volume = np.abs(np.einsum("ij,ij->i", a - origin, np.cross(b - origin, c - origin)))
    return origin + (volume[:, None] * (a + b + c - 3.0 * origin)).sum(axis=0) / (4.0 * volume.sum())
