"""Taichi fields from schema rows: their allocation, capacity, size in memory and filling."""

from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from .allocation import write
from .errors import InputError
from .runtime import current, ti
from .schema import Variable

MANY_ROWS = 200_000  # from here on a capacity is rounded more finely


def rotation_size(dim: int) -> int:
    """Components of an angular velocity: one in 2D, three in 3D."""
    return 1 if dim == 2 else 3


def orientation_size(dim: int) -> int:
    """Components of an orientation: unit complex number in 2D, unit quaternion in 3D."""
    return 2 if dim == 2 else 4


def rounded_capacity(count: int) -> int:
    """Capacity for `count` rows, rounded up to 1/8 of a power of two, of many rows to 1/64.

    Compiled kernels are cached by the shapes of their fields; rounding lets runs of similar size share them. Where
    there are many rows, memory matters more than the seconds of compiling.
    """
    finer = 4 if count <= MANY_ROWS else 7
    step = max(8, 1 << max(0, int(count).bit_length() - finer))
    return -(-max(1, int(count)) // step) * step


def allocate(variables: Iterable[Variable], capacity: int, sizes: Mapping[str, int]) -> SimpleNamespace:
    """Taichi fields for schema rows, as attributes of the returned namespace.

    Parameters
    ----------
    variables
        Rows of one table. The first dimension of each is the element index; the product of the lengths of the other
        dimensions is the length of the vector stored per element. Without others the field is scalar.
    capacity
        Number of elements.
    sizes
        Lengths of the dimensions other than the first.

    Returns
    -------
    SimpleNamespace
        One `ti.field` or `ti.Vector.field` per row, under the row's name; zero until it is written.
    """
    dtypes = {"real": current().real, "f64": ti.f64, "i32": ti.i32, "i8": ti.i8}
    fields = SimpleNamespace()
    for variable in variables:
        dtype = dtypes[variable.dtype]
        if len(variable.dims) > 1:
            width = int(np.prod([sizes[d] for d in variable.dims[1:]]))
            setattr(fields, variable.name, ti.Vector.field(width, dtype, capacity))
        else:
            setattr(fields, variable.name, ti.field(dtype, capacity))
    return fields


def bytes_per_row(variables: Iterable[Variable], sizes: Mapping[str, int]) -> int:
    """Bytes that one element of these rows takes, at the precision of this process; `sizes` as in `allocate`."""
    width = {"real": 8 if current().real == ti.f64 else 4, "f64": 8, "i32": 4, "i8": 1}
    return sum(width[v.dtype] * int(np.prod([sizes[d] for d in v.dims[1:]], dtype=int)) for v in variables)


def fill_rows(field: Any, values: npt.ArrayLike) -> None:
    """Write the first rows of a Taichi field; the others keep what they hold.

    Raises
    ------
    InputError
        If there are more values than rows: the shape tables of a scene must fit into those that were compiled.
    """
    given, room = np.asarray(values), field.shape[0]
    if len(given) > room:
        raise InputError(f"shapes: {len(given)} rows of the shape table, there is room for {room}")
    write(field, given)
