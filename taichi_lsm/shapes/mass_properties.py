"""Volume, centre and second moments of a dilated cell of balls, by the divergence theorem over its smooth surface.

With x the surface point and n its outward normal:

    V = 1/3 int x.n dS,
    int x_a dV = 1/2 int x_a^2 n_a dS,
    int x_a x_b dV = 1/2 int x_a^2 x_b n_a dS (a != b),
    int x_a^2 dV = 1/3 int x_a^3 n_a dS.

Each face and vertex is a fan of triangles on the sphere of normals, each edge a rectangle in its two angles;
Gauss-Legendre quadrature converges fast there. All pieces that take equally many nodes are summed at once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .ball_cells import Features

# x (k, 3), n (k, 3) and the area (k,) of the nodes of some pieces of the surface.
Nodes = tuple[NDArray, NDArray, NDArray]
# Some sides of faces or corners: which face or corner each belongs to (m,), its curve of normals (m, j, 3), the
# derivative by the parameter of the curve (m, j, 3), and the weights of the parameter (m, j).
Sides = tuple[NDArray, NDArray, NDArray, NDArray]


def _rule(count: int) -> tuple[NDArray, NDArray]:
    """Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1.0), 0.5 * weights


_FINE, _COARSE = _rule(24), _rule(10)
NARROW = 0.6  # rad: over less, ten nodes are exact to rounding


def _by_rule(angle: NDArray) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """(pieces, nodes, weights) for smooth functions of a direction that turns by `angle` (pieces,) [rad]."""
    narrow = np.abs(angle) < NARROW
    for pieces, (nodes, weights) in ((np.flatnonzero(narrow), _COARSE), (np.flatnonzero(~narrow), _FINE)):
        if len(pieces):
            yield pieces, nodes, weights


def mass_of(cell: Features, dilation: float) -> tuple[float, NDArray, NDArray]:
    """(volume, centre of mass (3,), second moments int x x^T dV (3, 3) about the origin), unit density."""
    if cell.edges == 0:
        return _ball(cell.centre[0], cell.radius[0] + dilation)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for x, n, area in _surface(cell, dilation):
        weighted = n * area[:, None]
        volume += np.sum(x * weighted) / 3.0
        squares = x**2 * weighted
        first += 0.5 * squares.sum(axis=0)
        second += squares.T @ x  # the factors 1/3 and 1/2 of the docstring follow
    second = np.triu(second, 1) / 2.0 + np.triu(second, 1).T / 2.0 + np.diag(np.diag(second)) / 3.0
    return float(volume), first / volume, second


def volume_of(cell: Features, dilation: float) -> float:
    """The volume alone, in a fraction of the time: faces and corners need integrals along their sides only.

    On a sphere x.n = p.n + R, and over a part of it with any normal a inside and the border n(t), all round,
    int n dS = 1/2 int n x n' dt, int dS = int a.(n x n')/(1 + a.n) dt.
    """
    if cell.edges == 0:
        return _ball(cell.centre[0], cell.radius[0] + dilation)[0]
    sine, radius = _sines(cell), cell.radius + dilation
    three_volumes = sum(np.einsum("ij,ij,i->", x, n, area) for x, n, area in _strips(cell, sine, dilation))
    for first, apex, sides in ((0, *_face_sides(cell, sine)), (cell.faces + cell.edges, *_corner_sides(cell, sine))):
        for own, rim, slope, weight in sides:
            area = np.cross(rim, slope) * weight[..., None]
            along = np.einsum("mjk,mk->mj", area, apex[own])
            solid = (along / (1.0 + np.einsum("mjk,mk->mj", rim, apex[own]))).sum(axis=1)
            sign = np.where(solid > 0, 1.0, -1.0) if first else 1.0
            p, big = cell.centre[first + own], radius[first + own]
            mean = 0.5 * np.einsum("mjk,mk->m", area, p)
            three_volumes += np.sum(sign * big**2 * (mean + big * solid))
    return float(three_volumes / 3.0)


def _ball(centre: NDArray, radius: float) -> tuple[float, NDArray, NDArray]:
    """As `mass_of` for a single ball."""
    volume = 4.0 / 3.0 * np.pi * radius**3
    return volume, centre.copy(), volume * (0.2 * radius**2 * np.eye(3) + np.outer(centre, centre))


def _surface(cell: Features, r: float) -> Iterator[Nodes]:
    """Nodes of the whole surface of a cell with edges: torus strips, faces and corners."""
    sine = _sines(cell)
    yield from _strips(cell, sine, r)
    yield from _faces(cell, sine, r)
    yield from _corners(cell, sine, r)


def _sines(cell: Features) -> NDArray:
    """Sines (edges, 2) of the normals of the two faces of each edge against the plane of its circle."""
    return np.clip([cell.slopes(e) for e in range(cell.edges)], -1.0, 1.0)


def _strips(cell: Features, sine: NDArray, r: float) -> Iterator[Nodes]:
    """The torus strips of the edges."""
    low, high = np.arcsin(sine).T
    for wide, along, weight_along in _by_rule(cell.span):
        for pieces, over, weight_over in _by_rule((high - low)[wide]):
            e = wide[pieces]
            f = cell.faces + e
            angle = cell.start[e, None] + cell.span[e, None] * along
            out = _circles(cell, e, angle)[:, :, None]
            tilt = (low[e, None] + (high - low)[e, None] * over)[:, None]
            n = np.cos(tilt)[..., None] * out + np.sin(tilt)[..., None] * cell.axis[f, None, None]
            x = cell.centre[f, None, None] + cell.rho[f, None, None, None] * out + r * n
            weight = np.outer(weight_along, weight_over) * (cell.span * (high - low))[e, None, None]
            area = weight * r * (cell.rho[f, None, None] + r * np.cos(tilt))
            yield x.reshape(-1, 3), n.reshape(-1, 3), area.ravel()


def _circles(cell: Features, e: NDArray, angle: NDArray) -> NDArray:
    """Unit vectors (k, m, 3) from the centres of the circles of edges e (k,) to their points at angles (k, m) [rad]."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=2) @ cell.across[e].transpose(0, 2, 1)


def _fans(apex: NDArray, rim: NDArray, slope: NDArray, weight: NDArray) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """(pieces (p,), normals (p, k, 3), solid angles (p, k)) of the triangles from apices to curves on the sphere.

    apex (m, 3); rim (m, j, 3): the curves, slope (m, j, 3): their derivatives by the parameter whose weights are
    `weight` (m, j); a solid angle is negative where its curve runs clockwise round its apex.
    """
    widest = np.arccos(np.clip(np.einsum("mjk,mk->mj", rim, apex).min(axis=1), -1.0, 1.0))
    for m, nodes, weights in _by_rule(widest):
        s = nodes[:, None, None]
        a, b = apex[m, None, None], rim[m, None]
        v = (1.0 - s) * a + s * b
        # The solid angle of (s, curve) is v . ((rim - apex) x s slope)/|v|^3.
        across = np.cross(rim[m] - apex[m, None], slope[m])
        jacobian = np.einsum("msjk,mjk->msj", v, across) * nodes[:, None]
        length = np.sqrt(np.einsum("msjk,msjk->msj", v, v))
        solid = jacobian / length**3 * weights[:, None] * weight[m, None]
        yield m, (v / length[..., None]).reshape(len(m), -1, 3), solid.reshape(len(m), -1)


def _face_sides(cell: Features, sine: NDArray) -> tuple[NDArray, list[Sides]]:
    """A normal (faces, 3) inside the cone of each face, and the normals along its edges, counter-clockwise."""
    sides, middle = [], np.zeros((cell.faces, 3))
    for e, nodes, weights in _by_rule(cell.span):
        out = _circles(cell, e, cell.start[e, None] + cell.span[e, None] * nodes)
        axis = cell.axis[cell.faces + e, None]
        along = np.cross(axis, out)  # derivative of `out` by its angle
        for side, sense in ((0, -1.0), (1, 1.0)):  # the axis points out of the first face
            s = sine[e, side, None, None]
            cosine = np.sqrt(1.0 - s**2)
            rim, weight = cosine * out + s * axis, cell.span[e, None] * weights
            np.add.at(middle, cell.side[e, side], np.einsum("ejk,ej->ek", rim, weight))
            sides.append((cell.side[e, side], rim, cosine * along, sense * weight))
    return np.array([_inside(cell, f, middle[f]) for f in range(cell.faces)]), sides


def _faces(cell: Features, sine: NDArray, r: float) -> Iterator[Nodes]:
    """The spherical patches of the faces: fans over the normals along their edges."""
    apex, sides = _face_sides(cell, sine)
    for face, rim, slope, weight in sides:
        for m, n, solid in _fans(apex[face], rim, slope, weight):
            f = face[m]
            big = cell.radius[f] + r
            x = cell.centre[f, None] + big[:, None, None] * n
            yield x.reshape(-1, 3), n.reshape(-1, 3), (big[:, None] ** 2 * solid).ravel()


def _inside(cell: Features, f: int, middle: NDArray) -> NDArray:
    """A unit normal in the cone of face f, the apex of its fan.

    That is the mean of its rim, or for a rim round half the sphere and more the mean direction away from its bounds.
    """
    own = slice(cell.first_bound[f], cell.first_bound[f + 1])
    length = np.linalg.norm(middle)
    if length > 1e-6 and np.all(cell.bound[own] @ middle <= length * cell.offset[own]):
        return middle / length
    inward = -cell.bound[own].sum(axis=0)
    return inward / np.linalg.norm(inward)


def _corner_sides(cell: Features, sine: NDArray) -> tuple[NDArray, list[Sides]]:
    """A normal (vertices, 3) inside the cone of each vertex, and the normals of its edges there, in either sense."""
    e, tip = np.nonzero(cell.ends >= 0)
    vertex = cell.ends[e, tip]
    out = _circles(cell, e, (cell.start[e] + tip * cell.span[e])[:, None])
    low, high = np.arcsin(sine[e]).T
    sides, apex = [], np.zeros((cell.vertices, 3))
    for k, nodes, weights in _by_rule(high - low):
        tilt = (low[k, None] + (high - low)[k, None] * nodes)[..., None]
        axis = cell.axis[cell.faces + e[k], None]
        rim = np.cos(tilt) * out[k] + np.sin(tilt) * axis
        np.add.at(apex, vertex[k], rim.mean(axis=1))
        slope = -np.sin(tilt) * out[k] + np.cos(tilt) * axis
        sides.append((vertex[k], rim, slope, (high - low)[k, None] * weights))
    return apex / np.linalg.norm(apex, axis=1, keepdims=True), sides


def _corners(cell: Features, sine: NDArray, r: float) -> Iterator[Nodes]:
    """The spherical polygons of the vertices."""
    apex, sides = _corner_sides(cell, sine)
    for v, rim, slope, weight in sides:
        for m, n, solid in _fans(apex[v], rim, slope, weight):
            sign = np.where(solid.sum(axis=1) > 0, 1.0, -1.0)  # the polygon is convex: no part is counted twice
            x = cell.centre[cell.faces + cell.edges + v[m], None] + r * n
            yield x.reshape(-1, 3), n.reshape(-1, 3), (sign[:, None] * r**2 * solid).ravel()
