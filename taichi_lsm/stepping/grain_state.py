"""The state of the grains, allocated from schema rows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.allocation import read, when_allocated, write
from ..core.field_copies import NUMPY_TYPES
from ..core.fields import allocate, orientation_size, rotation_size, rounded_capacity
from ..core.runtime import ti
from ..core.schema import Variable


def grain_variables(spec: Any) -> list[Variable]:
    """Schema rows of the grain state that a scene of this KernelSpec needs; all are needed to continue a run."""

    def row(name, width, dtype, units, long_name):
        dims = ("grain", width) if width else ("grain",)
        return Variable(name, dims, dtype, units, long_name, restart=True)

    rows = [
        row("id", "", "i32", "1", "persistent number of the grain in this slot"),
        row("platen_index", "", "i32", "1", "platen the grain is glued to, -1 if mobile"),
        row("position", "space", "f64", "m", "centre of mass"),
        row("radius", "", "real", "m", "bounding radius"),
        row("velocity", "space", "f64", "m s-1", "velocity half a step before position"),
        row("inverse_mass", "", "real", "kg-1", "inverse mass"),
        row("force", "space", "real", "N", "force of the contacts in the grain's own row of the list"),
        row("built_position", "space", "f64", "m", "position when the list was built"),
    ]
    if spec.rotates:
        rows += [
            row("angular_velocity", "rotation", "f64", "rad s-1", "angular velocity half a step before position"),
            row("inverse_inertia", "rotation", "real", "kg-1 m-2", "inverse principal moments of inertia"),
            row("torque", "rotation", "real", "N m", "torque of the contacts in the grain's own row of the list"),
        ]
    if spec.onset:
        rows += [
            row("last_velocity", "space", "f64", "m s-1", "velocity a step before"),
            row("has_impulse", "", "i8", "1", "1 if a contact of the grain's own row has an impulse"),
        ]
    if spec.has_angular_impulses:
        rows += [
            row("last_angular_velocity", "rotation", "f64", "rad s-1", "angular velocity a step before"),
            row("angular_impulse", "rotation", "real", "N m s", "angular impulse of the contacts in the own row"),
        ]
    if spec.oriented:
        rows.append(row("orientation", "orientation", "f64", "1", "unit complex number (2D) or quaternion (3D)"))
    if spec.tumbles:
        rows.append(
            row(
                "angular_momentum",
                "rotation",
                "f64",
                "kg m2 s-1",
                "angular momentum half a step before position, world frame",
            )
        )
    if spec.multi_part:
        rows.append(row("built_orientation", "orientation", "f64", "1", "orientation when the list was built"))
    if spec.shaped:
        rows += [
            row("shape_index", "", "i32", "1", "row of the shape table"),
            row("diameter", "", "real", "m", "equivalent diameter, the length unit of the shape"),
            row("overlap_limit", "", "real", "m", "least radius of curvature, which limits the overlap"),
            row("travel", "", "f64", "m", "upper bound of the path length of the farthest surface point so far"),
        ]
    if spec.has_equivalent_radius:
        rows.append(row("equivalent_radius", "", "real", "m", "radius of the disc or sphere of equal area or volume"))
    if spec.sheared:
        rows.append(row("shear_work", "", "f64", "J", "work of shearing the cell on the contacts of the own row"))
    if spec.cell_servo:
        rows.append(row("virial", "", "f64", "J", "share of the own row and motion in normal stress times volume"))
    if spec.tracks_dissipation:
        rows.append(row("dissipated", "channel", "f64", "J", "energy dissipated, by effect"))
    if spec.keeps_losses:
        rows.append(row("parted_loss", "", "f64", "J", "loss in the last step of contacts of the own row that ended"))
    return rows


@ti.data_oriented
class Grains:
    """Varying state of all grains, in slots that are re-sorted for locality; `id` never changes.

    The fields of `grain_variables` are attributes. Columns by persistent id are read with `column`.
    """

    def __init__(self, spec):
        self.dim, count, variables = spec.dim, spec.count, grain_variables(spec)
        self.count = ti.field(ti.i32, ())
        self.number = count  # the same on the host
        self.sizes = {
            "space": spec.dim,
            "rotation": rotation_size(spec.dim),
            "orientation": orientation_size(spec.dim),
            "channel": spec.channels,
        }
        self.variables = {v.name: v for v in variables}
        capacity = rounded_capacity(count)
        for name, field in vars(allocate(variables, capacity, self.sizes)).items():
            setattr(self, name, field)
        self.slot_of = ti.field(ti.i32, capacity)
        self.previous_slot = ti.field(ti.i32, capacity)
        when_allocated(lambda: self._begin(count))

    def _begin(self, count):
        """Put grain k into slot k."""
        write(self.count, count)
        self.slots = np.arange(count)  # of each id: what slot_of holds
        for number in (self.id, self.slot_of, self.previous_slot):
            write(number, np.arange(self.slot_of.shape[0]))

    if TYPE_CHECKING:  # the fields of `grain_variables`

        def __getattr__(self, name: str) -> Any: ...

    def __len__(self):
        return self.number

    def has(self, name: str) -> bool:
        """Whether this scene carries the state row `name`."""
        return name in self.variables

    def column(self, name: str) -> NDArray:
        """State row `name` as a NumPy array (grain, ...), ordered by persistent id."""
        return read(getattr(self, name))[self.slots]

    def set_column(self, name: str, values: ArrayLike) -> None:
        """Write a state row given in the order of persistent ids."""
        field = getattr(self, name)
        width = (field.n,) if isinstance(field, ti.MatrixField) else ()
        raw = np.zeros((self.slot_of.shape[0], *width), NUMPY_TYPES[field.dtype])
        raw[self.slots] = values
        write(field, raw)

    def set_order(self, id_of_slot: NDArray) -> None:
        """Declare which grain each slot holds; the state rows themselves are not moved."""
        count, capacity = len(id_of_slot), self.slot_of.shape[0]
        padded = np.zeros(capacity, np.int32)
        padded[:count] = id_of_slot
        write(self.id, padded)
        padded[id_of_slot] = np.arange(count)
        self.slots = padded[:count].copy()
        write(self.slot_of, padded)
        write(self.previous_slot, np.arange(capacity))

    def reorder(self, order: NDArray) -> None:
        """Move the grain of slot order[s] to slot s, in every row. Results do not depend on the order."""
        # Rows beyond the grains in use stay as they are.
        ids = read(self.id, len(self))[order]
        for name in self.variables:
            field = getattr(self, name)
            write(field, read(field, len(self))[order])
        self.set_order(ids)
        previous = np.arange(self.slot_of.shape[0], dtype=np.int32)
        previous[: len(self)] = order
        write(self.previous_slot, previous)


class StateView:
    """`sim.state.<name>.to_numpy()`: a state row by persistent id. `from_numpy` writes one."""

    def __init__(self, grains, changed):
        self._grains, self._changed = grains, changed

    def __getattr__(self, name):
        if name.startswith("_") or not self._grains.has(name):
            raise AttributeError(f"no state {name!r} in this scene; it has {', '.join(sorted(self._grains.variables))}")
        return _Column(self._grains, name, self._changed)


@dataclass(frozen=True)
class _Column:
    grains: Grains
    name: str
    changed: Callable

    def to_numpy(self):
        return self.grains.column(self.name)

    def from_numpy(self, values):
        self.grains.set_column(self.name, values)
        self.changed()
