"""Shapes in a small NetCDF file, bit for bit: one group per shape, one variable per field of its class."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np

from ..core.atomic_netcdf import write_atomically
from .arc_chain import ArcChain
from .ball_polyhedron import BallPolyhedron
from .base import GrainShape
from .cone_patches import PatchGrain
from .union import Union

CLASSES = {cls.__name__: cls for cls in (ArcChain, BallPolyhedron, PatchGrain, Union)}
UNITS = {"half_angle": "rad"}


def save_shapes(path, shapes) -> None:
    """Write the shapes to the NetCDF file `path`, which appears whole or not at all.

    Lengths are in units of the shape's own scale, angles in rad. Raises ValueError for anything that is no shape.
    """
    unknown = [s for s in shapes if type(s).__name__ not in CLASSES]
    if unknown:
        raise ValueError(f"shapes: {unknown[0]!r} is not one of {', '.join(CLASSES)}")

    def fill(file):
        file.setncatts(
            {
                "title": "Grain shapes",
                "Conventions": "CF-1.11, ACDD-1.3",
                "summary": "One group per shape; lengths in units of the scale of the shape, body frame.",
                "source": "taichi_lsm",
                "shapes": np.int64(len(shapes)),
            }
        )
        for k, shape in enumerate(shapes):
            _write(file.createGroup(f"shape_{k}"), shape)

    write_atomically(path, fill)


def _write(group, shape: GrainShape) -> None:
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


def load_shapes(path) -> list[GrainShape]:
    """The shapes of a file that `save_shapes` wrote. Raises ValueError naming the file and what is wrong with it."""
    import netCDF4

    path = Path(path)
    if not path.is_file():
        raise ValueError(f"shapes {path}: no such file")
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            if "shapes" not in file.ncattrs():
                raise ValueError(f"shapes {path}: the attribute `shapes` is missing, so it holds no shapes")
            return [_read(_group(file, f"shape_{k}", path), path) for k in range(int(file.shapes))]
    except OSError as error:
        raise ValueError(f"shapes {path}: cannot be read as NetCDF ({error})") from None


def _group(parent, name: str, path: Path):
    if name not in parent.groups:
        raise ValueError(f"shapes {path}: group {name} is missing")
    return parent.groups[name]


def _read(group, path: Path) -> GrainShape:
    name = group.getncattr("class") if "class" in group.ncattrs() else None
    if name not in CLASSES:
        raise ValueError(f"shapes {path}: {group.name} is of class {name!r}, must be one of {', '.join(CLASSES)}")
    values = {}
    for field in fields(CLASSES[name]):
        if field.name == "members":
            count = int(group.members) if "members" in group.ncattrs() else 0
            values["members"] = tuple(_read(_group(group, f"member_{k}", path), path) for k in range(count))
        elif field.name in group.variables:
            array = group.variables[field.name][...]
            values[field.name] = array.item() if array.ndim == 0 else np.asarray(array)
        elif field.name in group.ncattrs():
            values[field.name] = str(group.getncattr(field.name))
        else:
            raise ValueError(f"shapes {path}: {group.name} lacks {field.name}")
    try:
        return CLASSES[name](**values)
    except (ValueError, TypeError, IndexError) as error:
        raise ValueError(f"shapes {path}: {group.name}: {error}") from None
