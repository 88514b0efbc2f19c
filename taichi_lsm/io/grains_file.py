"""Snapshots of all grains (grains.nc): constants per grain, the shared shape table, and states in time.

A file of records (`core.record_netcdf`): a snapshot is written behind the last one and then counted, so that it costs
the same however many there are, and a killed run leaves all of those before.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from ..core.record_netcdf import (
    LARGEST,
    RecordAppender,
    create_record_file,
    read_records,
    record_bytes,
    replace_texts,
)
from ..core.schema import Variable
from .global_attributes import RUN_STATUS, require_status, set_global_attributes, utc_now
from .netcdf_variables import (
    TEXT_ROOM,
    Scalar,
    characters,
    checked_array,
    netcdf_type,
    put_labels,
    put_scalars,
    put_text_in_time,
    put_time,
    put_variable,
    require_known,
    require_names,
    rows_by_name,
    text_in_room,
)
from .resumed_file import record_file, require_count, require_rows, resumed_attributes

if TYPE_CHECKING:
    import netCDF4

COMMENT = (
    "Shapes are shared between grains. The patches of shape s are the patch_count[s] consecutive entries of "
    "dimension patch that follow those of the shapes before it (CF contiguous ragged array). Patch centres "
    "and radii are multiples of shape_scale, in the body frame of the shape (origin at the centre of mass). "
    "Grain g has shape s = shape_index[g], counted from 0; the centre of a patch of it lies at position[g] + "
    "shape_scale[g] * R[g] patch_centre, its radius is shape_scale[g] * patch_radius, with R[g] the "
    "rotation by orientation[g] (w, x, y, z; in 2D a rotation about z). A grain is the union of its convex parts. "
    "Where patch_edge_radius r of a part is above 0, the part is a ball-polyhedron: the patches of a larger radius are "
    "its faces, and it is the intersection of the balls of radius patch_radius - r about their centres, dilated by r."
)
INTACT = {"flag_values": [0, 1], "flag_meanings": ["broken", "intact"]}
KIND = {"flag_values": [0, 1], "flag_meanings": ["mobile", "glued"]}
STATIC_DIMS = ("grain", "space", "quaternion", "shape", "patch")
LONGEST_STATUS = max(RUN_STATUS, key=len)  # keeps the room for the others


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
        Variable("patch_part", ("patch",), "i32", "1", "convex part of the shape that the patch bounds, from 0 on"),
        Variable("patch_edge_radius", ("patch",), "f64", "1", "radius of the edges of that part over shape_scale"),
    ] + [
        Variable("bond_first", ("bond",), "i32", "1", "index of the first grain of the bond"),
        Variable("bond_second", ("bond",), "i32", "1", "index of the second grain of the bond"),
        Variable("bond_area", ("bond",), "f64", "m2", "area of the section of the bond"),
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
    """Snapshots of all grains, each of which is on the disk when `append` returns, unless `shares` is set.

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
    keep
        None makes a new file. A number takes over the file at `path`, which a former process wrote with the same
        declaration: its first `keep` snapshots stay, later ones are dropped, and its date_created, id and history are
        kept. The parameters (`scalars`) and other attributes are those given here.
    shares
        Snapshots that follow each other fast share their way to the disk (`core.record_netcdf.RecordAppender`): a kill
        loses those since the last `flush`, which takes place by itself every few seconds.

    Raises
    ------
    InputError
        Names the row if a name, a shape or a type does not fit, or a variable is too large for the file; names the file
        and what differs if it cannot be taken over. It is then unchanged.
    SimulationError
        If the file cannot be written (`core.whole_files`).
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
        keep: int | None = None,
        shares: bool = False,
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
        self._require_sizes()
        self._last_time = -np.inf
        records = () if keep is None else self._kept_records(keep)
        layout = create_record_file(self.path, self._fill, {"run_status": self.run_status}, records)
        self._records = RecordAppender(self.path, layout, shares)

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

    def _require_sizes(self) -> None:
        """Refuse variables that are larger than the format allows."""
        for name, variable in {**self.static_variables, **self.variables}.items():
            shape = self._shape(d for d in variable.dims if d != "time")
            size = math.prod(shape) * netcdf_type(variable, self.precision).itemsize
            if not 0 < size <= LARGEST:
                raise InputError(f"{name}: shape {shape}, {size} bytes; allowed are 1 to {LARGEST} bytes")

    def _kept_records(self, keep: int) -> Iterable[bytes]:
        """The first `keep` snapshots of the file that is there, as they lie in it, if the file fits.

        The file is made anew with them, for its history grows.
        """
        require_count(self.path, keep)
        with record_file(self.path, self._fill, [scalar.name for scalar in self.scalars]) as (there, layout):
            require_rows(self.path, keep, layout.whole, "whole snapshots")
            self.attributes = resumed_attributes(self.attributes, there)
            if keep:
                self._last_time = float(there["time"][keep - 1])
        return read_records(self.path, layout, keep)

    @property
    def last_time(self) -> float:
        """Time of the last snapshot [s], -inf before the first."""
        return self._last_time

    def append(self, time: float, arrays: Mapping[str, npt.ArrayLike]) -> None:
        """Write one snapshot at `time` [s] behind the others; arrays: {name: array without the dimension time}.

        Raises
        ------
        InputError
            And keeps nothing of the snapshot, if a name, a shape or a type does not fit, time does not increase, or the
            writer is closed.
        SimulationError
            And keeps nothing of the snapshot, if it cannot be written; the earlier ones stay readable.
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
        texts = {name: characters(np.array(text_in_room(name, arrays[name]), object), TEXT_ROOM) for name in self.text}
        record = {"time": np.float64(time), **checked, **texts}
        self._records.append(record_bytes(self._records.layout, record))
        self._last_time = float(time)
        if self._records.due:
            self.flush()

    def flush(self) -> None:
        """Bring all snapshots to the disk."""
        self._records.flush()

    def close(self, run_status: str) -> None:
        """Write the final run_status: complete, failed or interrupted. It has its room in the file, and costs none."""
        require_status(run_status, RUN_STATUS[1:])
        self.run_status = run_status
        self.flush()
        replace_texts(self.path, self._records.layout, {"run_status": run_status, "date_modified": utc_now()})

    def _fill(self, dataset: "netCDF4.Dataset") -> None:
        """Write what does not change, and declare the rest."""
        set_global_attributes(dataset, self.attributes, LONGEST_STATUS)
        # In a fixed order, so that equal runs give equal files.
        for dimension in sorted(self.sizes, key=lambda d: (d not in STATIC_DIMS, d)):
            if dimension not in self.labels:
                dataset.createDimension(dimension, self.sizes[dimension])
        put_time(dataset, np.empty(0))
        used = {d for v in (*self.static_variables.values(), *self.variables.values()) for d in v.dims}
        labels = put_labels(dataset, {d: texts for d, texts in self.labels.items() if d in used})
        in_time = [name for name, variable in self.variables.items() if variable.dims == ("time",)]
        labels = (*labels, *put_scalars(dataset, self.scalars), *self.text, *in_time)
        for name, long_name in self.text.items():
            put_text_in_time(dataset, name, long_name, np.empty(0, dtype=object), TEXT_ROOM)
        # Coordinates first: a variable can only be attached to what is there.
        for name in sorted(self.variables, key=lambda name: name not in in_time):
            variable = self.variables[name]
            none = np.empty((0, *self._shape(variable.dims[1:])), netcdf_type(variable, self.precision))
            put_variable(dataset, variable, none, self.extra.get(name), () if name in in_time else labels)
        for name, variable in self.static_variables.items():
            put_variable(dataset, variable, self.static[name], self.extra.get(name), labels)
