"""Schema rows as NetCDF variables: checks of what is given, and their dimensions, types and attributes.

Files of the classic format (`core.record_netcdf`) have no strings and no compression: texts are rows of characters
there, which readers turn back into texts.
All checks raise `InputError` that names the row: rows and values come from whoever writes a workflow.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from ..core.schema import Variable

if TYPE_CHECKING:
    import netCDF4

TIME = Variable("time", ("time",), "f64", "s", "elapsed model time")
TEXT_ROOM = 64  # bytes that a text along time has in a file that grows
COMPRESS_FROM = 1000  # values; below it a chunk's overhead outweighs what compression saves
CHUNK_VALUES = 2**17  # at most 1 MiB, so that one snapshot is read without the others


@dataclass(frozen=True)
class Scalar:
    """One value that holds for a whole file, such as a parameter: a scalar coordinate of its variables.

    Parameters
    ----------
    name
        Identifier.
    value
        A number, which is stored as f64, an integer, stored as i32, or a text.
    long_name
        What it is.
    units
        UDUNITS string of a number, "1" for a pure one.
    """

    name: str
    value: float | int | str
    long_name: str
    units: str = "1"

    @property
    def variable(self) -> Variable | None:
        """Schema row of a number; None of a text."""
        if isinstance(self.value, str):
            return None
        return Variable(self.name, (), "i32" if isinstance(self.value, int) else "f64", self.units, self.long_name)


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
    real = {"f64": "f8", "f32": "f4"}[precision]
    return np.dtype({"i8": "i1", "i32": "i4", "f64": "f8", "real": real}[variable.dtype])


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
    whole = variable.dtype in ("i8", "i32")
    if array.dtype.kind not in ("iub" if whole else "iubf"):
        raise InputError(f"{variable.name}: values of type {array.dtype}, declared is {variable.dtype}")
    if whole and array.size:
        limits = np.iinfo(netcdf_type(variable))
        if array.min() < limits.min or array.max() > limits.max:
            raise InputError(f"{variable.name}: {array.min()}..{array.max()} does not fit into {limits.bits} bits")
    return array.astype(netcdf_type(variable, precision))


def checked_text(name: str, value: Any) -> str:
    """`value`, or an InputError that names the variable if it is no text."""
    if not isinstance(value, str):
        raise InputError(f"{name}: {value!r}, must be a text")
    return value


def text_in_room(name: str, value: Any) -> str:
    """`value`, or an InputError that names the variable if it is no text or has no room in TEXT_ROOM bytes."""
    size = len(checked_text(name, value).encode())
    if size > TEXT_ROOM:
        raise InputError(f"{name}: {value!r} has {size} bytes, must have at most {TEXT_ROOM}")
    return value


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
    options = _storage(dataset, variable, array) if _is_hdf5(dataset) else {}
    stored = dataset.createVariable(variable.name, array.dtype, variable.dims, fill_value=False, **options)
    stored.setncatts({"units": variable.units, "long_name": variable.long_name})
    stored.setncatts(flag_attributes(variable, extra or {}))
    _attach(stored, dataset, coordinates)
    stored[...] = array


def _storage(dataset: "netCDF4.Dataset", variable: Variable, array: npt.NDArray) -> dict[str, Any]:
    """How the values lie in an HDF5 file: compressed in chunks if there are many."""
    if array.size >= COMPRESS_FROM:
        rows = CHUNK_VALUES * array.shape[0] // array.size  # along the first dimension, in one chunk
        chunks = (min(max(rows, 1), array.shape[0]), *array.shape[1:])
        return {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks}
    if variable.dims and dataset.dimensions[variable.dims[0]].isunlimited():
        return {"chunksizes": tuple(max(1, n) for n in array.shape)}  # the library's choice wastes space
    return {}


def put_time(dataset: "netCDF4.Dataset", times: npt.NDArray) -> None:
    """Create the dimension time and its coordinate variable; times [s], strictly increasing.

    Neither axis "T" nor a standard_name: in CF both say that the units count from a date.
    """
    dataset.createDimension("time", None)
    put_variable(dataset, TIME, times)


def put_scalars(dataset: "netCDF4.Dataset", scalars: Iterable[Scalar]) -> tuple[str, ...]:
    """Create a variable without dimensions per scalar; returns the names, for the coordinates of other variables."""
    names = []
    for scalar in scalars:
        if scalar.variable is None:
            put_text(dataset, scalar.name, scalar.long_name, (), np.array(scalar.value, dtype=object))
        else:
            put_variable(dataset, scalar.variable, checked_array(scalar.variable, scalar.value, ()))
        names.append(scalar.name)
    return tuple(names)


def put_text(
    dataset: "netCDF4.Dataset",
    name: str,
    long_name: str,
    dims: tuple[str, ...],
    texts: npt.NDArray,
    coordinates: Iterable[str] = (),
) -> None:
    """Create a variable of texts (object array) with these dimensions; coordinates as in `put_variable`."""
    if not _is_hdf5(dataset):
        put_characters(dataset, name, long_name, dims, texts, coordinates=coordinates)
        return
    stored = dataset.createVariable(name, str, dims)
    stored.long_name = long_name
    _attach(stored, dataset, coordinates)
    stored[...] = texts


def put_text_in_time(
    dataset: "netCDF4.Dataset", name: str, long_name: str, texts: npt.NDArray, room: int | None = None
) -> None:
    """Create a variable of one text per time, as rows of characters; `room`: bytes, None for those of the longest."""
    put_characters(dataset, name, long_name, ("time",), texts, room)


def put_characters(
    dataset: "netCDF4.Dataset",
    name: str,
    long_name: str,
    dims: tuple[str, ...],
    texts: npt.NDArray,
    room: int | None = None,
    coordinates: Iterable[str] = (),
) -> None:
    """Create a variable of texts (object array) as rows of `room` characters, see `put_text`; readers see texts."""
    room = room or longest(texts)
    dataset.createDimension(f"{name}_length", room)
    options: dict[str, Any] = {}
    if _is_hdf5(dataset) and dims:
        options = {"zlib": True, "complevel": 1, "chunksizes": (*(max(1, n) for n in texts.shape), room)}
    stored = dataset.createVariable(name, "S1", (*dims, f"{name}_length"), fill_value=False, **options)
    stored.setncatts({"long_name": long_name, "_Encoding": "utf-8"})
    _attach(stored, dataset, coordinates)
    stored.set_auto_chartostring(False)
    if texts.size:
        stored[...] = characters(texts, room)


def longest(texts: npt.NDArray) -> int:
    """Bytes of the longest text, at least 1."""
    return max((len(text.encode()) for text in texts.ravel()), default=1) or 1


def characters(texts: npt.NDArray, room: int) -> npt.NDArray:
    """Texts as an array of single bytes, `room` of them for each, along a last dimension; NUL fills them up."""
    encoded = np.array([text.encode() for text in texts.ravel()], f"S{room}")
    return encoded.view("S1").reshape(*texts.shape, room)


def _is_hdf5(dataset: "netCDF4.Dataset") -> bool:
    return dataset.data_model == "NETCDF4"


def _attach(stored: Any, dataset: "netCDF4.Dataset", coordinates: Iterable[str]) -> None:
    own = set(stored.dimensions)
    attached = [name for name in coordinates if {d for d in dataset[name].dimensions if d != f"{name}_length"} <= own]
    if attached:
        stored.coordinates = " ".join(attached)


def put_labels(dataset: "netCDF4.Dataset", labels: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Create a dimension and its text variable `<dimension>_name` per list of labels; returns the names."""
    for dimension, texts in labels.items():
        if dimension not in dataset.dimensions:
            dataset.createDimension(dimension, len(texts))
        names = np.array(texts, dtype=object)
        put_text(dataset, f"{dimension}_name", f"name along dimension {dimension}", (dimension,), names)
    return tuple(f"{dimension}_name" for dimension in labels)
