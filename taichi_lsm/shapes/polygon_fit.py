"""Closed chains of circular arcs with a continuous normal: construction, mass, and the fit to a polygon.

A chain is fixed by its break angles theta_i and radii r_i. Arc i turns the outward normal n from theta_i to
theta_(i+1) and moves the surface point by the integral of r_i (-sin, cos) dtheta = r_i (n_(i+1) - n_i), so
the chain closes if sum of r_i (n_(i+1) - n_i) = 0. That is linear in the radii: the fit to a polygon is a
linear programme.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from .arc_chain import CHAIN_TOLERANCE, ArcChain
from .voronoi_tiles import SHORT_SIDE, polygon_measures

# Gauss-Legendre on [-1, 1]. The integrands are trigonometric polynomials of degree 3 on arcs of less than pi;
# with 16 nodes the remainder is below 1e-17 of the integrand. Closed forms would cancel on the narrow, flat
# arcs of the sides.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)

LEAST_TURN = 1e-6  # rad: a corner that turns by less joins its two sides into one
SIDE_SHARE = 0.25  # of a corner's turn: the most that the arc of a side may take from it


def _cross(a: NDArray, b: NDArray) -> NDArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _normals(angle: NDArray) -> NDArray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def arc_chain(breaks: ArrayLike, radii: ArrayLike, *, name: str = "arc chain", normalise: bool = True) -> ArcChain:
    """The closed convex chain whose arc i has radius radii[i] and normals from breaks[i] to breaks[i + 1].

    breaks (n,) [rad], ascending, less than one turn from first to last, steps below pi; the last arc ends at
    breaks[0] + 2 pi. radii (n,) > 0 in any unit. The shape is moved to its centre of mass and, unless
    normalise is False, rescaled to equivalent diameter 1. Mass properties are exact to rounding.
    Raises ValueError if angles or radii are not of this form or the chain stays open by 1e-9 of its size.
    """
    breaks, radius = np.array(breaks, dtype=np.float64), np.array(radii, dtype=np.float64)
    if breaks.ndim != 1 or breaks.size < 3 or radius.shape != breaks.shape:
        raise ValueError(f"breaks and radii have shapes {breaks.shape}, {radius.shape}: must be (n,), n >= 3, both")
    if not np.all(np.isfinite(breaks)):
        raise ValueError(f"breaks = {breaks}: must be finite")
    if not np.all((radius > 0) & np.isfinite(radius)):
        raise ValueError(f"radii = {radius}: must be finite and > 0")
    span = np.diff(breaks, append=breaks[0] + 2 * np.pi)
    if np.any(span <= 0) or np.any(span >= np.pi):
        raise ValueError(f"breaks turn by {span} rad: each step must be more than 0 and less than pi")
    seam = _normals(breaks)
    gap = float(np.linalg.norm(radius @ (np.roll(seam, -1, axis=0) - seam)))
    size = float(radius @ span) / np.pi
    if gap > CHAIN_TOLERANCE * size:
        raise ValueError(f"radii leave the chain open by {gap:.3g}: must close to {CHAIN_TOLERANCE * size:.3g}")

    centre = np.zeros((radius.size, 2))
    centre[1:] = np.cumsum((radius[:-1] - radius[1:])[:, None] * seam[1:], axis=0)
    centre -= _area_and_moment(centre, radius, breaks, span)[1]
    area, residue, _ = _area_and_moment(centre, radius, breaks, span)
    centre -= residue  # the first shift, from far away, leaves its rounding
    scale = np.sqrt(0.25 * np.pi / area) if normalise else 1.0
    centre, radius = scale * centre, scale * radius
    area, _, polar = _area_and_moment(centre, radius, breaks, span)
    bounding_radius, lever = _reach(centre, radius, breaks, span)
    return ArcChain(
        name=name,
        dim=2,
        centre=centre,
        radius=radius,
        seam=seam,
        measure=area,
        inertia=np.array([polar]),
        bounding_radius=bounding_radius,
        overlap_limit=float(radius.min()),
        lever=lever,
    )


def _area_and_moment(centre: NDArray, radius: NDArray, breaks: NDArray, span: NDArray) -> tuple[float, NDArray, float]:
    """Area, centroid (2,) and polar second moment about the origin, by the divergence theorem.

    With x = p + r n and ds = r dtheta: area = 1/2 int x.n ds, int x dA = 1/3 int x (x.n) ds,
    int |x|^2 dA = 1/4 int |x|^2 (x.n) ds.
    """
    angle = (breaks + 0.5 * span)[:, None] + 0.5 * span[:, None] * _NODES
    n = _normals(angle)
    x = centre[:, None, :] + radius[:, None, None] * n
    flux = np.sum(x * n, axis=-1) * (0.5 * radius * span)[:, None] * _WEIGHTS
    area = 0.5 * flux.sum()
    centroid = np.einsum("ij,ijk->k", flux, x) / (3 * area)
    polar = 0.25 * np.sum(flux * np.sum(x * x, axis=-1))
    return float(area), centroid, float(polar)


def _reach(centre: NDArray, radius: NDArray, breaks: NDArray, span: NDArray) -> tuple[float, float]:
    """Greatest |x| and greatest |x cross n| over the outline, both exact."""
    distance = np.linalg.norm(centre, axis=1)
    towards = np.arctan2(centre[:, 1], centre[:, 0])

    def within(angle: NDArray) -> NDArray:
        return np.mod(angle - breaks, 2 * np.pi) <= span

    n = _normals(breaks)
    bounding = np.linalg.norm(centre + radius[:, None] * n, axis=1).max()
    facing = within(towards)  # there x = p + r n is longest where n points along p
    if facing.any():
        bounding = max(bounding, (distance + radius)[facing].max())
    lever = np.abs(_cross(centre, n)).max()
    quarter = 0.5 * np.pi  # x cross n = p cross n is greatest where n is square to p
    square = within(towards + quarter) | within(towards - quarter)
    if square.any():
        lever = max(lever, distance[square].max())
    return float(bounding), float(lever)


def regular_disc_of_arcs(n: int) -> ArcChain:
    """The disc of diameter 1 cut into n >= 3 equal arcs, all centred at 0: contacts equal those of `disc`."""
    if n < 3:
        raise ValueError(f"n = {n}: must be at least 3, for arcs turn by less than pi")
    return ArcChain(
        name=f"disc of {n} arcs",
        dim=2,
        centre=np.zeros((n, 2)),
        radius=np.full(n, 0.5),
        seam=_normals(2 * np.pi / n * np.arange(n)),
        measure=np.pi / 4,
        inertia=np.array([np.pi / 32]),
        bounding_radius=0.5,
        overlap_limit=0.5,
        lever=0.0,
    )


def from_polygon(
    vertices: ArrayLike,
    corner_radius: float,
    side_half_width: float = np.radians(3.0),
    arcs_per_corner: int = 1,
    *,
    largest_radius: float = 10.0,
    name: str = "rounded polygon",
    normalise: bool = True,
) -> ArcChain:
    """The arc chain of greatest perimeter inside a convex polygon, with no arc sharper than corner_radius.

    vertices (k, 2) in any unit L, in order, either way round. corner_radius [L]. Each side gets one arc that
    turns by side_half_width [rad] to either side of its normal (less beside blunt corners), each corner
    arcs_per_corner equal arcs. largest_radius: bound on every arc in units of the polygon's equivalent
    diameter.
    Linear programme: maximise sum r_i dtheta_i over the first point and the radii, subject to closure, to the
    support h(side normal) <= side distance, and to corner_radius <= r_i <= largest_radius. A disc that fits
    is feasible, so the programme is feasible exactly for corner radii up to the polygon's inscribed radius.
    Moved to its centre of mass and rescaled (normalise) as in `arc_chain`.
    Raises ValueError if the polygon is not convex or a parameter is out of the range it names.
    """
    points, size = _convex_sides(vertices)
    if not 0 < side_half_width < 0.5 * np.pi:
        raise ValueError(f"side_half_width = {side_half_width}: must be above 0 and below pi/2 rad")
    if arcs_per_corner < 1:
        raise ValueError(f"arcs_per_corner = {arcs_per_corner}: must be at least 1")
    if not (np.isfinite(corner_radius) and corner_radius > 0):
        raise ValueError(f"corner_radius = {corner_radius}: must be finite and > 0")
    if not corner_radius <= largest_radius * size:
        raise ValueError(
            f"largest_radius = {largest_radius} polygon diameters: must be at least the corner radius, "
            f"{corner_radius / size:.6g} of them, or no chain exists"
        )
    side = np.roll(points, -1, axis=0) - points
    phi = np.unwrap(np.arctan2(-side[:, 0], side[:, 1]))
    normal = _normals(phi)
    distance = np.sum(normal * points, axis=1)
    breaks = _break_angles(phi, side_half_width, arcs_per_corner)
    least = corner_radius / size
    radius = _fit_radii(breaks, arcs_per_corner + 1, normal, distance, least, largest_radius)
    if radius is None:
        inscribed = _inscribed_radius(normal, distance)
        raise ValueError(
            f"corner_radius = {corner_radius}: too large for the polygon, at most {inscribed * size:.6g} fits"
        )
    return arc_chain(breaks, radius if normalise else size * radius, name=name, normalise=normalise)


def _convex_sides(vertices: ArrayLike) -> tuple[NDArray, float]:
    """Vertices (m, 2) of the polygon, counter-clockwise, about its centroid, over its equivalent diameter;
    and that diameter [L]. Sides that are a point and corners that are straight are dropped."""
    points = np.array(vertices, dtype=np.float64)
    if points.ndim == 2 and points.shape[1:] == (2,) and len(points) >= 3:
        a = points - points[0]
        if _cross(a, np.roll(a, -1, axis=0)).sum() < 0:
            points = points[::-1]
    measures = polygon_measures(points)
    points = (points - measures.centroid) / measures.diameter
    points = points[np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1) > SHORT_SIDE]
    turn = _turns(points)
    if np.any(turn < -LEAST_TURN) or abs(turn.sum() - 2 * np.pi) > 1e-6:
        raise ValueError(
            f"vertices turn by {turn} rad: a convex polygon never turns back and turns by 2 pi in all; "
            "cut other polygons into convex parts first"
        )
    return points[turn > LEAST_TURN], measures.diameter


def _turns(points: NDArray) -> NDArray:
    """Exterior angle at each vertex (k,) [rad]."""
    after = np.roll(points, -1, axis=0) - points
    before = points - np.roll(points, 1, axis=0)
    return np.arctan2(_cross(before, after), np.sum(before * after, axis=1))


def _inscribed_radius(normal: NDArray, distance: NDArray) -> float:
    """Radius of the greatest disc with n . x + r <= distance for every side."""
    rows = np.column_stack([normal, np.ones(len(normal))])
    answer = scipy.optimize.linprog([0, 0, -1], A_ub=rows, b_ub=distance, bounds=[(None, None)] * 2 + [(0, None)])
    return float(answer.x[2])


def _break_angles(phi: NDArray, half_width: float, arcs_per_corner: int) -> NDArray:
    """First normal angle of every arc: for each side its own arc, then those of the corner after it."""
    turn = np.diff(phi, append=phi[0] + 2 * np.pi)
    half = np.minimum(half_width, SIDE_SHARE * np.minimum(turn, np.roll(turn, 1)))
    first = phi + half
    step = (turn - half - np.roll(half, -1)) / arcs_per_corner
    corner = first[:, None] + step[:, None] * np.arange(arcs_per_corner)
    return np.column_stack([phi - half, corner]).ravel()


def _fit_radii(
    breaks: NDArray, arcs_per_side: int, normal: NDArray, distance: NDArray, least: float, most: float
) -> NDArray | None:
    """Radii (n,) of the longest chain in normal . x <= distance, None if none fits: see `from_polygon`."""
    seam = _normals(breaks)
    count = breaks.size
    step = np.roll(seam, -1, axis=0) - seam
    closure = np.hstack([np.zeros((2, 2)), step.T])
    support = np.zeros((len(normal), 2 + count))
    support[:, :2] = normal
    for k, n in enumerate(normal):
        own = k * arcs_per_side
        support[k, 2 : 2 + own] = step[:own] @ n
        support[k, 2 + own] = (n - seam[own]) @ n
    objective = np.concatenate([[0, 0], -np.diff(breaks, append=breaks[0] + 2 * np.pi)])
    answer = scipy.optimize.linprog(
        objective,
        A_ub=support,
        b_ub=distance,
        A_eq=closure,
        b_eq=[0, 0],
        bounds=[(None, None)] * 2 + [(least, most)] * count,
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if answer.status == 2:
        return None
    if answer.status != 0:
        raise RuntimeError(f"the linear programme of the fit failed: {answer.message}")
    return _close(np.clip(answer.x[2:], least, most), step, least, most)


def _close(radius: NDArray, step: NDArray, least: float, most: float) -> NDArray:
    """The radii, changed as little as closes the chain to rounding; the solver leaves it open by 1e-10."""
    radius = np.where(radius < least * (1 + 1e-9), least, radius)
    free = (radius > least) & (radius < most * (1 - 1e-9))
    if free.sum() >= 2:
        radius[free] -= np.linalg.lstsq(step[free].T, step.T @ radius, rcond=None)[0]
    return radius
