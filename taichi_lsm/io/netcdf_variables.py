"""Schema rows as NetCDF variables: checks of what is given, and their dimensions, types and attributes.

All checks raise `InputError` that names the row: rows and values come from whoever writes a workflow.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from ..core.schema import Variable

if TYPE_CHECKING:
    import netCDF4

TIME = Variable("time", ("time",), "f64", "s", "elapsed model time")
COMPRESS_FROM = 1000  # values; below it a chunk's overhead outweighs what compression saves
CHUNK_VALUES = 2**17  # at most 1 MiB, so that one snapshot is read without the others


def require_names(given: Iterable[str], declared: Iterable[str], what: str) -> None:
    """Raise InputError naming every name of `declared` that is missing and every name that is too many."""
    given, declared = list(given), list(declared)
    missing = [name for name in declared if name not in given]
    unknown = [name for name in given if name not in declared]
    if missing or unknown:
        problems = [f"missing {', '.join(missing)}"] if missing else []
        problems += [f"unknown {', '.join(map(str, unknown))}"] if unknown else []
        raise InputError(f"{what}: {'; '.join(problems)}; declared are {', '.join(declared)}")


def rows_by_name(variables: Sequence[Variable]) -> dict[str, Variable]:
    """Dict of name -> row; InputError for a name that is declared twice."""
    rows = {v.name: v for v in variables}
    if len(rows) < len(variables):
        names = [v.name for v in variables]
        raise InputError(f"declared twice: {', '.join(sorted({n for n in names if names.count(n) > 1}))}")
    return rows


def require_known(what: str, names: Iterable[str], allowed: Iterable[str]) -> None:
    """Raise InputError naming every one of `names` that is not in `allowed`."""
    unknown = [name for name in names if name not in allowed]
    if unknown:
        raise InputError(f"{what}: {', '.join(unknown)} unknown; declared are {', '.join(allowed)}")


def netcdf_type(variable: Variable, precision: str = "f64") -> np.dtype:
    """NumPy dtype of a row on file; "real" follows `precision` (f64 or f32)."""
    return np.dtype({"i32": "i4", "f64": "f8", "real": {"f64": "f8", "f32": "f4"}[precision]}[variable.dtype])


def checked_array(
    variable: Variable, values: npt.ArrayLike, shape: Iterable[int], precision: str = "f64"
) -> npt.NDArray:
    """`values` as an array of the row's type and of this shape, or an InputError that names the row."""
    shape = tuple(shape)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InputError(f"{variable.name}: {error}") from None
    if array.shape != shape:
        raise InputError(f"{variable.name}: shape {array.shape}, allowed is {shape} {variable.dims}")
    if array.dtype.kind not in ("iub" if variable.dtype == "i32" else "iubf"):
        raise InputError(f"{variable.name}: values of type {array.dtype}, declared is {variable.dtype}")
    if variable.dtype == "i32" and array.size:
        limits = np.iinfo(np.int32)
        if array.min() < limits.min or array.max() > limits.max:
            raise InputError(f"{variable.name}: {array.min()}..{array.max()} does not fit into 32 bits")
    return array.astype(netcdf_type(variable, precision))


def flag_attributes(variable: Variable, extra: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes with flag_values in the variable's own type and flag_meanings as one string, as CF asks."""
    extra = dict(extra)
    if "flag_values" in extra:
        extra["flag_values"] = np.asarray(extra["flag_values"], dtype=netcdf_type(variable))
    if not isinstance(extra.get("flag_meanings", ""), str):
        extra["flag_meanings"] = " ".join(extra["flag_meanings"])
    return extra


def put_variable(
    dataset: "netCDF4.Dataset",
    variable: Variable,
    array: npt.NDArray,
    extra: Mapping[str, Any] | None = None,
    coordinates: Iterable[str] = (),
) -> None:
    """Create the variable of a row in an open dataset and write its values.

    Parameters
    ----------
    dataset, variable, array
        Open dataset with the row's dimensions; the row; its values.
    extra
        Further attributes.
    coordinates
        Names of its auxiliary coordinate variables; those without one of its dimensions are left out.

    Notes
    -----
    No _FillValue: rows are complete, and CF forbids it on coordinates.
    """
    options: dict[str, Any] = {}
    if array.size >= COMPRESS_FROM:
        rows = CHUNK_VALUES * array.shape[0] // array.size  # along the first dimension, in one chunk
        chunks = (min(max(rows, 1), array.shape[0]), *array.shape[1:])
        options = {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks}
    elif variable.dims and dataset.dimensions[variable.dims[0]].isunlimited():
        options = {"chunksizes": tuple(max(1, n) for n in array.shape)}  # the library's choice wastes space
    stored = dataset.createVariable(variable.name, array.dtype, variable.dims, fill_value=False, **options)
    stored.setncatts({"units": variable.units, "long_name": variable.long_name})
    stored.setncatts(flag_attributes(variable, extra or {}))
    attached = [name for name in coordinates if set(dataset[name].dimensions) <= set(variable.dims)]
    if attached:
        stored.coordinates = " ".join(attached)
    stored[...] = array


def put_time(dataset: "netCDF4.Dataset", times: npt.NDArray) -> None:
    """Create the dimension time and its coordinate variable; times [s], strictly increasing.

    Neither axis "T" nor a standard_name: in CF both say that the units count from a date.
    """
    dataset.createDimension("time", None)
    put_variable(dataset, TIME, times)


def put_labels(dataset: "netCDF4.Dataset", labels: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Create a dimension and its text variable `<dimension>_name` per list of labels; returns the names."""
    for dimension, texts in labels.items():
        if dimension not in dataset.dimensions:
            dataset.createDimension(dimension, len(texts))
        stored = dataset.createVariable(f"{dimension}_name", str, (dimension,))
        stored.long_name = f"name along dimension {dimension}"
        stored[:] = np.array(texts, dtype=object)
    return tuple(f"{dimension}_name" for dimension in labels)
