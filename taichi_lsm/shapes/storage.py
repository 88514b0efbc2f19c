"""Shapes in a small NetCDF file, bit for bit: one group per shape, one variable per field of its class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core.atomic_netcdf import write_atomically
from ..core.errors import InputError, reason, shown
from ..core.netcdf_input import opened_netcdf
from .arc_chain import ArcChain
from .ball_polyhedron import BallPolyhedron
from .base import GrainShape
from .cone_patches import PatchGrain
from .union import Union

if TYPE_CHECKING:
    from netCDF4 import Dataset, Group

CLASSES = {cls.__name__: cls for cls in (ArcChain, BallPolyhedron, PatchGrain, Union)}
UNITS = {"half_angle": "rad"}
MOST_SHAPES = 100_000  # of a file, and convex parts of a union
MOST_ROWS = 100_000  # of an array of one shape


def save_shapes(path: str | PathLike[str], shapes: Sequence[GrainShape]) -> None:
    """Write shapes to a NetCDF file, which appears whole or not at all.

    Parameters
    ----------
    path : path
        File to write; an older one is replaced.
    shapes : sequence of GrainShape
        Shapes to write: lengths in the unit of each shape (its equivalent diameter if it is normalised), angles [rad],
        body frame.

    Raises
    ------
    InputError
        For anything that is no shape, and if there is no folder to write to.
    SimulationError
        If the file cannot be written: the disk is full or read-only.
    """
    unknown = [s for s in shapes if type(s).__name__ not in CLASSES]
    if unknown:
        raise InputError(f"shapes: {unknown[0]!r} is not one of {', '.join(CLASSES)}")

    def fill(file: Dataset) -> None:
        """Write all shapes to an empty file."""
        file.setncatts(
            {
                "title": "Grain shapes",
                "Conventions": "CF-1.11, ACDD-1.3",
                "summary": "One group per shape; lengths in diameters of the shape, body frame.",
                "source": "taichi_lsm",
                "shapes": np.int64(len(shapes)),
            }
        )
        for k, shape in enumerate(shapes):
            _write(file.createGroup(f"shape_{k}"), shape)

    write_atomically(path, fill)


def _write(group: Group, shape: GrainShape) -> None:
    """Write the fields of one shape, those of the parts of a union in groups of their own."""
    group.setncattr("class", type(shape).__name__)
    for field in fields(shape):
        value = getattr(shape, field.name)
        if field.name == "members":
            group.members = np.int64(len(value))
            for k, member in enumerate(value):
                _write(group.createGroup(f"member_{k}"), member)
        elif isinstance(value, str):
            group.setncattr(field.name, value)
        else:
            array = np.asarray(value)
            dims = [f"{field.name}_{axis}" for axis in range(array.ndim)]
            for dim, size in zip(dims, array.shape):
                group.createDimension(dim, size)
            variable = group.createVariable(field.name, array.dtype, dims, fill_value=False)
            variable.units, variable.long_name = UNITS.get(field.name, "1"), field.name.replace("_", " ")
            variable[...] = array


def load_shapes(path: str | PathLike[str]) -> list[GrainShape]:
    """The shapes of a file that `save_shapes` wrote.

    Parameters
    ----------
    path : path
        File to read.

    Returns
    -------
    list of GrainShape
        The same shapes, bit for bit, in the same order.

    Raises
    ------
    InputError
        If the file does not exist, cannot be read or holds something else; the message names the file and the cause.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"shapes {path}: no such file")
    try:
        with opened_netcdf(path) as file:
            if "shapes" not in file.ncattrs():
                raise InputError(f"shapes {path}: the attribute `shapes` is missing, so it holds no shapes")
            return [_read(_group(file, f"shape_{k}", path), path) for k in range(_count(file, "shapes", path))]
    except InputError:
        raise
    except (OSError, RuntimeError, ValueError, AttributeError) as error:  # the last of an attribute
        raise InputError(f"shapes {path}: cannot be read as NetCDF ({reason(error)})") from None


def _count(group: Dataset | Group, name: str, path: Path) -> int:
    """The attribute that says how many shapes a group holds."""
    count = group.getncattr(name)
    if not (isinstance(count, np.integer) and 0 <= count <= MOST_SHAPES):
        raise InputError(f"shapes {path}: the attribute {name} is {shown(count)}, must be 0 to {MOST_SHAPES}")
    return int(count)


def _array(group: Group, name: str, path: Path) -> NDArray | float:
    """A variable of numbers."""
    variable = group.variables[name]
    if variable.dtype is str or variable.dtype.kind not in "fi" or any(n > MOST_ROWS for n in variable.shape):
        raise InputError(
            f"shapes {path}: {group.name}: {name} is of type {variable.dtype} and shape {variable.shape}, must be "
            f"numbers, at most {MOST_ROWS} rows"
        )
    array = variable[...]
    return array.item() if array.ndim == 0 else np.asarray(array)


def _group(parent: Dataset, name: str, path: Path) -> Group:
    """A group of a file by its name."""
    if name not in parent.groups:
        raise InputError(f"shapes {path}: group {name} is missing")
    return parent.groups[name]


def _read(group: Group, path: Path) -> GrainShape:
    """The shape of one group."""
    name = group.getncattr("class") if "class" in group.ncattrs() else None
    if not isinstance(name, str) or name not in CLASSES:
        raise InputError(f"shapes {path}: {group.name} is of class {shown(name)}, must be one of {', '.join(CLASSES)}")
    values = {}
    for field in fields(CLASSES[name]):
        if field.name == "members":
            count = _count(group, "members", path) if "members" in group.ncattrs() else 0
            values["members"] = tuple(_read(_group(group, f"member_{k}", path), path) for k in range(count))
        elif field.name in group.variables:
            values[field.name] = _array(group, field.name, path)
        elif field.name in group.ncattrs():
            values[field.name] = str(group.getncattr(field.name))
        else:
            raise InputError(f"shapes {path}: {group.name} lacks {field.name}")
    try:
        return CLASSES[name](**values)
    except (ValueError, TypeError, IndexError, ArithmeticError) as error:
        raise InputError(f"shapes {path}: {group.name}: {reason(error)}") from None
