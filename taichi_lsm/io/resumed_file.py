"""A file that a former process wrote, taken over by a run that goes on: whether it fits, and what is kept of it."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.atomic_netcdf import compose
from ..core.errors import InputError, reason, shown
from ..core.netcdf_input import opened_netcdf
from ..core.record_netcdf import FORMAT, RecordLayout, is_record_file, layout_of, read_layout
from .global_attributes import package_version, utc_now

if TYPE_CHECKING:
    import netCDF4

KEPT = ("date_created", "id", "history")
GROWING = {"time", "contact"}  # dimensions along which a run writes
SHOWN = 5  # differences that a message names
REMEDY = "resume in the folder of that run with the parameters and the version that began it, or begin anew"


def require_count(path: Path, keep: Any) -> None:
    """Raise InputError unless `keep` is a whole number >= 0."""
    if isinstance(keep, bool) or not isinstance(keep, int | np.integer) or keep < 0:
        raise InputError(f"{path}: keep = {keep!r}, must be a whole number >= 0, or None for a new file")


def require_rows(path: Path, keep: int, there: int, what: str) -> None:
    """Raise InputError unless the file at `path` holds as many rows or snapshots (`what`) as are to be kept."""
    if there < keep:
        raise InputError(f"{path}: holds {there} {what}, fewer than the {keep} to keep; {REMEDY}")


@contextmanager
def opened(path: Path) -> "Iterator[netCDF4.Dataset]":
    """The file at `path`, open for reading; InputError if it is missing or damaged, also where that shows later."""
    if not path.is_file():
        raise InputError(f"{path}: cannot be continued, there is no such file; {REMEDY}")
    try:
        with opened_netcdf(path) as dataset:
            yield dataset
    except InputError:
        raise
    except (OSError, RuntimeError, ValueError, AttributeError) as error:  # the last of an attribute
        raise InputError(f"{path}: cannot be continued, it is damaged ({reason(error)}); {REMEDY}") from None


def require_same_declaration(path: Path, there: "netCDF4.Dataset", image: memoryview, free: Collection[str]) -> None:
    """Raise InputError unless the file at `path` is declared as a file of this run without rows.

    Parameters
    ----------
    path, there
        The old file; the same, open.
    image
        The other one, in memory.
    free
        Names of variables whose values may differ, such as parameters.

    Notes
    -----
    Compared are the names of the variables, their dimensions, types and attributes, and the values of those that do not
    depend on time. The global attributes are those of the run that goes on, but for the ones in KEPT.
    """
    import netCDF4

    with netCDF4.Dataset("fresh.nc", memory=image) as fresh:
        fresh.set_auto_mask(False)
        problems = _all_differences(there, fresh, free)
    if problems:
        more = [f"and {len(problems) - SHOWN} differences more"] if len(problems) > SHOWN else []
        raise InputError(f"{path}: cannot be continued, {'; '.join(problems[:SHOWN] + more)}; {REMEDY}")


def _all_differences(there: "netCDF4.Dataset", fresh: "netCDF4.Dataset", free: Collection[str]) -> list[str]:
    missing = [name for name in fresh.variables if name not in there.variables]
    unknown = [name for name in there.variables if name not in fresh.variables]
    problems = [f"it lacks {name}" for name in missing] + [f"it has {name}, this run has not" for name in unknown]
    problems += [f"it lacks the attribute {name}" for name in KEPT if name not in there.ncattrs()]
    for name, variable in fresh.variables.items():
        if name not in missing:
            problems += _differences(there[name], variable, name in free)
    return problems


def _differences(there: Any, fresh: Any, free: bool) -> list[str]:
    """What differs between two variables of one name, at most one text."""
    name = fresh.name
    # The length of a text is no part of a declaration.
    dims, expected = ([d for d in v.dimensions if d != f"{name}_length"] for v in (there, fresh))
    if dims != expected:
        return [f"{name} has the dimensions {dims}, not {expected}"]
    if there.dtype != fresh.dtype:
        return [f"{name} is of type {there.dtype}, not {fresh.dtype}"]
    for key in sorted({*there.ncattrs(), *fresh.ncattrs()}):
        old, new = (np.asarray(v.getncattr(key) if key in v.ncattrs() else "missing") for v in (there, fresh))
        if not np.array_equal(old, new):
            return [f"the attribute {key} of {name} is {shown(str(old))[1:-1]}, not {shown(str(new))[1:-1]}"]
    if free or GROWING & set(expected):
        return []
    old, new = np.asarray(there[...]), np.asarray(fresh[...])
    if old.shape != new.shape:
        return [f"{name} has the shape {old.shape}, not {new.shape}"]
    at = _first_difference(old, new)
    if at is None:
        return []
    place = f"{name}[{', '.join(map(str, at))}]" if at else name
    return [f"{place} is {shown(str(old[at]))[1:-1]}, not {shown(str(new[at]))[1:-1]}"]


def _first_difference(old: npt.NDArray, new: npt.NDArray) -> tuple[int, ...] | None:
    """Index of the first value that differs, None if there is none; nan is like nan."""
    differs = np.asarray((old != new) & ~((old != old) & (new != new)))
    return tuple(int(i) for i in np.argwhere(differs)[0]) if differs.any() else None


@contextmanager
def record_file(
    path: Path, declare: "Callable[[netCDF4.Dataset], None]", free: Collection[str]
) -> "Iterator[tuple[netCDF4.Dataset, RecordLayout]]":
    """A file of records of a former process, open for reading, and where they lie.

    Parameters
    ----------
    path
        The file.
    declare
        Writes the same file without records to a dataset.
    free
        Names of variables whose values may differ, see `require_same_declaration`.

    Raises
    ------
    InputError
        If the file is missing or damaged, is no file of records, or is declared or laid out otherwise.
    """
    image = compose(declare, FORMAT)
    with opened(path) as there:
        if not is_record_file(path):
            raise InputError(f"{path}: cannot be continued, it is no file of records, as this version writes; {REMEDY}")
        require_same_declaration(path, there, image, free)
        layout = read_layout(path)
        if list(layout.variables.items()) != list(layout_of(image).variables.items()):
            raise InputError(f"{path}: cannot be continued, its variables lie in another order; {REMEDY}")
        yield there, layout


def resumed_attributes(attributes: Mapping[str, Any], there: "netCDF4.Dataset") -> dict[str, Any]:
    """Global attributes of the run that goes on, with the date, the id and the history of the file that is there."""
    line = f"{utc_now()} resumed by taichi_lsm {package_version('taichi-lsm')}"
    kept = {name: there.getncattr(name) for name in KEPT}
    return {**attributes, **kept, "history": f"{kept['history']}\n{line}"}
