"""Closed chains of circular arcs with a continuous normal: construction, mass, and the fit to a polygon.

A chain is fixed by its break angles theta_i and radii r_i. Arc i turns the outward normal n from theta_i to theta_(i+1)
and moves the surface point by the integral of r_i (-sin, cos) dtheta = r_i (n_(i+1) - n_i), so the chain closes if the
sum of r_i (n_(i+1) - n_i) is 0. That is linear in the radii: the fit to a polygon is a linear programme.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError, SimulationError
from .arc_chain import CHAIN_TOLERANCE, ArcChain
from .geometry import cross_2d, deepest_point, unit_normals
from .input_checks import check_at_least, check_between, check_positive, number_array
from .voronoi_tiles import SHORT_SIDE, polygon_measures

# Gauss-Legendre on [-1, 1]. The integrands are trigonometric polynomials of degree 3 on arcs of less than pi; with 16
# nodes the remainder is below 1e-17 of the integrand. Closed forms would cancel on the narrow, flat arcs of the sides.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)

MOST_ARCS = 1000  # of a corner
LEAST_TURN = 1e-6  # rad: a corner that turns by less joins its two sides into one
LEAST_HALF_WIDTH = 1e-6  # [rad]; at 1e-7 grains are up to 2 % off, at 1e-8 anything may come out
SIDE_HALF_WIDTH = float(np.radians(3.0))  # by how much a side turns to either side of its normal
LARGEST_RADIUS = 10.0  # of an arc, in equivalent diameters, unless long sides need more
SPANNING_RADIUS = 11.65  # likewise: sides that need more than this get it
LARGEST_BULGE = 0.125  # of the width of the polygon: by how much a side may stand out
SIDE_SHARE = 0.25  # of a corner's angle: the most that the arc of a side may take from it


def arc_chain(breaks: ArrayLike, radii: ArrayLike, *, name: str = "arc chain", normalise: bool = True) -> ArcChain:
    """The closed convex chain whose arc i has radius radii[i] and normals from breaks[i] to breaks[i + 1].

    Parameters
    ----------
    breaks : array_like, (n,)
        Angles of the seams [rad], n >= 3, ascending, less than one turn from first to last, in steps below pi; the
        last arc ends at breaks[0] + 2 pi.
    radii : array_like, (n,)
        Radii of the arcs > 0, in any unit of length.
    name : str
        What pictures and files call the shape.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit of the radii is kept.

    Returns
    -------
    ArcChain
        The chain, moved to its centre of mass. Mass properties are exact to rounding.

    Raises
    ------
    InputError
        If angles or radii are not of this form or the chain stays open by more than 1e-9 of its size.

    Notes
    -----
    The chain closes if the sum of r_i (n_(i+1) - n_i) over its arcs is 0, n_i the normal at breaks[i].
    """
    breaks, radius, span, seam = _checked_arcs(breaks, radii)
    centre = np.zeros((radius.size, 2))
    centre[1:] = np.cumsum((radius[:-1] - radius[1:])[:, None] * seam[1:], axis=0)
    centre -= _area_and_moment(centre, radius, breaks, span)[1]
    area, residue, _ = _area_and_moment(centre, radius, breaks, span)
    centre -= residue  # the first shift, from far away, leaves its rounding
    factor = np.sqrt(0.25 * np.pi / area) if normalise else 1.0
    centre, radius = factor * centre, factor * radius
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


def _checked_arcs(breaks: ArrayLike, radii: ArrayLike) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Break angles, radii, spans (n,) and seams (n, 2) of arcs that are a closed chain; InputError for others."""
    breaks, radius = number_array("breaks", breaks), number_array("radii", radii)
    if breaks.ndim != 1 or breaks.size < 3 or radius.shape != breaks.shape:
        raise InputError(f"breaks and radii have shapes {breaks.shape}, {radius.shape}: must be (n,), n >= 3, both")
    if not np.all(np.isfinite(breaks)):
        raise InputError(f"breaks = {breaks}: must be finite")
    if not np.all((radius > 0) & np.isfinite(radius)):
        raise InputError(f"radii = {radius}: must be finite and > 0")
    span = np.diff(breaks, append=breaks[0] + 2 * np.pi)
    if np.any(span <= 0) or np.any(span >= np.pi):
        raise InputError(f"breaks turn by {span} rad: each step must be more than 0 and less than pi")
    seam = unit_normals(breaks)
    gap = float(np.linalg.norm(radius @ (np.roll(seam, -1, axis=0) - seam)))
    size = float(radius @ span) / np.pi
    if gap > CHAIN_TOLERANCE * size:
        raise InputError(f"radii leave the chain open by {gap:.3g}: must close to {CHAIN_TOLERANCE * size:.3g}")
    return breaks, radius, span, seam


def _area_and_moment(centre: NDArray, radius: NDArray, breaks: NDArray, span: NDArray) -> tuple[float, NDArray, float]:
    """Area, centroid (2,) and polar second moment about the origin, by the divergence theorem.

    With x = p + r n and ds = r dtheta: area = 1/2 int x.n ds, int x dA = 1/3 int x (x.n) ds,
    int |x|^2 dA = 1/4 int |x|^2 (x.n) ds.
    """
    angle = (breaks + 0.5 * span)[:, None] + 0.5 * span[:, None] * _NODES
    n = unit_normals(angle)
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
        """Which arcs hold the normal at their angle."""
        return np.mod(angle - breaks, 2 * np.pi) <= span

    n = unit_normals(breaks)
    bounding = np.linalg.norm(centre + radius[:, None] * n, axis=1).max()
    facing = within(towards)  # there x = p + r n is longest where n points along p
    if facing.any():
        bounding = max(bounding, (distance + radius)[facing].max())
    lever = np.abs(cross_2d(centre, n)).max()
    quarter = 0.5 * np.pi  # x cross n = p cross n is greatest where n is square to p
    square = within(towards + quarter) | within(towards - quarter)
    if square.any():
        lever = max(lever, distance[square].max())
    return float(bounding), float(lever)


def regular_disc_of_arcs(n: int) -> ArcChain:
    """The disc of diameter 1 cut into equal arcs, all centred at 0: contacts equal those of `disc`.

    Parameters
    ----------
    n : int
        Number of arcs, >= 3.

    Returns
    -------
    ArcChain
        The disc as a chain of n arcs.

    Raises
    ------
    InputError
        For fewer than 3 arcs.
    """
    check_at_least("n", n, 3, ", for arcs turn by less than pi")
    return ArcChain(
        name=f"disc of {n} arcs",
        dim=2,
        centre=np.zeros((n, 2)),
        radius=np.full(n, 0.5),
        seam=unit_normals(2 * np.pi / n * np.arange(n)),
        measure=np.pi / 4,
        inertia=np.array([np.pi / 32]),
        bounding_radius=0.5,
        overlap_limit=0.5,
        lever=0.0,
    )


def from_polygon(
    vertices: ArrayLike,
    corner_radius: float,
    side_half_width: float = SIDE_HALF_WIDTH,
    arcs_per_corner: int = 1,
    *,
    largest_radius: float | None = None,
    name: str = "rounded polygon",
    normalise: bool = True,
) -> ArcChain:
    """The arc chain of greatest perimeter inside a convex polygon, with no arc sharper than corner_radius.

    Parameters
    ----------
    vertices : array_like, (k, 2)
        Corners of a convex polygon in order, clockwise or counter-clockwise, in any unit of length L.
    corner_radius : float
        Least radius of an arc [L], > 0 and at most the inscribed radius of the polygon.
    side_half_width : float
        Each side gets one arc that turns by this angle [rad] to either side of its normal, above 0 and below pi/2;
        less beside blunt corners and where the side would bulge by more than an eighth of the width of the polygon.
        With 3 degrees, the default, extents are those of the polygon, but the area of a square is 2 % less and that of
        a box of 10 to 1 8 %, the inertia 4 % and 15 %; with 2e-4 all are within 1 %.
    arcs_per_corner : int
        Number of equal arcs of each corner, >= 1.
    largest_radius : float, optional
        Bound on the radius of every arc, in equivalent diameters of the polygon; a side that it cannot span is cut
        short. By default 10, whose cuts cost less than 1 % of the area, but what spans them for sides that need more
        than 11.65, which are those longer than 1.22 diameters if `side_half_width` is 3 degrees.
    name : str
        What pictures and files call the shape.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit L is kept.

    Returns
    -------
    ArcChain
        The chain, moved to its centre of mass.

    Raises
    ------
    InputError
        If the polygon is not convex or a parameter is out of the range it names.
    SimulationError
        If the solver of the linear programme fails.

    Notes
    -----
    Linear programme: maximise sum r_i dtheta_i over the first point and the radii, subject to closure, to the support
    h(side normal) <= side distance, and to corner_radius <= r_i <= largest_radius. A disc that fits is feasible, so
    the programme is feasible exactly for corner radii up to the inscribed radius of the polygon.

    An arc that spans a side of length L and turns by the angle a to either side of the normal has the radius
    L/(2 sin a), stands L tan(a/2)/2 behind its corners and leaves out L^2 tan(a/2)/6 of the area, nearly.
    """
    points, size, _ = _convex_sides(vertices)
    _check_fit(size, corner_radius, side_half_width, arcs_per_corner, largest_radius)
    breaks, radius, _ = _arcs_within(points, size, corner_radius, side_half_width, arcs_per_corner, largest_radius)
    return arc_chain(breaks, radius if normalise else size * radius, name=name, normalise=normalise)


def chain_and_centre(
    vertices: ArrayLike, corner_radius: float, arcs_per_corner: int, name: str, half_width: float = SIDE_HALF_WIDTH
) -> tuple[ArcChain, NDArray]:
    """As `from_polygon` in the unit of the vertices: (shape, where its centre of mass (2,) lies among them).

    half_width: its side_half_width.
    """
    points, size, middle = _convex_sides(vertices)
    _check_fit(size, corner_radius, half_width, arcs_per_corner, None)
    breaks, radius, first = _arcs_within(points, size, corner_radius, half_width, arcs_per_corner, None)
    chain = arc_chain(breaks, size * radius, name=name, normalise=False)
    start = chain.centre[0] + chain.radius[0] * chain.seam[0]
    return chain, middle + size * first - start


def _arcs_within(
    points: NDArray,
    size: float,
    corner_radius: float,
    side_half_width: float,
    arcs_per_corner: int,
    largest_radius: float | None,
) -> tuple[NDArray, NDArray, NDArray]:
    """Break angles [rad], radii (n,) and first point (2,) of the chain `from_polygon`; corners (k, 2) over `size`."""
    side = np.roll(points, -1, axis=0) - points
    phi = np.unwrap(np.arctan2(-side[:, 0], side[:, 1]))
    normal = unit_normals(phi)
    distance = np.sum(normal * points, axis=1)
    length, width = np.linalg.norm(side, axis=1), distance - (points @ normal.T).min(axis=0)
    flat = np.minimum(side_half_width, 2.0 * np.arctan(2.0 * LARGEST_BULGE * width / length))
    breaks, half = _break_angles(phi, flat, arcs_per_corner)
    most = np.full((len(phi), arcs_per_corner + 1), largest_radius or LARGEST_RADIUS)
    if largest_radius is None:
        most[:, 0] = _spanning_radii(length, half, side_half_width)
    fitted = _fit_radii(breaks, normal, distance, corner_radius / size, most)
    if fitted is None:
        _, inscribed = deepest_point(normal, distance)
        raise InputError(
            f"corner_radius = {corner_radius}: too large for the polygon, at most {inscribed * size:.6g} fits"
        )
    return breaks, *fitted


def check_side_half_width(side_half_width: float) -> None:
    """Refuse a half-width of the arcs of sides [rad] that is not below pi/2, or so small that rounding bends sides."""
    if not LEAST_HALF_WIDTH <= side_half_width < 0.5 * np.pi:
        raise InputError(f"side_half_width = {side_half_width}: must be >= {LEAST_HALF_WIDTH:g} and below pi/2 rad")


def _check_fit(
    size: float, corner_radius: float, side_half_width: float, arcs_per_corner: int, largest_radius: float | None
) -> None:
    """Refuse parameters of `from_polygon` out of range, for a polygon of equivalent diameter `size`."""
    check_side_half_width(side_half_width)
    check_between("arcs_per_corner", arcs_per_corner, 1, MOST_ARCS)
    check_positive("corner_radius", corner_radius)
    if largest_radius is not None and not corner_radius <= largest_radius * size:
        raise InputError(
            f"largest_radius = {largest_radius} polygon diameters: must be at least the corner radius, "
            f"{corner_radius / size:.6g} of them, or no chain exists"
        )


def _convex_sides(vertices: ArrayLike) -> tuple[NDArray, float, NDArray]:
    """Vertices (m, 2) of the polygon about its centroid, over its equivalent diameter; that diameter, the centroid [L].

    Counter-clockwise; sides that are a point and corners that are straight are dropped.
    """
    points = number_array("vertices", vertices)
    if points.ndim == 2 and points.shape[1:] == (2,) and len(points) >= 3:
        a = points - points[0]
        if cross_2d(a, np.roll(a, -1, axis=0)).sum() < 0:
            points = points[::-1]
    measures = polygon_measures(points)
    points = (points - measures.centroid) / measures.diameter
    points = points[np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1) > SHORT_SIDE]
    angle = _exterior_angles(points)
    if np.any(angle < -LEAST_TURN) or abs(angle.sum() - 2 * np.pi) > 1e-6:
        raise InputError(
            f"vertices turn by {angle} rad: a convex polygon never turns back and turns by 2 pi in all; "
            "cut other polygons into convex parts first"
        )
    return points[angle > LEAST_TURN], measures.diameter, np.asarray(measures.centroid)


def _exterior_angles(points: NDArray) -> NDArray:
    """Exterior angle at each vertex (k,) [rad]."""
    after = np.roll(points, -1, axis=0) - points
    before = points - np.roll(points, 1, axis=0)
    return np.arctan2(cross_2d(before, after), np.sum(before * after, axis=1))


def _spanning_radii(length: NDArray, half: NDArray, asked: float) -> NDArray:
    """Greatest radius of the arc of each side: LARGEST_RADIUS, or what spans a long one that turns by 2 half [rad].

    asked: the half-width without its reduction beside blunt corners, which decides what is long.
    """
    long = length > 2.0 * SPANNING_RADIUS * np.sin(asked)
    return np.where(long, np.maximum(LARGEST_RADIUS, length / (2.0 * np.sin(half))), LARGEST_RADIUS)


def _break_angles(phi: NDArray, half_width: NDArray, arcs_per_corner: int) -> tuple[NDArray, NDArray]:
    """First normal angle of every arc: for each side its own arc, then those of the corner after it.

    And the half-width of the arc of each side, which is less than asked beside blunt corners.
    """
    angle = np.diff(phi, append=phi[0] + 2 * np.pi)  # of the corner after each side
    half = np.minimum(half_width, SIDE_SHARE * np.minimum(angle, np.roll(angle, 1)))
    side_end = phi + half
    step = (angle - half - np.roll(half, -1)) / arcs_per_corner
    corner = side_end[:, None] + step[:, None] * np.arange(arcs_per_corner)
    return np.column_stack([phi - half, corner]).ravel(), half


def _fit_radii(
    breaks: NDArray, normal: NDArray, distance: NDArray, least: float, most: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Radii (n,) and first point (2,) of the longest chain in normal . x <= distance, None if none: `from_polygon`.

    most (sides, arcs per side): greatest radius of each arc, first that of the side.
    """
    arcs_per_side, most = most.shape[1], most.ravel()
    seam = unit_normals(breaks)
    count = breaks.size
    step = np.roll(seam, -1, axis=0) - seam
    closure = np.hstack([np.zeros((2, 2)), step.T])
    # Unknowns: the first point x_0 and the radii. The support at a side's normal n, which lies within the arc `own`, is
    # x_0 . n + sum over the arcs before it of r_i (n_(i+1) - n_i) . n + r_own (n - n_own) . n.
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
        bounds=[(None, None)] * 2 + [(least, m) for m in most],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if answer.status == 2:
        return None
    if answer.status != 0:
        raise SimulationError(f"the linear programme of the fit to the polygon failed: {answer.message}")
    return closed_radii(np.clip(answer.x[2:], least, most), step, least, most), answer.x[:2]


def closed_radii(radius: NDArray, step: NDArray, least: float, most: ArrayLike) -> NDArray:
    """The radii (n,), changed as little as closes the chain to rounding; a solver leaves it open by 1e-10.

    step (n, 2): n_(i+1) - n_i of every arc. Only radii off their bounds `least` and `most` change.
    """
    radius = np.where(radius < least * (1 + 1e-9), least, radius)
    free = (radius > least) & (radius < np.asarray(most) * (1 - 1e-9))
    if free.sum() >= 2:
        radius[free] -= np.linalg.lstsq(step[free].T, step.T @ radius, rcond=None)[0]
    return radius
