"""The cell of a snapshot, at rest or sheared, and pairs of grains across its periodic borders."""

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError

if TYPE_CHECKING:
    from xarray import Dataset

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
# Periodic axes by the number of periodic lengths in a file: a layer repeats along its width before its height.
PERIODIC = {2: {0: (), 1: (0,), 2: (0, 1)}, 3: {0: (), 1: (0,), 2: (0, 2), 3: (0, 1, 2)}}


class Cell(NamedTuple):
    """Periods of a snapshot, after Lees & Edwards (1972) where it is sheared.

    Parameters
    ----------
    axes
        Its periodic axes.
    edges
        (D, D) its edges as columns [m]: a grain has images at all sums of these, along periodic axes. The one along y
        is shifted along x by what the cell was sheared since the start, not reduced to the cell. 1 m along open axes.
    shear_rate
        [s-1]: by so much times its height an image above is faster along x.
    """

    axes: tuple[int, ...]
    edges: Array
    shear_rate: float

    @property
    def turns(self) -> int:
        """Whole periods along x in the shift of the edge along y."""
        return round(self.edges[0, 1] / self.edges[0, 0]) if 1 in self.axes else 0

    @property
    def reduced(self) -> Array:
        """Edges of the same lattice whose shift is reduced to half a period: the most upright ones."""
        edges = self.edges.copy()
        edges[0, 1:2] -= self.turns * edges[0, 0]
        return edges

    def numbers(self, reduced: Integers) -> Integers:
        """Numbers (n, D) of the edges in a vector that has these numbers of the reduced edges."""
        numbers = reduced.copy()
        numbers[:, 0] -= self.turns * reduced[:, 1]
        return numbers


def cell_of(snapshot: "Dataset") -> Cell:
    """The cell of a snapshot of grains.nc or moment of contacts.nc; InputError if its lengths are not those of one."""
    dim = snapshot.sizes["space"]
    lengths = np.atleast_1d(np.asarray(snapshot.attrs.get("periodic_lengths", ()), float))
    if lengths.size not in PERIODIC[dim] or not np.all((lengths > 0.0) & np.isfinite(lengths)):
        raise InputError(f"periodic_lengths = {lengths}: must be at most {dim} lengths > 0 m")
    axes, edges, rate = PERIODIC[dim][lengths.size], np.eye(dim), 0.0
    edges[axes, axes] = lengths
    if "cell_height" in snapshot.variables:
        edges[1, 1], edges[0, 1] = float(snapshot.cell_height), float(snapshot.cell_shift)
        rate = float(snapshot.cell_shear_rate)
    return Cell(axes, edges, rate)


def into_cell(cell: Cell, position: Array) -> tuple[Array, Integers]:
    """Positions (n, D) [m] within the cell, and the numbers (n, D) of its reduced edges that were taken off."""
    edges, numbers = cell.reduced, np.zeros(position.shape, np.int64)
    share = np.linalg.solve(edges, position.T).T
    for axis in cell.axes:
        numbers[:, axis] = np.floor(share[:, axis])
    return position - numbers @ edges.T, numbers


def pairs_within(cell: Cell, position: Array, reach: float) -> tuple[Integers, Integers, Integers]:
    """All ordered pairs of grains whose centres are no farther than `reach` from each other, across borders too.

    Parameters
    ----------
    cell
        The cell.
    position
        (n, D) [m], within the cell or not.
    reach
        Distance [m] > 0, below the least width of the cell.

    Returns
    -------
    first, second : ndarray of int, (p,)
        Rows of the grains. Each pair appears in either order.
    image : ndarray of int, (p, D)
        Numbers of the edges by which the image of the second that is near lies farther than its position.

    Raises
    ------
    InputError
        If the reach is not below the width of the cell along each periodic axis.
    """
    from scipy.spatial import KDTree

    edges, inverse = cell.reduced, np.linalg.inv(cell.reduced)
    width = 1.0 / np.linalg.norm(inverse, axis=1)  # between opposite sides
    least = min((width[axis] for axis in cell.axes), default=np.inf)
    if not 0.0 < reach < least:
        raise InputError(f"cutoff = {reach:g} m: must be > 0 m and below the width of the cell, {least:g} m")
    inside, taken = into_cell(cell, position)
    share = inside @ inverse.T
    # Images beside the cell that are within reach of it stand beside the grains themselves.
    rows, shifts = [np.arange(len(position))], [np.zeros(position.shape, np.int64)]
    for shift in itertools.product(*((-1, 0, 1) if axis in cell.axes else (0,) for axis in range(len(edges)))):
        if any(shift):
            beside = np.asarray(shift)
            periodic = list(cell.axes)
            there = (share + beside)[:, periodic]
            margin = reach / width[periodic]
            near = np.flatnonzero(((there >= -margin) & (there <= 1.0 + margin)).all(axis=1))
            rows.append(near)
            shifts.append(np.broadcast_to(beside, (near.size, beside.size)))
    row, shift = np.concatenate(rows), np.concatenate(shifts)
    found = KDTree(inside[row] + shift @ edges.T).query_pairs(reach, output_type="ndarray")
    found = np.concatenate([found, found[:, ::-1]])
    found = found[found[:, 0] < len(position)]
    first, second = found[:, 0], row[found[:, 1]]
    return first, second, cell.numbers(shift[found[:, 1]] - taken[second] + taken[first])
