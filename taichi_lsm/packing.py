"""Start states of a sheared layer: sizes, positions and orientations of its grains, and its rough platens.

The cell is periodic in x (and in z in 3D); y, axis 1, points from the lower platen to the upper one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from .core.errors import InputError
from .shapes.input_checks import check_at_least, number_array

LOOSE_PITCH = 1.1  # least lattice pitch over the largest bounding diameter: space for jitter
CELL_SHARE = 0.98  # of the free space a grain has in its lattice cell: rounding can then make no two grains touch
PLATEN_JITTER = 0.25  # of the mean diameter, up and down
PLATEN_SPACING = 0.9  # of the mean diameter, between the columns of a 3D platen
TIGHT = 0.99  # of the bounds below which no grain passes a platen


def grain_diameters(rng: Generator, count: int, smallest: float, largest: float) -> NDArray:
    """Random diameters, uniform between two bounds.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the random numbers.
    count : int
        Number of diameters, >= 0.
    smallest, largest : float
        Bounds [m], 0 < smallest <= largest; if they are equal, so are all diameters.

    Returns
    -------
    ndarray, (count,)
        Diameters [m].

    Raises
    ------
    InputError
        Unless count >= 0 and 0 < smallest <= largest, both finite.
    """
    check_at_least("count", count, 0)
    _check_range(smallest, largest)
    return rng.uniform(smallest, largest, count) if largest > smallest else np.full(count, float(smallest))


def random_rotations(rng: Generator, count: int, dim: int) -> NDArray:
    """Random orientations, uniform over all rotations.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the random numbers.
    count : int
        Number of orientations, >= 0.
    dim : int
        2 or 3.

    Returns
    -------
    ndarray
        In 2D angles (count,) [rad] in [0, 2 pi), in 3D unit quaternions w, x, y, z (count, 4) from the body frame to
        the world frame.

    Raises
    ------
    InputError
        For another dim or count < 0.

    Notes
    -----
    A quaternion is a vector of four standard normal numbers over its length: that vector is isotropic, so its direction
    is uniform on the 3-sphere.
    """
    _check_dim(dim)
    check_at_least("count", count, 0)
    if dim == 2:
        return rng.uniform(0.0, 2 * np.pi, count)
    normal = rng.standard_normal((count, 4))
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def loose_packing(rng: Generator, bounding_radii: ArrayLike, lengths: Sequence[float], dim: int) -> NDArray:
    """Random positions of grains without overlap, filled from y = 0 upwards.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the random numbers.
    bounding_radii : array_like, (n,)
        Bounding radii of the grains [m], finite and > 0.
    lengths : sequence of float
        Periodic lengths [m], (Lx,) in 2D and (Lx, Lz) in 3D, at least twice the largest bounding diameter.
    dim : int
        2 or 3.

    Returns
    -------
    ndarray, (n, dim)
        Centres of mass [m] with 0 <= x < Lx, 0 <= z < Lz and every grain wholly above y = 0.

    Raises
    ------
    InputError
        For radii that are not > 0, or a length below twice the largest bounding diameter.

    Notes
    -----
    Every grain gets a cell of a lattice that suits the largest and a random position inside it, so no two bounding
    circles meet, nor across the periodic borders. Cells are filled from y = 0 upwards, in random order of the grains.
    """
    radius = number_array("bounding_radii", bounding_radii)
    if radius.ndim != 1 or not np.all((radius > 0) & np.isfinite(radius)):
        raise InputError(f"bounding_radii = {radius}: must be one-dimensional, finite and > 0")
    largest = 2 * radius.max(initial=0.0)
    periodic = _check_lengths(lengths, dim, largest)
    if radius.size == 0:
        return np.zeros((0, dim))
    # As many cells along the periodic axes as fit with the pitch, widened to fill the lengths.
    per_row = np.maximum(1, np.floor(periodic / (LOOSE_PITCH * largest))).astype(int)
    cell = np.empty(dim)
    cell[0], cell[1], cell[2:] = periodic[0] / per_row[0], LOOSE_PITCH * largest, periodic[1:] / per_row[1:]
    site = rng.permutation(radius.size)  # number of the cell of each grain: along x, then z, then y
    index = np.empty((radius.size, dim))
    index[:, 0] = site % per_row[0]
    if dim == 3:
        index[:, 2] = site // per_row[0] % per_row[1]
    index[:, 1] = site // per_row.prod()
    jitter = CELL_SHARE * (0.5 * cell - radius[:, None])
    return (index + 0.5) * cell + jitter * rng.uniform(-1.0, 1.0, index.shape)


def rough_platen(
    rng: Generator, smallest: float, largest: float, lengths: Sequence[float], dim: int
) -> tuple[NDArray, NDArray]:
    """A layer of glued discs or spheres about y = 0, through which no grain falls.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the random numbers.
    smallest, largest : float
        Bounds of the diameters [m], 0 < smallest <= largest.
    lengths : sequence of float
        Periodic lengths [m], (Lx,) in 2D and (Lx, Lz) in 3D, at least twice the largest diameter.
    dim : int
        2 or 3.

    Returns
    -------
    position : ndarray, (m, dim)
        Centres of the glued grains [m].
    diameter : ndarray, (m,)
        Their diameters [m].

    Raises
    ------
    InputError
        For a length below twice the largest diameter, and unless 0 < smallest <= largest.

    Notes
    -----
    2D: a row of neighbours that touch in projection on x, diameters uniform in the range and then rescaled by a few per
    cent to fill Lx. 3D: a near-square lattice in x and z with a spacing of about 0.9 mean diameters. Both are jittered
    in y by up to a quarter of the mean diameter. Glued grains may overlap: no force acts between them. No grain of
    diameter `smallest` or more passes: spacing and jitter shrink where the range of sizes is too wide.
    """
    _check_range(smallest, largest)
    periodic = _check_lengths(lengths, dim, largest)
    mean = 0.5 * (smallest + largest)
    if dim == 2:
        diameter = _diameters_filling(rng, smallest, largest, periodic[0])
        x = np.cumsum(diameter) - 0.5 * diameter
        # Neighbours a and b, 2 A apart in y at most: the gap sqrt((a + b)^2/4 + 4 A^2) - (a + b)/2 is widest
        # between the smallest, and below `smallest` if 4 A^2 < smallest (smallest + 2 d_min).
        safe = 0.5 * np.sqrt(smallest * (smallest + 2 * diameter.min()))
        amplitude = min(PLATEN_JITTER * mean, TIGHT * safe)
        return np.column_stack([x, amplitude * rng.uniform(-1.0, 1.0, x.size)]), diameter
    # A surface through the lattice points, triangle by triangle, lies within sqrt(spacing^2/2 + A^2) of a
    # vertex (weighted mean of the squared distances). A grain whose centre must stay `smallest` away from
    # every vertex cannot cross it if that is below `smallest`.
    reach = mean * np.hypot(PLATEN_SPACING / np.sqrt(2), PLATEN_JITTER)
    shrink = min(1.0, TIGHT * smallest / reach)
    columns = np.ceil(periodic / (shrink * PLATEN_SPACING * mean)).astype(int)
    i, k = (axis.ravel() for axis in np.meshgrid(*map(np.arange, columns), indexing="ij"))
    height = shrink * PLATEN_JITTER * mean * rng.uniform(-1.0, 1.0, i.size)
    x, z = (i + 0.5) * periodic[0] / columns[0], (k + 0.5) * periodic[1] / columns[1]
    return np.column_stack([x, height, z]), grain_diameters(rng, i.size, smallest, largest)


def _diameters_filling(rng: Generator, smallest: float, largest: float, length: float) -> NDArray:
    """Random diameters, rescaled to sum to length: the whole row changes by at most half a grain."""
    drawn = grain_diameters(rng, int(np.ceil(length / smallest)) + 1, smallest, largest)
    total = np.cumsum(drawn)
    count = int(np.argmin(np.abs(total - length))) + 1
    return drawn[:count] * (length / total[count - 1])


def _check_range(smallest: float, largest: float) -> None:
    """Refuse bounds of the diameters that are no range of positive numbers."""
    if not (0 < smallest <= largest and np.isfinite(largest)):
        raise InputError(f"smallest = {smallest}, largest = {largest}: must be 0 < smallest <= largest, finite")


def _check_dim(dim: int) -> None:
    """Refuse a dimension that is neither 2 nor 3."""
    if dim not in (2, 3):
        raise InputError(f"dim = {dim}: must be 2 or 3")


def _check_lengths(lengths: Sequence[float], dim: int, largest_diameter: float) -> NDArray:
    """Periodic lengths (dim - 1,) [m], refused below two diameters: a grain could touch two images of another."""
    _check_dim(dim)
    periodic = number_array("lengths", lengths)
    if periodic.shape != (dim - 1,) or not np.all(np.isfinite(periodic)):
        raise InputError(f"lengths = {lengths}: must be {'(Lx,)' if dim == 2 else '(Lx, Lz)'} in {dim}D, finite")
    if np.any(periodic < 2 * largest_diameter) or np.any(periodic <= 0):
        raise InputError(
            f"lengths = {lengths}: must be at least twice the largest diameter, {2 * largest_diameter:.6g}"
        )
    return periodic
