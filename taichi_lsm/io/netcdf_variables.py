"""Schema rows as NetCDF variables: checks of what is given, and their dimensions, types and attributes."""

import numpy as np

from ..core.schema import Variable

TIME = Variable("time", ("time",), "f64", "s", "elapsed model time")
COMPRESS_FROM = 1000  # values; below it a chunk's overhead outweighs what compression saves
CHUNK_VALUES = 2**17  # at most 1 MiB, so that one snapshot is read without the others


def require_names(given, declared, what):
    """Raise ValueError naming every name of `declared` that is missing and every name that is too many."""
    given, declared = list(given), list(declared)
    missing = [name for name in declared if name not in given]
    unknown = [name for name in given if name not in declared]
    if missing or unknown:
        problems = [f"missing {', '.join(missing)}"] if missing else []
        problems += [f"unknown {', '.join(map(str, unknown))}"] if unknown else []
        raise ValueError(f"{what}: {'; '.join(problems)}; declared are {', '.join(declared)}")


def rows_by_name(variables):
    """Dict of name -> row; ValueError for a name that is declared twice."""
    rows = {v.name: v for v in variables}
    if len(rows) < len(variables):
        names = [v.name for v in variables]
        raise ValueError(f"declared twice: {', '.join(sorted({n for n in names if names.count(n) > 1}))}")
    return rows


def require_known(what, names, allowed):
    """Raise ValueError naming every one of `names` that is not in `allowed`."""
    unknown = [name for name in names if name not in allowed]
    if unknown:
        raise ValueError(f"{what}: {', '.join(unknown)} unknown; declared are {', '.join(allowed)}")


def netcdf_type(variable, precision="f64"):
    """NumPy dtype of a row on file; "real" follows `precision` (f64 or f32)."""
    return np.dtype({"i32": "i4", "f64": "f8", "real": {"f64": "f8", "f32": "f4"}[precision]}[variable.dtype])


def checked_array(variable, values, shape, precision="f64"):
    """`values` as an array of the row's type and of this shape, or a ValueError that names the row."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{variable.name}: {error}") from None
    if array.shape != tuple(shape):
        raise ValueError(f"{variable.name}: shape {array.shape}, allowed is {tuple(shape)} {variable.dims}")
    if array.dtype.kind not in ("iub" if variable.dtype == "i32" else "iubf"):
        raise ValueError(f"{variable.name}: values of type {array.dtype}, declared is {variable.dtype}")
    if variable.dtype == "i32" and array.size:
        limits = np.iinfo(np.int32)
        if array.min() < limits.min or array.max() > limits.max:
            raise ValueError(f"{variable.name}: {array.min()}..{array.max()} does not fit into 32 bits")
    return array.astype(netcdf_type(variable, precision))


def flag_attributes(variable, extra):
    """Attributes with flag_values in the variable's own type and flag_meanings as one string, as CF asks."""
    extra = dict(extra)
    if "flag_values" in extra:
        extra["flag_values"] = np.asarray(extra["flag_values"], dtype=netcdf_type(variable))
    if not isinstance(extra.get("flag_meanings", ""), str):
        extra["flag_meanings"] = " ".join(extra["flag_meanings"])
    return extra


def put_variable(dataset, variable, array, extra=(), coordinates=()):
    """Create the variable of a row in an open dataset and write its values.

    extra: further attributes; coordinates: names of its auxiliary coordinate variables, those without one of
    its dimensions are left out. No _FillValue: rows are complete, and CF forbids it on coordinates.
    """
    options = {}
    if array.size >= COMPRESS_FROM:
        rows = CHUNK_VALUES * array.shape[0] // array.size
        chunks = (min(max(rows, 1), array.shape[0]), *array.shape[1:])
        options = {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks}
    elif variable.dims and dataset.dimensions[variable.dims[0]].isunlimited():
        options = {"chunksizes": tuple(max(1, n) for n in array.shape)}  # the library's choice wastes space
    stored = dataset.createVariable(variable.name, array.dtype, variable.dims, fill_value=False, **options)
    stored.setncatts({"units": variable.units, "long_name": variable.long_name})
    stored.setncatts(flag_attributes(variable, extra))
    attached = [name for name in coordinates if set(dataset[name].dimensions) <= set(variable.dims)]
    if attached:
        stored.coordinates = " ".join(attached)
    stored[...] = array


def put_time(dataset, times):
    """Create the dimension time and its coordinate variable; times [s], strictly increasing.

    Neither axis "T" nor a standard_name: in CF both say that the units count from a date.
    """
    dataset.createDimension("time", None)
    put_variable(dataset, TIME, times)


def put_labels(dataset, labels):
    """Create a dimension and its text variable `<dimension>_name` per list of labels; returns the names."""
    for dimension, texts in labels.items():
        if dimension not in dataset.dimensions:
            dataset.createDimension(dimension, len(texts))
        stored = dataset.createVariable(f"{dimension}_name", str, (dimension,))
        stored.long_name = f"name along dimension {dimension}"
        stored[:] = np.array(texts, dtype=object)
    return tuple(f"{dimension}_name" for dimension in labels)
