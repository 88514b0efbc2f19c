"""What an analysis reads of what it is given: a tree of a run, one of its children, or a dataset."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, shown

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

    Run = Dataset | DataTree

OPTIONS = {"contacts": "; run with --contacts"}


def part_of(run: "Run", name: str, needed: tuple[str, ...] = (), what: str = "") -> "Dataset":
    """The dataset of one file of a run.

    Parameters
    ----------
    run
        The tree of a run, as `open_run` gives it of a folder, its child of this name, or a dataset.
    name
        "run", "grains" or "contacts".
    needed
        Variables that it must have.
    what
        What the dataset must be, for the message.

    Raises
    ------
    InputError
        If it is none of these, the run has no such file, or variables are missing.
    """
    dataset = _dataset_of(run, name)
    missing = [variable for variable in needed if variable not in dataset.variables]
    if missing:
        raise InputError(
            f"{name}: has no {', '.join(missing)}, must be {what or f'the {name}.nc of a run of this version'}"
        )
    return dataset


def holds(run: "Run", name: str) -> bool:
    """Whether it is a tree with such a file."""
    return bool(getattr(run, "children", None)) and name in run.children  # pyright: ignore[reportAttributeAccessIssue]


def _dataset_of(run: "Run", name: str) -> "Dataset":
    """The dataset meant by a tree, a child of one or a dataset; InputError if it is none of these."""
    import xarray

    if isinstance(run, xarray.Dataset):
        return run
    if not isinstance(run, xarray.DataTree):
        raise InputError(f"{name}: {shown(run)}, must be what lsm.open_run gives")
    if name in run.children:
        return run.children[name].to_dataset()
    if run.has_data:
        return run.to_dataset()
    if "runs" in run.children:
        some = next(iter(run.children["runs"].children))
        raise InputError(f"{_source(run)}: holds many runs, must be one of them, such as tree['runs/{some}']")
    raise InputError(f"{_source(run)}: holds no {name}.nc{OPTIONS.get(name, '')}")


def _source(run: "DataTree") -> str:
    return str(run.encoding.get("source", "the tree"))


def nearest(times: npt.ArrayLike, wanted: float | None, what: str) -> int:
    """Place of the time that is nearest to a wanted one [s]; of the last one if none is wanted.

    Raises
    ------
    InputError
        If there is no time, or the wanted one is not a number; `what`: what has times, for the message.
    """
    times = np.asarray(times, float)
    if not times.size:
        raise InputError(f"dataset: holds no {what} yet")
    if wanted is None:
        return times.size - 1
    try:
        value = float(wanted)
    except (TypeError, ValueError):
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"time = {shown(wanted)}: must be a time [s]")
    return int(np.argmin(np.abs(times - value)))


def snapshot_at(grains: "Dataset", time: float | None = None) -> "Dataset":
    """The snapshot that is nearest to a time [s], the last one without a time; itself, if it is one already."""
    if "time" not in grains.dims:
        return grains
    return grains.isel(time=nearest(grains.time, time, "snapshot"))
