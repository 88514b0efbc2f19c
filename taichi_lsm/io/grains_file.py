"""Snapshots of all grains (grains.nc): constants per grain, the shared shape table, and states in time."""

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.atomic_netcdf import write_atomically
from ..core.errors import InputError
from ..core.schema import Variable
from .netcdf_variables import (
    Scalar,
    checked_array,
    checked_text,
    netcdf_type,
    put_labels,
    put_scalars,
    put_text_in_time,
    put_time,
    put_variable,
    require_known,
    require_names,
    rows_by_name,
)
from .run_file import RUN_STATUS, require_status, set_global_attributes

if TYPE_CHECKING:
    import netCDF4

COMMENT = (
    "Shapes are shared between grains. The patches of shape s are the patch_count[s] consecutive entries of "
    "dimension patch that follow those of the shapes before it (CF contiguous ragged array). Patch centres "
    "and radii are multiples of shape_scale, in the body frame of the shape (origin at the centre of mass). "
    "Grain g has shape s = shape_index[g], counted from 0; the centre of a patch of it lies at position[g] + "
    "shape_scale[g] * R[g] patch_centre, its radius is shape_scale[g] * patch_radius, with R[g] the "
    "rotation by orientation[g] (w, x, y, z; in 2D a rotation about z)."
)
INTACT = {"flag_values": [0, 1], "flag_meanings": ["broken", "intact"]}
KIND = {"flag_values": [0, 1], "flag_meanings": ["mobile", "glued"]}
STATIC_DIMS = ("grain", "space", "quaternion", "shape", "patch")


def static_rows(dim: int, bonded: bool = False) -> list[Variable]:
    """Schema rows of what does not change: per grain, per patch of the shape table, per bond. dim: 2 or 3."""
    inertia = ("grain",) if dim == 2 else ("grain", "space")
    return [
        Variable("mass", ("grain",), "f64", "kg", "mass of the grain"),
        Variable("inertia", inertia, "f64", "kg m2", "principal moments of inertia about the centre of mass"),
        Variable("bounding_radius", ("grain",), "f64", "m", "radius of the smallest known bounding ball"),
        Variable("kind", ("grain",), "i32", "1", "whether the grain moves freely or is glued to a platen"),
        Variable("shape_index", ("grain",), "i32", "1", "index of the grain's shape along dimension shape"),
        Variable("shape_scale", ("grain",), "f64", "m", "length unit of the grain's shape"),
        Variable("patch_count", ("shape",), "i32", "1", "number of patches of the shape"),
        Variable("patch_centre", ("patch", "space"), "f64", "1", "patch centre over shape_scale, body frame"),
        Variable("patch_radius", ("patch",), "f64", "1", "patch radius over shape_scale"),
        Variable("patch_axis", ("patch", "space"), "f64", "1", "outward unit axis of the patch, body frame"),
        Variable("patch_angle", ("patch",), "f64", "rad", "angle between the axis and the edge of the patch"),
    ] + [
        Variable("bond_first", ("bond",), "i32", "1", "index of the first grain of the bond"),
        Variable("bond_second", ("bond",), "i32", "1", "index of the second grain of the bond"),
    ] * bonded


def snapshot_rows(dim: int, rotates: bool = True, oriented: bool = True, bonded: bool = False) -> list[Variable]:
    """Schema rows of a snapshot in 2 or 3 dimensions.

    Without `rotates` there is no angular velocity, without `oriented` no orientation, without `bonded` no bonds.
    """
    angular_velocity = ("time", "grain") if dim == 2 else ("time", "grain", "space")
    rows = [
        Variable("position", ("time", "grain", "space"), "f64", "m", "centre of mass"),
        Variable("velocity", ("time", "grain", "space"), "f64", "m s-1", "velocity of the centre of mass"),
    ]
    if rotates:
        rows.append(Variable("angular_velocity", angular_velocity, "f64", "rad s-1", "angular velocity, world frame"))
    if oriented:
        rows.append(
            Variable(
                "orientation",
                ("time", "grain", "quaternion"),
                "f64",
                "1",
                "unit quaternion w, x, y, z that rotates the body frame into the world frame",
            )
        )
    if bonded:
        rows.append(Variable("bond_intact", ("time", "bond"), "i32", "1", "whether the bond holds"))
    return rows


class GrainsWriter:
    """Snapshots of all grains; the whole file is rewritten at every `append`, so keep snapshots few.

    Parameters
    ----------
    path
        The file, written at once with run_status "running".
    static
        {name: array} for the rows static_variables, which give the dimensions grain, space, shape and patch their
        lengths; `patch_count` (shape,) adds up to that of patch.
    static_variables
        Schema rows of what does not change.
    variables
        Schema rows of a snapshot; rows without time get it as their first dimension.
    attributes
        Global attributes, see `file_attributes`.
    coordinates
        Labels of further dimensions; space and quaternion have their own.
    extra_attributes
        {name: attributes}; `kind` has its flags.
    precision
        "f64" or "f32": how rows of dtype "real" are stored.
    text
        {name: long_name} of texts along time, such as the stage.
    scalars
        What holds for the whole file, such as the parameters. These, the texts and snapshot rows with no dimension but
        time, such as the shear strain, serve the others as coordinates.

    Raises
    ------
    InputError
        Names the row if a name, a shape or a type does not fit.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        static: Mapping[str, npt.ArrayLike],
        static_variables: Iterable[Variable],
        variables: Iterable[Variable],
        attributes: Mapping[str, Any],
        coordinates: Mapping[str, Sequence[str]] | None = None,
        extra_attributes: Mapping[str, Mapping[str, Any]] | None = None,
        precision: str = "f64",
        text: Mapping[str, str] | None = None,
        scalars: Sequence[Scalar] = (),
    ) -> None:
        self.path = Path(path)
        self.text, self.scalars = dict(text or {}), tuple(scalars)
        self.precision = precision
        self.run_status = "running"
        self.attributes = {**attributes, "comment": COMMENT}
        declared = rows_by_name([*static_variables, *(self._in_time(v) for v in variables)])
        self.static_variables = {n: v for n, v in declared.items() if v.dims[:1] != ("time",)}
        self.variables = {n: v for n, v in declared.items() if v.dims[:1] == ("time",)}
        require_names(static, self.static_variables, f"constants of {self.path.name}")
        self.sizes = self._sizes_of(static, coordinates or {})
        self.labels = {
            "space": list("xyz")[: self.sizes["space"]],
            "quaternion": list("wxyz"),
            **{name: list(texts) for name, texts in (coordinates or {}).items()},
        }
        self.static = {
            name: checked_array(v, static[name], self._shape(v.dims), precision)
            for name, v in self.static_variables.items()
        }
        self._check_ragged()
        require_known("extra_attributes", extra_attributes or {}, declared)
        self.extra = {"kind": KIND, "bond_intact": INTACT, **(extra_attributes or {})}
        if "patch_count" in self.static:
            self.extra["patch_count"] = {"sample_dimension": "patch", **self.extra.get("patch_count", {})}
        self._times = []
        self._snapshots = {name: [] for name in (*self.variables, *self.text)}
        self._write()

    @staticmethod
    def _in_time(variable: Variable) -> Variable:
        if variable.dims[:1] == ("time",):
            return variable
        dims = ("time", *variable.dims)
        return Variable(variable.name, dims, variable.dtype, variable.units, variable.long_name)

    def _sizes_of(self, static: Mapping[str, npt.ArrayLike], labels: Mapping[str, Sequence[str]]) -> dict[str, int]:
        """Lengths of all dimensions: of the labelled ones, then as the constants have them."""
        sizes = {"quaternion": 4, **{name: len(texts) for name, texts in labels.items()}}
        for name, variable in self.static_variables.items():
            shape = np.shape(static[name])
            if len(shape) != len(variable.dims):
                raise InputError(f"{name}: shape {shape}, allowed are the dimensions {variable.dims}")
            for dimension, size in zip(variable.dims, shape, strict=True):
                sizes.setdefault(dimension, size)
        used = {d for v in self.variables.values() for d in v.dims[1:]} | {"grain", "space"}
        unknown = sorted(used - set(sizes))
        if unknown:
            raise InputError(f"dimension {', '.join(unknown)}: no constant and no labels give its length")
        if sizes["space"] not in (2, 3):
            raise InputError(f"dimension space: length {sizes['space']}, allowed are 2 and 3")
        return sizes

    def _shape(self, dims: Iterable[str]) -> tuple[int, ...]:
        return tuple(self.sizes[d] for d in dims)

    def _check_ragged(self) -> None:
        """Refuse counts of patches that do not add up to the patches, and shapes that do not exist."""
        if "patch" not in self.sizes:
            return
        if "patch_count" not in self.static:
            raise InputError("patch_count: missing; needed to tell the patches of one shape from the next")
        total = int(self.static["patch_count"].sum())
        if total != self.sizes["patch"] or self.static["patch_count"].min() < 1:
            raise InputError(
                f"patch_count: adds up to {total}, must be positive and add up to the "
                f"{self.sizes['patch']} patches given"
            )
        index = self.static.get("shape_index")
        if index is not None and (index.min() < 0 or index.max() >= self.sizes["shape"]):
            last = self.sizes["shape"] - 1
            raise InputError(f"shape_index: {index.min()}..{index.max()}, allowed are 0..{last}")

    @property
    def last_time(self) -> float:
        """Time of the last snapshot [s], -inf before the first."""
        return self._times[-1] if self._times else -np.inf

    def append(self, time: float, arrays: Mapping[str, npt.ArrayLike]) -> None:
        """Add one snapshot at `time` [s] and write the file; arrays: {name: array without the dimension time}.

        Raises
        ------
        InputError
            And keeps nothing of the snapshot, if a name, a shape or a type does not fit, time does not increase, or the
            writer is closed.
        """
        if self.run_status != "running":
            raise InputError(f"{self.path.name} is closed ({self.run_status}); no snapshot can be appended")
        require_names(arrays, [*self.variables, *self.text], f"snapshot of {self.path.name}")
        if not (np.isfinite(time) and time > self.last_time):
            raise InputError(f"time: {time} s, must be finite and above the last snapshot's {self.last_time} s")
        checked = {
            name: checked_array(v, arrays[name], self._shape(v.dims[1:]), self.precision)
            for name, v in self.variables.items()
        }
        texts = {name: checked_text(name, arrays[name]) for name in self.text}
        self._times.append(float(time))
        for name, array in {**checked, **texts}.items():
            self._snapshots[name].append(array)
        self._write()

    def close(self, run_status: str) -> None:
        """Write the file with the final run_status: complete, failed or interrupted."""
        require_status(run_status, RUN_STATUS[1:])
        self.run_status = run_status
        self._write()

    def _write(self) -> None:
        write_atomically(self.path, self._fill)

    def _fill(self, dataset: "netCDF4.Dataset") -> None:
        set_global_attributes(dataset, self.attributes, self.run_status)
        # In a fixed order, so that equal runs give equal files.
        for dimension in sorted(self.sizes, key=lambda d: (d not in STATIC_DIMS, d)):
            if dimension not in self.labels:
                dataset.createDimension(dimension, self.sizes[dimension])
        put_time(dataset, np.array(self._times))
        used = {d for v in (*self.static_variables.values(), *self.variables.values()) for d in v.dims}
        labels = put_labels(dataset, {d: texts for d, texts in self.labels.items() if d in used})
        in_time = [name for name, variable in self.variables.items() if variable.dims == ("time",)]
        labels = (*labels, *put_scalars(dataset, self.scalars), *self.text, *in_time)
        for name, long_name in self.text.items():
            put_text_in_time(dataset, name, long_name, np.array(self._snapshots[name], dtype=object))
        # Coordinates first: a variable can only be attached to what is there.
        for name in sorted(self.variables, key=lambda name: name not in in_time):
            variable = self.variables[name]
            array = np.empty((len(self._times), *self._shape(variable.dims[1:])), netcdf_type(variable, self.precision))
            for i, snapshot in enumerate(self._snapshots[name]):
                array[i] = snapshot
            put_variable(dataset, variable, array, self.extra.get(name), () if name in in_time else labels)
        for name, variable in self.static_variables.items():
            put_variable(dataset, variable, self.static[name], self.extra.get(name), labels)
