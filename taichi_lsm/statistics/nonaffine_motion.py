"""D2min: how far the grains around a grain have moved off a common linear deformation."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .cell_images import cell_of, pairs_within
from .run_parts import nearest, part_of

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

Array = npt.NDArray[np.float64]
REACH = 2.5  # mean diameters
FLAT = 1e-10  # least over greatest second moment of neighbours that span the space


def d2min(grains: "Run", first: float, last: float | None = None, cutoff: float | None = None) -> "Dataset":
    """Non-affine squared displacement of the neighbours of every grain between two snapshots.

    D2min_k = min over F of sum over l of |r_l(t) - r_k(t) - F (r_l(0) - r_k(0))|^2                          (1)
    with the neighbours l whose centres were within the cutoff of that of k in the first snapshot. The best deformation
    gradient is F = W V^-1, W = sum r_kl(t) r_kl(0), V = sum r_kl(0) r_kl(0), r_kl = r_l - r_k                 (2)

    Parameters
    ----------
    grains
        The tree of a run, or its grains.nc with at least two snapshots.
    first, last
        Times [s]; the nearest snapshots are taken, for `last` the last one by default. Strains of some per cent in
        between tell single rearrangements.
    cutoff
        Distance [m] > 0, by default 2.5 mean diameters, the range that Falk & Langer took; in a periodic cell below its
        width.

    Returns
    -------
    xarray.Dataset
        Along grain: d2min [m2], neighbour_count, deformation_gradient (grain, space, reference) [1], and glued. Values
        are nan where neighbours do not span the space: fewer than 2 (3 in 3D), or all in one line (plane).

    Raises
    ------
    InputError
        If the snapshots are the same, a time is not a number, or the cutoff does not fit the cell.

    Notes
    -----
    (1) is the sum as Falk & Langer wrote it, not divided by the number of neighbours, as OVITO's `AtomicStrainModifier`
    gives it; `d2min/neighbour_count` is the mean. Displacements are those of positions that are not wrapped, so that a
    grain may cross any number of borders; in a sheared cell images move with the shear. Grains glued to platens count
    as neighbours. Grains that rotate without moving change nothing.

    References
    ----------
    Falk & Langer (1998), doi:10.1103/PhysRevE.57.7192, eq. 2.11 to 2.14.
    """
    dataset = part_of(grains, "grains", ("position", "shape_scale", "time"))
    before, after = _two_snapshots(dataset, first, last)
    scale, glued = before.shape_scale.values, _glued(before)
    reach = REACH * float(scale[~glued].mean() if not glued.all() else scale.mean()) if cutoff is None else cutoff
    position = before.position.values, after.position.values
    there = np.flatnonzero(np.isfinite(position[0]).all(axis=1) & np.isfinite(position[1]).all(axis=1))
    cells = cell_of(before), cell_of(after)
    k, l, image = pairs_within(cells[0], position[0][there], reach)
    vectors = [x[there][l] - x[there][k] + image @ c.edges.T for x, c in zip(position, cells, strict=True)]
    found, gradient = _fit(k, vectors[0], vectors[1], len(there))
    columns = [_spread(values, there, len(scale)) for values in (found, np.bincount(k, minlength=len(there)), gradient)]
    times = {"first_time": (float(before.time), "first"), "last_time": (float(after.time), "second")}
    return _dataset(columns, glued, float(reach), times)


def _two_snapshots(dataset: "Dataset", first: float, last: float | None) -> "tuple[Dataset, Dataset]":
    """The snapshots nearest to two times, in memory."""
    if "time" not in dataset.dims:
        raise InputError("grains: is one snapshot, must have two for a displacement")
    places = [nearest(dataset.time, time, "snapshot") for time in (first, last)]
    before, after = (dataset.isel(time=place).load() for place in places)
    if not float(after.time) > float(before.time):
        raise InputError(
            f"first, last: the nearest snapshots are those of {float(before.time):g} and {float(after.time):g} s, "
            "the first must be before the second"
        )
    return before, after


def _dataset(
    columns: list[npt.NDArray], glued: npt.NDArray[np.bool_], reach: float, times: dict[str, tuple[float, str]]
) -> "Dataset":
    """What `d2min` gives: columns d2min, neighbour_count and deformation_gradient of all grains."""
    import xarray

    found, count, gradient = columns
    gradient_dims = ("grain", "space", "reference")
    return xarray.Dataset(
        {
            "d2min": ("grain", found, _described("m2", "D2min, sum over neighbours")),
            "neighbour_count": ("grain", count, _described("1", "neighbours within the cutoff")),
            "deformation_gradient": (gradient_dims, gradient, _described("1", "best map of the vectors to neighbours")),
            "glued": ("grain", glued, {"long_name": "whether the grain is glued to a platen"}),
        },
        {
            **{
                name: ((), time, _described("s", f"time of the {which} snapshot"))
                for name, (time, which) in times.items()
            },
            "cutoff": ((), reach, _described("m", "distance within which grains are neighbours")),
        },
        {"title": "Non-affine motion between two snapshots"},
    )


def _glued(snapshot: "Dataset") -> npt.NDArray[np.bool_]:
    """Whether each grain is glued to a platen."""
    if "kind" in snapshot.variables:
        return snapshot.kind.values == 1
    return np.zeros(snapshot.sizes["grain"], bool)


def _described(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def _spread(values: npt.NDArray, rows: npt.NDArray, count: int) -> npt.NDArray:
    """Values of some rows among all, nan or 0 elsewhere."""
    spread = np.full((count, *values.shape[1:]), np.nan if values.dtype.kind == "f" else 0, values.dtype)
    spread[rows] = values
    return spread


def _fit(k: npt.NDArray, before: Array, after: Array, count: int) -> tuple[Array, Array]:
    """D2min (n,) and the deformation gradients (n, D, D) of the grains, by (2), of the vectors (p, D) to neighbours."""
    dim = before.shape[1]

    def total(values: Array) -> Array:
        """Sum over the neighbours of each grain."""
        inner = values.shape[1:]
        columns = values.reshape(len(values), int(np.prod(inner))).T
        sums = np.stack([np.bincount(k, column, count) for column in columns], axis=1).reshape(count, *inner)
        return sums.astype(np.float64)

    now, then = (total(x[:, :, None] * before[:, None, :]) for x in (after, before))
    moments = np.linalg.eigvalsh(then)
    spans = moments[:, 0] > FLAT * moments[:, -1]
    gradient = np.full((count, dim, dim), np.nan)
    gradient[spans] = np.linalg.solve(then[spans], now[spans].swapaxes(1, 2)).swapaxes(1, 2)
    # The residual itself, not a difference of sums, which would keep only half of the digits.
    off = after - np.einsum("pij,pj->pi", gradient[k], before)
    return np.where(spans, total(np.einsum("pi,pi->p", off, off)), np.nan), gradient
