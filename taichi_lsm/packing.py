"""Start states of a sheared layer: sizes, places and orientations of its grains, and its rough platens.

The cell is periodic in x (and in z in 3D); y, axis 1, points from the lower platen to the upper one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

LOOSE_PITCH = 1.1  # least lattice pitch over the largest bounding diameter: room for jitter
CELL_SHARE = 0.98  # of the play a grain has in its lattice cell: rounding can then make no two grains touch
PLATEN_JITTER = 0.25  # of the mean diameter, up and down
PLATEN_SPACING = 0.9  # of the mean diameter, between the columns of a 3D platen
TIGHT = 0.99  # of the bounds below which no grain passes a platen


def grain_diameters(rng: Generator, count: int, smallest: float, largest: float) -> NDArray:
    """Diameters (count,) [m], uniform between smallest and largest; all equal if these are equal.

    Raises ValueError unless count >= 0 and 0 < smallest <= largest.
    """
    if count < 0:
        raise ValueError(f"count = {count}: must be >= 0")
    _check_range(smallest, largest)
    return rng.uniform(smallest, largest, count) if largest > smallest else np.full(count, float(smallest))


def random_rotations(rng: Generator, count: int, dim: int) -> NDArray:
    """Uniform orientations: angles (count,) [rad] in [0, 2 pi) in 2D, unit quaternions wxyz (count, 4) in 3D.

    Raises ValueError for another dim or count < 0.
    """
    _check_dim(dim)
    if count < 0:
        raise ValueError(f"count = {count}: must be >= 0")
    if dim == 2:
        return rng.uniform(0.0, 2 * np.pi, count)
    normal = rng.standard_normal((count, 4))  # isotropic, so its direction is uniform on the 3-sphere
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def loose_packing(rng: Generator, bounding_radii: ArrayLike, lengths: Sequence[float], dim: int) -> NDArray:
    """Places (n, dim) [m] of grains with bounding radii (n,) [m], free of overlap and wholly above y = 0.

    lengths [m]: periodic lengths, (Lx,) in 2D and (Lx, Lz) in 3D; 0 <= x < Lx and 0 <= z < Lz. Every grain
    gets a cell of a lattice that suits the largest and a random place inside it, so no two bounding circles
    meet, nor across the periodic borders. Cells are filled from y = 0 upwards, in random order of the grains.
    Raises ValueError for radii that are not > 0 or a length below twice the largest bounding diameter.
    """
    radius = np.array(bounding_radii, dtype=np.float64)
    if radius.ndim != 1 or not np.all((radius > 0) & np.isfinite(radius)):
        raise ValueError(f"bounding_radii = {radius}: must be one-dimensional, finite and > 0")
    largest = 2 * radius.max(initial=0.0)
    periodic = _check_lengths(lengths, dim, largest)
    if radius.size == 0:
        return np.zeros((0, dim))
    per_row = np.maximum(1, np.floor(periodic / (LOOSE_PITCH * largest))).astype(int)
    cell = np.empty(dim)
    cell[0], cell[1], cell[2:] = periodic[0] / per_row[0], LOOSE_PITCH * largest, periodic[1:] / per_row[1:]
    site = rng.permutation(radius.size)
    index = np.empty((radius.size, dim))
    index[:, 0] = site % per_row[0]
    if dim == 3:
        index[:, 2] = site // per_row[0] % per_row[1]
    index[:, 1] = site // per_row.prod()
    play = CELL_SHARE * (0.5 * cell - radius[:, None])
    return (index + 0.5) * cell + play * rng.uniform(-1.0, 1.0, index.shape)


def rough_platen(
    rng: Generator, smallest: float, largest: float, lengths: Sequence[float], dim: int
) -> tuple[NDArray, NDArray]:
    """A layer of glued discs or spheres about y = 0: places (m, dim) [m] and diameters (m,) [m].

    2D: a row of neighbours that touch in projection on x, diameters uniform in the range and then rescaled by
    a few per cent to fill Lx. 3D: a near-square lattice in x and z with a spacing of about 0.9 mean
    diameters. Both are jittered in y by up to a quarter of the mean diameter. Glued grains may overlap: they
    never touch each other. No grain of diameter `smallest` or more passes: spacing and jitter shrink where
    the range of sizes is too wide.
    lengths as in `loose_packing`; raises ValueError like it, and unless 0 < smallest <= largest.
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
    if not (0 < smallest <= largest and np.isfinite(largest)):
        raise ValueError(f"smallest = {smallest}, largest = {largest}: must be 0 < smallest <= largest, finite")


def _check_dim(dim: int) -> None:
    if dim not in (2, 3):
        raise ValueError(f"dim = {dim}: must be 2 or 3")


def _check_lengths(lengths: Sequence[float], dim: int, largest_diameter: float) -> NDArray:
    """Periodic lengths (dim - 1,) [m]; below two diameters a grain could meet two images of another."""
    _check_dim(dim)
    periodic = np.array(lengths, dtype=np.float64)
    if periodic.shape != (dim - 1,) or not np.all(np.isfinite(periodic)):
        raise ValueError(f"lengths = {lengths}: must be {'(Lx,)' if dim == 2 else '(Lx, Lz)'} in {dim}D, finite")
    if np.any(periodic < 2 * largest_diameter) or np.any(periodic <= 0):
        raise ValueError(
            f"lengths = {lengths}: must be at least twice the largest diameter, {2 * largest_diameter:.6g}"
        )
    return periodic
