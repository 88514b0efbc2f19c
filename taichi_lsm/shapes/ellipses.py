"""Ellipses and superellipses as chains of arcs, and the fit of a chain to any support function (2D).

A chain is fixed by its break angles, its radii and its first point, and at every normal its support function
h(n) = max x . n is linear in radii and point: the fit is a least-squares problem with bounds on the radii. The support
function of a chain is a spline with a continuous slope, so that the error falls as the third power of the arcs. The
Hausdorff distance of two convex bodies is the greatest difference of their support functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import SimulationError
from .arc_chain import ArcChain
from .geometry import unit_normals
from .input_checks import check_at_least, check_between, check_corner_radius
from .polygon_fit import arc_chain, closed_radii

SAMPLES = 8  # normals per arc at which the support function is fitted
CLOSURE_WEIGHT = 1e4  # of the open end against one sample; what it leaves is removed afterwards
LARGEST_RADIUS = 10.0  # in equivalent diameters, unless a long body is flatter at its sides
FLATTER = 20.0  # radius of the sides of a superellipse over that of the ellipse of the same axes, at most
EXPONENTS = (1.2, 20.0)
GREATEST_ASPECT = 20.0
FEWEST_ARCS = 8
EVEN_SHARE = 0.5  # of the arcs go by angle alone against one that goes by the change of curvature
GRID = 4001  # normals of a quarter turn on which the change of curvature is measured


def superellipse_support(aspect: float, exponent: float, normals: ArrayLike) -> NDArray:
    """Support function (k,) at unit normals (k, 2) of |x/a|^p + |y/b|^p <= 1 with a/b = aspect and area pi/4.

    h(n) = (|a n_x|^q + |b n_y|^q)^(1/q) with 1/p + 1/q = 1. Unit: the equivalent diameter.
    """
    n = np.abs(np.asarray(normals, dtype=np.float64)) * _semi_axes(aspect, exponent)
    q = exponent / (exponent - 1.0)
    return np.sum(n**q, axis=1) ** (1.0 / q)


def _semi_axes(aspect: float, exponent: float) -> NDArray:
    """a, b [equivalent diameters] by the area 4 a b Gamma(1 + 1/p)^2 / Gamma(1 + 2/p) = pi/4."""
    area_over_ab = 4.0 * math.gamma(1.0 + 1.0 / exponent) ** 2 / math.gamma(1.0 + 2.0 / exponent)
    return np.sqrt(0.25 * np.pi / area_over_ab) * np.array([np.sqrt(aspect), 1.0 / np.sqrt(aspect)])


def ellipse(aspect: float, arcs: int = 30) -> ArcChain:
    """An ellipse as a chain of arcs, long axis along x.

    Parameters
    ----------
    aspect : float
        Ratio of the axes, 1 to 20.
    arcs : int
        Number of arcs, >= 8.

    Returns
    -------
    ArcChain
        Shape of equivalent diameter 1, body frame; no arc is sharper than the ellipse itself.

    Raises
    ------
    InputError
        If a value is out of range.
    SimulationError
        If the solver of the fit fails.

    Notes
    -----
    The error of the outline falls as arcs^-3.
    """
    _check(aspect, 2.0, arcs)
    a, b = _semi_axes(aspect, 2.0)
    return _oval(aspect, 2.0, arcs, b * b / a, f"ellipse {aspect:g} of {arcs} arcs")


def superellipse(aspect: float, exponent: float, arcs: int = 30, *, corner_radius: float = 0.02) -> ArcChain:
    """A superellipse |x/a|^p + |y/b|^p <= 1 as a chain of arcs, long axis along x.

    Parameters
    ----------
    aspect : float
        Ratio of the axes a/b, 1 to 20.
    exponent : float
        p, 1.2 to 20: above 2 the body nears a rectangle, below 2 a rhombus with sharp tips.
    arcs : int
        Number of arcs, >= 8.
    corner_radius : float
        Least radius of an arc in equivalent diameters of the superellipse, above 0 and below 0.5.

    Returns
    -------
    ArcChain
        Shape of equivalent diameter 1, body frame; with an exponent of 4 the aspect is within 3 % up to 20, of 60 arcs
        within 0.3 %.

    Raises
    ------
    InputError
        If a value is out of range.
    SimulationError
        If the solver of the fit fails.
    """
    _check(aspect, exponent, arcs)
    check_corner_radius(corner_radius)
    return _oval(aspect, exponent, arcs, corner_radius, f"superellipse {aspect:g} {exponent:g} of {arcs} arcs")


def _check(aspect: float, exponent: float, arcs: int) -> None:
    """Refuse an aspect, exponent or number of arcs out of range."""
    check_between("aspect", aspect, 1.0, GREATEST_ASPECT)
    check_between("exponent", exponent, *EXPONENTS)
    check_at_least("arcs", arcs, FEWEST_ARCS)


def _oval(aspect: float, exponent: float, arcs: int, least: float, name: str) -> ArcChain:
    """The chain of `arcs` arcs nearest to a superellipse, none sharper than `least`."""
    breaks = _oval_breaks(aspect, exponent, arcs)
    a, b = _semi_axes(aspect, exponent)
    most = max(LARGEST_RADIUS, FLATTER * a * a / b)
    radii, _ = fit_support(breaks, lambda n: superellipse_support(aspect, exponent, n), least, most)
    return arc_chain(breaks, radii, name=name)


def _oval_breaks(aspect: float, exponent: float, arcs: int) -> NDArray:
    """Break angles (arcs,) [rad], one arc about the long axis, symmetric as far as their number allows.

    A chain follows a body of curvature radius rho(theta) to |rho'| dtheta^3, so that the density |rho'|^(1/3) makes
    the error even; some even density keeps every arc below pi.
    """
    s = np.linspace(0.0, 1.0, GRID)
    angle = 0.5 * np.pi * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)  # dense at both axes, where rho' may be singular
    axes, q = _semi_axes(aspect, exponent), exponent / (exponent - 1.0)
    n = np.abs(unit_normals(angle))
    n[-1, 0] = 0.0  # which rounding leaves at 1e-17
    # Points of the outline, the gradient of the support function, whose distances over the angle between them are the
    # radii of curvature.
    y = n * axes
    x = axes * y ** (q - 1.0) * (np.sum(y**q, axis=1) ** (1.0 / q))[:, None] ** (1.0 - q)
    step = np.diff(angle)
    rho = np.linalg.norm(np.diff(x, axis=0), axis=1) / step
    change = np.abs(np.diff(rho)) ** (1.0 / 3.0) * (0.5 * (step[1:] + step[:-1])) ** (2.0 / 3.0)
    total = np.concatenate([[0.0, 0.0], np.cumsum(change)])
    total = np.append(0.5 * (total[1:] + total[:-1]), total[-1])
    even = EVEN_SHARE * (total[-1] + 0.1)  # the circle, where nothing changes, gets even arcs
    total += even * angle / (0.5 * np.pi)
    break_place = 4.0 * (np.arange(arcs) + 0.5) / arcs  # in quarter turns
    quarter = np.floor(break_place)
    # Every other quarter is mirrored.
    along = np.where(quarter % 2 == 0, break_place - quarter, quarter + 1.0 - break_place)
    within = np.interp(along * total[-1], total, angle)
    return np.where(quarter % 2 == 0, quarter * 0.5 * np.pi + within, (quarter + 1.0) * 0.5 * np.pi - within)


def fit_support(
    breaks: NDArray, support_function: Callable[[NDArray], ArrayLike], least: float, most: float
) -> tuple[NDArray, NDArray]:
    """Radii (n,) from `least` to `most` and first point (2,) of the chain nearest to a convex body.

    breaks (n,) [rad] as for `arc_chain`; support_function from unit normals (k, 2) to (k,), in any unit L. Least
    squares of the support function over normals even within each arc, the chain closed to rounding; unique, hence as
    symmetric as body and breaks. All lengths in L. SimulationError if the solver fails.
    """
    count = breaks.size
    span = np.diff(breaks, append=breaks[0] + 2.0 * np.pi)
    seam = unit_normals(breaks)
    step = np.roll(seam, -1, axis=0) - seam
    arc = np.repeat(np.arange(count), SAMPLES)
    n = unit_normals(breaks[arc] + span[arc] * np.tile((np.arange(SAMPLES) + 0.5) / SAMPLES, count))
    # Row of a normal n within arc j: h(n) = x_0 . n + sum over i < j of r_i (n_(i+1) - n_i) . n + r_j (n - n_j) . n.
    rows = np.hstack([n, np.where(np.arange(count) < arc[:, None], n @ step.T, 0.0)])
    rows[np.arange(arc.size), 2 + arc] = np.sum((n - seam[arc]) * n, axis=1)
    closure = CLOSURE_WEIGHT * np.hstack([np.zeros((2, 2)), step.T])
    low, high = np.full(2 + count, -np.inf), np.full(2 + count, np.inf)
    low[2:], high[2:] = least, most
    target = np.concatenate([np.asarray(support_function(n), dtype=np.float64), np.zeros(2)])
    system = np.vstack([rows, closure])
    answer = scipy.optimize.lsq_linear(system, target, (low, high), method="bvls", max_iter=20 * count)
    if not answer.success:
        raise SimulationError(f"the least-squares fit of {count} arcs failed: {answer.message}")
    return closed_radii(np.clip(answer.x[2:], least, most), step, least, most), answer.x[:2]
