"""Plane and solid geometry that several kinds of shapes share: normals, polygons, planes, directions."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError


def cross_2d(a: NDArray, b: NDArray) -> NDArray:
    """z-component (...) of the cross product of plane vectors a, b (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def unit_normals(angle: ArrayLike) -> NDArray:
    """Unit vectors (..., 2) at angles (...) [rad] from the x axis."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def even_directions(count: int) -> NDArray:
    """`count` unit vectors (count, 3), nearly even over the sphere: a Fibonacci spiral."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    return np.stack([np.sqrt(1.0 - z**2) * np.cos(angle), np.sqrt(1.0 - z**2) * np.sin(angle), z], axis=1)


def polygon_integrals(vertices: NDArray) -> tuple[float, NDArray, NDArray]:
    """2 A, 6 int x dA (2,) and 24 int x x^T dA (2, 2) of a polygon (k, 2), negative if it runs clockwise.

    Sums over the triangles (0, a, b) of the sides a to b: with c = a cross b these have the area c/2, the first moment
    c (a + b)/6 and the second moments c (a a^T + b b^T + (a + b)(a + b)^T)/24. The products cancel for a polygon far
    from the origin, which should therefore lie near it.
    """
    a, b = vertices, np.roll(vertices, -1, axis=0)
    c = cross_2d(a, b)
    first = ((a + b) * c[:, None]).sum(axis=0)
    outer = np.einsum("ki,kj->kij", a, a) + np.einsum("ki,kj->kij", b, b) + np.einsum("ki,kj->kij", a + b, a + b)
    return float(c.sum()), first, np.einsum("k,kij->ij", c, outer)


def polyhedron_integrals(vertices: NDArray) -> tuple[float, NDArray, NDArray]:
    """Volume V, centre of mass (3,) and second moments int x x^T dV (3, 3) about it, of the hull of points (k, 3).

    Sums over the tetrahedra (0, a, b, c) of the triangles of the surface, 0 a point inside, with s = a + b + c: these
    have the volume v = |a . (b x c)|/6, the first moment v s/4 and the second moments v (a a^T + b b^T + c c^T +
    s s^T)/20.
    """
    origin = vertices.mean(axis=0)
    a, b, c = (vertices - origin)[scipy.spatial.ConvexHull(vertices).simplices].transpose(1, 0, 2)
    s = a + b + c
    v = np.abs(np.sum(a * np.cross(b, c), axis=1)) / 6.0
    volume = float(v.sum())
    centre = v @ s / (4.0 * volume)
    second = sum(np.einsum("k,ki,kj->ij", v, x, x) for x in (a, b, c, s)) / 20.0
    return volume, origin + centre, second - volume * np.outer(centre, centre)


def principal_frame(second: NDArray) -> tuple[NDArray, NDArray]:
    """Moments of inertia and their frame, from second moments int x x^T (dim, dim) about the centre of mass.

    In 2D the polar moment (1,) and the identity; in 3D the principal moments (3,), ascending, and the rotation matrix
    (3, 3) whose columns are their axes.
    """
    if len(second) == 2:
        return np.array([np.trace(second)]), np.eye(2)
    moments, frame = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    return moments, frame * np.sign(np.linalg.det(frame))


def deepest_point(normals: NDArray, distances: NDArray) -> tuple[NDArray, float]:
    """Point x (dim,) and greatest t with normals[i] . x + t <= distances[i], by a linear programme.

    For unit normals (m, dim) that is the centre and the radius of the largest ball within the planes. InputError if
    the planes enclose no body.
    """
    dim = normals.shape[1]
    rows = np.column_stack([normals, np.ones(len(normals))])
    answer = scipy.optimize.linprog(
        [*np.zeros(dim), -1.0], A_ub=rows, b_ub=distances, bounds=[(None, None)] * (dim + 1), method="highs"
    )
    if answer.status != 0:
        raise InputError("normals, distances: the planes enclose no body; add planes or move them outwards")
    return answer.x[:dim], float(answer.x[dim])


def least_tangent_radii(points: NDArray, normals: NDArray, size: float) -> NDArray:
    """Radii (n,) of the least balls tangent at points[i] (n, dim), with the normals there, that hold all points.

    A ball of radius R about x_i - R n_i holds x if |x - x_i|^2 <= -2 R (x - x_i) . n_i. Infinite where no other point
    lies below the tangent plane by 1e-9 of `size`.
    """
    radius = np.full(len(points), np.inf)
    for i in range(len(points)):
        away = points - points[i]
        drop = -2.0 * (away @ normals[i])
        low = drop > 1e-9 * size
        if low.any():
            radius[i] = (np.sum(away[low] ** 2, axis=1) / drop[low]).max()
    return radius


def convex_mesh(points: NDArray) -> tuple[NDArray, NDArray]:
    """The convex hull of points (k, 3): those on it (m, 3), and triangles (t, 3) of them, counter-clockwise outside."""
    hull = scipy.spatial.ConvexHull(points)
    used, index = np.unique(hull.simplices, return_inverse=True)
    vertices, triangles = points[used], index.reshape(hull.simplices.shape)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return vertices, triangles
