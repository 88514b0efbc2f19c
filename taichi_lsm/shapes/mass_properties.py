"""Volume, centre and second moments of a dilated cell of balls, by the divergence theorem over its smooth surface.

With x the surface point and n its outward normal:

    V = 1/3 int x.n dS,
    int x_a dV = 1/2 int x_a^2 n_a dS,
    int x_a x_b dV = 1/2 int x_a^2 x_b n_a dS (a != b),
    int x_a^2 dV = 1/3 int x_a^3 n_a dS.

Each face and vertex is a fan of triangles on the sphere of normals, each edge a rectangle in its two angles;
Gauss-Legendre quadrature converges fast there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .ball_cells import Features


def _rule(count: int) -> tuple[NDArray, NDArray]:
    """Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1.0), 0.5 * weights


_FINE, _COARSE = _rule(24), _rule(10)
NARROW = 0.6  # rad: over less, ten nodes are exact to rounding


def _nodes(angle: float) -> tuple[NDArray, NDArray]:
    """Gauss nodes and weights on [0, 1] for a smooth function of a direction that turns by `angle` [rad]."""
    return _COARSE if abs(angle) < NARROW else _FINE


def mass_of(cell: Features, dilation: float) -> tuple[float, NDArray, NDArray]:
    """(volume, centre of mass (3,), second moments int x x^T dV (3, 3) about the origin), unit density."""
    totals = np.zeros(10)
    if cell.edges == 0:
        return _ball(cell.centre[0], cell.radius[0] + dilation)
    for e in range(cell.edges):
        totals += _strip(cell, e, dilation)
    for f in range(cell.faces):
        totals += _face(cell, f, dilation)
    for v in range(cell.vertices):
        totals += _corner(cell, v, dilation)
    volume = totals[0]
    second = np.array(
        [[totals[4], totals[7], totals[8]], [totals[7], totals[5], totals[9]], [totals[8], totals[9], totals[6]]]
    )
    return float(volume), totals[1:4] / volume, second


def _ball(centre: NDArray, radius: float) -> tuple[float, NDArray, NDArray]:
    """As `mass_of` for a single ball."""
    volume = 4.0 / 3.0 * np.pi * radius**3
    return volume, centre.copy(), volume * (0.2 * radius**2 * np.eye(3) + np.outer(centre, centre))


def _flux(x: NDArray, n: NDArray, area: NDArray) -> NDArray:
    """The ten integrals of the module's docstring over points (k, 3) with normals (k, 3) and areas (k,)."""
    weighted = n * area[:, None]
    volume = np.sum(x * weighted) / 3.0
    first = 0.5 * np.sum(x**2 * weighted, axis=0)
    square = np.sum(x**3 * weighted, axis=0) / 3.0
    mixed = [0.5 * np.sum(x[:, a] ** 2 * x[:, b] * weighted[:, a]) for a, b in ((0, 1), (0, 2), (1, 2))]
    return np.concatenate([[volume], first, square, mixed])


def _strip(cell: Features, e: int, r: float) -> NDArray:
    """The torus strip of edge e."""
    f = cell.faces + e
    (along, weight_along), (over, weight_over) = _nodes(cell.span[e]), _nodes(np.diff(np.arcsin(cell.slopes(e)))[0])
    angle = cell.start[e] + cell.span[e] * along
    low, high = (np.arcsin(np.clip(s, -1.0, 1.0)) for s in cell.slopes(e))
    tilt = low + (high - low) * over
    out = np.repeat(cell.circle(e, angle), len(tilt), axis=0)
    tilt = np.tile(tilt, len(angle))
    n = np.cos(tilt)[:, None] * out + np.sin(tilt)[:, None] * cell.axis[f]
    x = cell.centre[f] + cell.rho[f] * out + r * n
    weight = np.outer(weight_along, weight_over).ravel() * cell.span[e] * (high - low)
    return _flux(x, n, weight * r * (cell.rho[f] + r * np.cos(tilt)))


def _fan(apex: NDArray, rim: NDArray, slope: NDArray, weight: NDArray) -> tuple[NDArray, NDArray]:
    """Normals (k, 3) and solid angles (k,) of the triangle from the apex to a curve of normals on the sphere.

    rim (m, 3): the curve, slope (m, 3): its derivative by the parameter whose weights are `weight` (m,); the solid
    angle is negative where the curve runs clockwise round the apex.
    """
    nodes, weights = _nodes(np.arccos(np.clip((rim @ apex).min(), -1.0, 1.0)))
    s = nodes[:, None, None]
    v = (1.0 - s) * apex + s * rim
    jacobian = np.einsum("smk,smk->sm", v, np.cross(rim - apex, s * slope))
    length = np.linalg.norm(v, axis=2)
    solid = jacobian / length**3 * weights[:, None] * weight
    return (v / length[..., None]).reshape(-1, 3), solid.ravel()


def _face(cell: Features, f: int, r: float) -> NDArray:
    """The spherical patch of face f: a fan over the normals along its edges."""
    rims = []
    for e in map(int, np.flatnonzero((cell.side == f).any(axis=1))):
        nodes, weights = _nodes(cell.span[e])
        out = cell.circle(e, cell.start[e] + cell.span[e] * nodes)
        along = np.cross(cell.axis[cell.faces + e], out)  # derivative of `out` by its angle
        sine = cell.slopes(e)[0 if cell.side[e, 0] == f else 1]
        cosine = np.sqrt(max(0.0, 1.0 - sine**2))
        sense = -1.0 if cell.side[e, 0] == f else 1.0  # the axis points out of the first face
        rim = cosine * out + sine * cell.axis[cell.faces + e]
        rims.append((rim, cosine * along, sense * cell.span[e] * weights))
    middle = np.sum([np.sum(rim * np.abs(weight)[:, None], axis=0) for rim, _, weight in rims], axis=0)
    apex = _inside(cell, f, middle)
    big = cell.radius[f] + r
    total = np.zeros(10)
    for rim, slope, weight in rims:
        n, solid = _fan(apex, rim, slope, weight)
        total += _flux(cell.centre[f] + big * n, n, big**2 * solid)
    return total


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


def _corner(cell: Features, v: int, r: float) -> NDArray:
    """The spherical polygon of vertex v, whose sides are the normals of its edges there."""
    sides = []
    for e, tip in np.argwhere(cell.ends == v).tolist():
        angle = cell.start[e] + tip * cell.span[e]
        out = cell.circle(e, np.array([angle]))[0]
        low, high = (np.arcsin(np.clip(s, -1.0, 1.0)) for s in cell.slopes(e))
        nodes, weights = _nodes(high - low)
        tilt = low + (high - low) * nodes
        axis = cell.axis[cell.faces + e]
        rim = np.cos(tilt)[:, None] * out + np.sin(tilt)[:, None] * axis
        slope = -np.sin(tilt)[:, None] * out + np.cos(tilt)[:, None] * axis
        sides.append((rim, slope, (high - low) * weights))
    apex = np.sum([rim.sum(axis=0) for rim, _, _ in sides], axis=0)
    apex /= np.linalg.norm(apex)
    total = np.zeros(10)
    for rim, slope, weight in sides:
        n, solid = _fan(apex, rim, slope, weight)
        sign = 1.0 if solid.sum() > 0 else -1.0  # the polygon is convex: no part of the fan is counted twice
        total += _flux(cell.centre[cell.faces + cell.edges + v] + r * n, n, sign * r**2 * solid)
    return total
