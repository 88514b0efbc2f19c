"""One moment of the contacts of a run (contacts.nc): a contiguous ragged array of CF, moment after moment."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, shown
from .run_parts import nearest, part_of

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run


def contacts_at(contacts: "Run", time: float | None = None, index: int | None = None) -> "Dataset":
    """The contacts of one moment, in memory.

    Parameters
    ----------
    contacts
        A contacts.nc, as `open_run` gives it, or the tree of a run that has one. What is one moment already, such as
        `sim.contacts()`, is given back.
    time
        Time [s]; the nearest moment is taken. Without it and an index: the last one.
    index
        Number of the moment from 0 on, from -1 on backwards.

    Returns
    -------
    xarray.Dataset
        Along contact, with the variables of `Simulation.contacts`; what contacts.nc has along time, such as time, stage
        and shear strain, is a scalar.

    Raises
    ------
    InputError
        If there are no contacts, no moment, or no such moment; for a time and an index together.
    """
    dataset = part_of(contacts, "contacts", ("first_id", "second_id"), "a contacts.nc, or what sim.contacts() gives")
    if time is not None and index is not None:
        raise InputError(f"time = {shown(time)}, index = {shown(index)}: give one of them")
    if "row_size" not in dataset.variables:
        if "time" in dataset.dims:
            raise InputError("contacts: has times but no row_size, must be a contacts.nc, as lsm.open_run gives it")
        return dataset
    dataset = dataset.isel(time=np.isfinite(np.asarray(dataset.time, float)))  # without room, which xarray leaves
    ends = np.concatenate([[0], np.cumsum(_row_sizes(dataset))])
    place = nearest(dataset.time, time, "moment") if index is None else _numbered(index, len(ends) - 1)
    rows = slice(int(ends[place]), int(ends[place + 1]))
    return dataset.isel(time=place, contact=rows).drop_vars("row_size").load()


def _row_sizes(dataset: "Dataset") -> npt.NDArray[np.int64]:
    """Contacts of each moment, which were counted in the file; InputError if it does not hold them."""
    sizes = np.asarray(dataset.row_size).astype(np.int64)
    if dataset.row_size.dims != ("time",) or (sizes < 0).any() or sizes.sum() > dataset.sizes["contact"]:
        raise InputError("contacts: row_size does not count the rows along contact, the dataset is damaged or cut")
    return sizes


def _numbered(index: int, count: int) -> int:
    """The number of a moment from 0 on."""
    if isinstance(index, bool) or not isinstance(index, int | np.integer) or not -count <= index < count:
        raise InputError(f"index = {shown(index)}: must be an integer from {-count} to {count - 1}, of {count} moments")
    return int(index) % count


def whole_moments(dataset: "Dataset") -> "Dataset":
    """A contacts.nc without the room for moments that were not recorded.

    Of a run that goes on or was killed, a moment whose rows are not all there is left out too.

    Raises
    ------
    ValueError
        If moments and rows do not belong together.
    """
    size, time = np.asarray(dataset.row_size, np.int64), np.asarray(dataset.time, float)
    count = int(np.isfinite(time).sum())
    if dataset.row_size.dims != ("time",) or not np.isfinite(time[:count]).all() or (size[:count] < 0).any():
        raise ValueError("its moments do not follow each other")
    ends = np.cumsum(size[:count])
    whole = int(np.searchsorted(ends, dataset.sizes["contact"], side="right"))
    if whole < count and dataset.attrs.get("run_status") != "running":
        raise ValueError(f"it counts {ends[-1]} contacts and holds {dataset.sizes['contact']}")
    return dataset.isel(time=slice(whole), contact=slice(int(ends[whole - 1]) if whole else 0))
