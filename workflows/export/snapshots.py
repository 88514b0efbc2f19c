"""Snapshots of a grains.nc, one at a time, as all formats need them: three components, positions within the cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm

if TYPE_CHECKING:
    import xarray


class Cell(NamedTuple):
    """The box that a snapshot lies in.

    Attributes
    ----------
    matrix : ndarray, (3, 3)
        Its edges as columns [m], upper triangular.
    origin : ndarray, (3,)
        Its lowest corner [m].
    periodic : ndarray of bool, (3,)
        Along which edges it repeats. Along others it just holds all grains; along z in 2D it is one grain wide.
    """

    matrix: NDArray
    origin: NDArray
    periodic: NDArray


@dataclass(frozen=True)
class Frame:
    """The grains of one snapshot whose position is known; lengths in m, axes of the world frame.

    Attributes
    ----------
    number : int
        Place of the snapshot in the file, from 0 on.
    step : int
        Its time over the time step.
    time : float
        [s].
    dim : int
        2 or 3; what 2D lacks is 0 below.
    dataset : xarray.Dataset
        The snapshot itself, with positions as they are on file.
    cell : Cell
        Box of the snapshot.
    grain : ndarray of int, (n,)
        Persistent ids.
    position : ndarray, (n, 3)
        Centres of mass, within the cell along its periodic edges.
    image : ndarray of int, (n, 3)
        Edges of the cell by which the position on file lies farther.
    velocity, angular_velocity : ndarray, (n, 3)
        [m/s], [rad/s]; velocities in a sheared cell are those of the image within it.
    orientation : ndarray, (n, 4)
        Unit quaternions w, x, y, z.
    """

    number: int
    step: int
    time: float
    dim: int
    dataset: xarray.Dataset
    cell: Cell
    grain: NDArray
    position: NDArray
    image: NDArray
    velocity: NDArray
    angular_velocity: NDArray
    orientation: NDArray

    @property
    def speed(self) -> NDArray:
        """Magnitudes of the velocities (n,) [m/s]."""
        return np.linalg.norm(self.velocity, axis=1)

    def constant(self, name: str) -> NDArray:
        """What does not change of these grains, such as mass or kind."""
        return self.dataset[name].values


class Snapshots:
    """Those snapshots of a grains.nc that are wanted; each is read when it is its turn.

    Parameters
    ----------
    dataset
        The file, as `lsm.opened_run` gives it.
    numbers
        Places of the snapshots in it.
    """

    def __init__(self, dataset: xarray.Dataset, numbers: NDArray) -> None:
        self.dataset, self.numbers = dataset, numbers
        self.outlines = lsm.GrainOutlines(dataset)
        self.dim = int(dataset.sizes["space"])
        self.digits = len(str(dataset.sizes["time"] - 1))

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(int(number)) for number in self.numbers)

    def frame(self, number: int) -> Frame:
        """The snapshot at a place in the file; InputError if no grain of it is anywhere."""
        now = self.dataset.isel(time=number).load()
        grain = np.flatnonzero(np.isfinite(now.position.values).all(axis=1))  # a run that failed may have lost some
        if not grain.size:
            raise lsm.InputError(f"snapshot {number}: no grain has a finite position; leave it out by --times")
        now = now.isel(grain=grain)
        count, time = len(grain), float(now.time)
        place = in_space(now.position.values)
        cell = _cell(now, place)
        share = np.linalg.solve(cell.matrix, (place - cell.origin).T).T
        image = np.where(cell.periodic, np.floor(share), 0.0).astype(int)
        velocity = in_space(now.velocity.values)
        if "cell_shear_rate" in now:
            velocity[:, 0] -= image[:, 1] * float(now.cell_shear_rate) * float(now.cell_height)
        turning = now.angular_velocity.values if "angular_velocity" in now else np.zeros(count)
        orientation = now.orientation.values if "orientation" in now else np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
        dt = float(self.dataset.attrs.get("dt", np.nan))
        return Frame(
            number=number,
            step=round(time / dt) if dt > 0.0 else number,
            time=time,
            dim=self.dim,
            dataset=now,
            cell=cell,
            grain=grain,
            position=place - image @ cell.matrix.T,
            image=image,
            velocity=velocity,
            angular_velocity=np.outer(turning, (0.0, 0.0, 1.0)) if turning.ndim == 1 else turning,
            orientation=orientation,
        )


def in_space(vectors: NDArray) -> NDArray:
    """Vectors (n, 3) of vectors (n, dim)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def _cell(now: xarray.Dataset, place: NDArray) -> Cell:
    """The box of a snapshot whose grains are at these places (n, 3)."""
    reach = now.bounding_radius.values[:, None]
    low, high = (place - reach).min(axis=0), (place + reach).max(axis=0)
    cell = lsm.statistics.cell_of(now)
    matrix, block = np.diag(high - low), np.ix_(cell.axes, cell.axes)
    matrix[block] = cell.reduced[block]
    periodic = np.isin(np.arange(3), cell.axes)
    return Cell(matrix, np.where(periodic, 0.0, low), periodic)
