"""Dense start of a sheared layer: grains of any outline between two platens, moved apart until none overlaps.

The cell is periodic in x (and in z in 3D); y, axis 1, points from the lower platen to the upper one.

Grains begin at random points, whatever their overlap. Two of them are apart if a plane square to the line of their
centres lies between them: the gap |x_j - x_i| - h_i(n) - h_j(-n) is positive, n along that line, h the support
functions. Where the gap is below a slack both grains are moved along n, with momentum. In effect the sum of the squares
of overlaps is minimised, as for frictionless grains (O'Hern, Silbert, Liu and Nagel 2003). Whenever PATIENCE iterations
were not enough, the layer is stretched by 1 %. Discs and spheres get near their random close packing; angular grains,
which are not turned, stay further apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from .core.errors import InputError
from .shapes.base import Balls
from .shapes.input_checks import check_positive

SLACK = 0.005  # of the distance at which two grains touch: they are moved apart by as much more
STEP = 0.2  # share of an overlap by which each of the two grains moves in an iteration
MOMENTUM = 0.8  # share of the last displacement that is repeated
PATIENCE = 50  # iterations before the height is raised
STRETCH = 1.01  # factor of the height
MOST_STRETCHES = 120  # to more than three times the first height
SKIN = 0.4  # of the mean bounding radius; neighbours are listed anew when a grain has moved by half of it

Spheres = tuple[NDArray, NDArray]  # centres (m, dim) and diameters (m,) [m] of the grains of a platen


class Hulls(NamedTuple):
    """Grains as hulls of balls, n of them.

    Attributes
    ----------
    balls
        Of each kind of grain the balls that span it, body frame, see `GrainShape.spanning_balls`.
    kind
        Row of `balls` of each grain (n,).
    diameter
        Equivalent diameters (n,) [m].
    rotation
        Rotation matrices (n, dim, dim) from the body frame to the world frame.
    """

    balls: Sequence[Balls]
    kind: NDArray
    diameter: NDArray
    rotation: NDArray

    def reach(self) -> NDArray:
        """Greatest distance of each surface from the origin (n,) [m]."""
        farthest = [(np.linalg.norm(centre, axis=1) + radius).max() for centre, radius in self.balls]
        return np.array(farthest)[self.kind] * self.diameter

    def support(self, grain: NDArray, normal: NDArray) -> NDArray:
        """Support function h(n) = max over the balls of c . n + r, of grains (k,) along world normals (k, dim) [m]."""
        body = _products(self.rotation[grain].transpose(1, 0, 2), normal)  # R^T n
        kind, result = self.kind[grain], np.zeros(len(grain))
        order = np.argsort(kind, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(kind[order])) + 1):
            if rows.size:
                centre, radius = self.balls[int(kind[rows[0]])]
                result[rows] = (_products(centre.T[:, None], body[rows]) + radius).max(axis=1)
        return result * self.diameter[grain]


def dense_packing(
    rng: Generator,
    balls: Sequence[Balls],
    kind: ArrayLike,
    diameter: ArrayLike,
    rotation: ArrayLike,
    lengths: Sequence[float],
    platens: tuple[Spheres, Spheres],
    height: float,
) -> tuple[NDArray, float]:
    """Random positions of grains without overlap in a layer that is about as dense as grains can be packed.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the random numbers.
    balls : sequence of (ndarray (k, dim), ndarray (k,))
        Of each kind of grain the centres and radii of balls that span it [diameter], see `GrainShape.spanning_balls`.
    kind : array_like of int, (n,)
        Row of `balls` of each grain.
    diameter : array_like, (n,)
        Equivalent diameters [m].
    rotation : array_like
        Orientations, as of `random_rotations`: angles (n,) [rad] in 2D, unit quaternions (n, 4) in 3D.
    lengths : sequence of float
        Periodic lengths [m], (Lx,) in 2D and (Lx, Lz) in 3D, at least twice the largest bounding diameter.
    platens : two pairs (ndarray (m, dim), ndarray (m,))
        Centres and diameters [m] of the grains of the lower and of the upper platen, as of `rough_platen`, each with
        its inner plane at y = 0.
    height : float
        Distance of the two planes to begin with [m], > 0. A layer that is too dense at first is no fault.

    Returns
    -------
    position : ndarray, (n, dim)
        Origins of the body frames [m], not wrapped in x and z.
    height : float
        Height [m] by which the upper platen has to be raised: as given, or the least at which a packing was found.

    Raises
    ------
    InputError
        For a height that is not > 0, or if no packing is found at three times the height.
    """
    check_positive("height", height)
    grains = Hulls(balls, np.asarray(kind), np.asarray(diameter, float), _matrices(np.asarray(rotation, float)))
    (low, low_size), (high, high_size) = platens
    n, dim = len(grains.kind), low.shape[1]
    period = np.array([lengths[0], 0.0, *lengths[1:]])
    start = rng.uniform(0.0, 1.0, (n, dim)) * np.where(period > 0, period, height)
    radius = np.concatenate([grains.reach(), 0.5 * low_size, 0.5 * high_size])
    x = np.concatenate([start, low, high + height * np.eye(dim)[1]])
    layer = _Layer(grains, period, radius, x, n + len(low), height)
    for _ in range(MOST_STRETCHES):
        if layer.relax(PATIENCE):
            return layer.x[:n], layer.height
        layer.stretch(STRETCH)
    raise InputError(
        f"height = {height:g} m: no packing without overlap was found up to {layer.height:g} m; are the periodic "
        f"lengths, {lengths}, too small for the grains?"
    )


class _Layer:
    """Grains between two platens while they are moved apart.

    Parameters
    ----------
    grains
        The n mobile grains.
    period
        Periodic lengths (dim,) [m], 0 along y.
    radius, x
        Bounding radii (m,) and places (m, dim) [m], first of the mobile grains, then of those of the platens.
    top
        First row of the upper platen.
    height
        Height of its inner plane over that of the lower one [m].
    """

    def __init__(self, grains: Hulls, period: NDArray, radius: NDArray, x: NDArray, top: int, height: float) -> None:
        self.grains, self.period, self.radius, self.x, self.top, self.height = grains, period, radius, x, top, height
        self.n = len(grains.kind)
        self.skin = SKIN * float(radius.mean())
        self.displacement = np.zeros((self.n, x.shape[1]))
        self.listed, self.pairs = np.full_like(x, np.inf), np.zeros((0, 2), int)

    def relax(self, iterations: int) -> bool:
        """Move overlapping grains apart; whether after at most so many iterations no two overlap."""
        for _ in range(iterations):
            if not np.abs(self.x - self.listed).max() < 0.5 * self.skin / np.sqrt(len(self.period)):
                self.pairs, self.listed = self._neighbours(), self.x.copy()
            (i, j), normal, gap, touch = self._gaps()
            if np.all(gap > 0.0):
                return True
            push = np.maximum(0.0, SLACK * touch - gap)[:, None] * normal
            for a in range(len(self.period)):
                away = np.bincount(j, push[:, a], len(self.x)) - np.bincount(i, push[:, a], len(self.x))
                self.displacement[:, a] = MOMENTUM * self.displacement[:, a] + STEP * away[: self.n]
            self.x[: self.n] += self.displacement
            # Grains of the platens have their centres outside the layer, so that they push inward what stays inside.
            self.x[: self.n, 1] = np.clip(self.x[: self.n, 1], 0.0, self.height)
        return False

    def stretch(self, factor: float) -> None:
        """Raise the upper platen, and all grains in proportion."""
        self.x[: self.n, 1] *= factor
        self.x[self.top :, 1] += (factor - 1.0) * self.height
        self.height *= factor

    def _gaps(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Pairs (2, k) near each other, normals (k, dim), gaps along them (k,) and distances of touch (k,) [m]."""
        apart = self._apart(self.pairs)
        distance = np.sqrt((apart**2).sum(axis=1))
        near = distance < (1.0 + SLACK) * self.radius[self.pairs].sum(axis=1)
        (i, j), distance = self.pairs[near].T, distance[near]
        normal = apart[near] / np.maximum(distance, 1e-300)[:, None]
        touch, mobile = self.radius[j], j < self.n
        touch[mobile] = self.grains.support(j[mobile], -normal[mobile])
        touch += self.grains.support(i, normal)
        return np.stack([i, j]), normal, distance - touch, touch

    def _neighbours(self) -> NDArray:
        """Pairs (k, 2) of a mobile grain and another one whose bounding spheres are nearer than the skin, in order."""
        side, reach = np.where(self.period > 0, self.period, 1.0), (1.0 + SLACK) * self.radius
        inside = np.where(self.period > 0, self.x % side % side, self.x)  # twice: -1e-20 % side is the side itself
        farthest = 2.0 * float(reach.max()) + self.skin
        pairs = np.sort(KDTree(inside, boxsize=self.period).query_pairs(farthest, output_type="ndarray"), axis=1)
        near = (self._apart(pairs) ** 2).sum(axis=1) < (reach[pairs].sum(axis=1) + self.skin) ** 2
        pairs = pairs[near & (pairs[:, 0] < self.n)]
        return pairs[np.lexsort(pairs.T[::-1])]

    def _apart(self, pairs: NDArray) -> NDArray:
        """Vectors (k, dim) from the first to the nearest image of the second of each pair [m]."""
        apart = self.x[pairs[:, 1]] - self.x[pairs[:, 0]]
        return apart - self.period * np.round(apart / np.where(self.period > 0, self.period, 1.0))


def _products(columns: NDArray, vectors: NDArray) -> NDArray:
    """Scalar products (k, m): sum over a of columns[a] (k or 1, m) times component a of the vectors (k, dim).

    One component after the other: the order, and so the bits, depend on no library of linear algebra.
    """
    total = columns[0] * vectors[:, 0, None]
    for a in range(1, len(columns)):
        total += columns[a] * vectors[:, a, None]
    return total


def _matrices(rotation: NDArray) -> NDArray:
    """Rotation matrices (n, dim, dim) of angles (n,) or of quaternions w, x, y, z (n, 4)."""
    if rotation.ndim == 1:
        c, s = np.cos(rotation), np.sin(rotation)
        return np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    return Rotation.from_quat(rotation, scalar_first=True).as_matrix()
