"""The state of the grains, allocated from schema rows."""

import numpy as np

from ..core.fields import NUMPY_TYPES, allocate, orientation_size, rotation_size, rounded_capacity
from ..core.runtime import ti, when_allocated
from ..core.schema import Variable


def grain_variables(
    rotates, oriented, shaped, track_dissipation, onset=False, tumbles=False, multi_part=False, sheared=False
):
    """Rows of the grain state that a scene needs.

    rotates: torques act on the grains; oriented: their orientation matters; shaped: more than one patch per grain;
    ledger: number of effects that book dissipated energy; onset: contacts begin and end with impulses; tumbles:
    oriented in 3D, where the angular momentum is the state and the spin follows from it; several: grains of
    several parts, whose places turn with the grain; sheared: the cell is in homogeneous shear.
    """
    rows = [
        Variable("id", ("grain",), "i32", "1", "persistent number of the grain in this slot", True),
        Variable("platen_index", ("grain",), "i32", "1", "platen the grain is glued to, -1 if mobile", True),
        Variable("position", ("grain", "space"), "f64", "m", "centre of mass", True),
        Variable("radius", ("grain",), "real", "m", "bounding radius", True),
        Variable("velocity", ("grain", "space"), "f64", "m s-1", "velocity half a step before position", True),
        Variable("inverse_mass", ("grain",), "real", "kg-1", "inverse mass", True),
        Variable("force", ("grain", "space"), "real", "N", "force of the contacts in the grain's own row", True),
        Variable("built_position", ("grain", "space"), "f64", "m", "position when the list was built", True),
    ]
    if rotates:
        rows += [
            Variable(
                "angular_velocity", ("grain", "rotation"), "f64", "rad s-1", "angular velocity half a step before", True
            ),
            Variable("inverse_inertia", ("grain", "rotation"), "real", "kg-1 m-2", "inverse principal moments", True),
            Variable("torque", ("grain", "rotation"), "real", "N m", "torque of the contacts in the own row", True),
        ]
    if onset:
        rows.append(Variable("last_velocity", ("grain", "space"), "f64", "m s-1", "velocity a step before", True))
        if shaped:
            rows.append(
                Variable("last_angular_velocity", ("grain", "rotation"), "f64", "rad s-1", "spin a step before", True)
            )
            rows.append(
                Variable(
                    "angular_impulse", ("grain", "rotation"), "real", "N m s", "angular impulse from the row", True
                )
            )
        rows.append(
            Variable("has_impulse", ("grain",), "i8", "1", "1 if a contact of its own row has an impulse", True)
        )
    if oriented:
        rows.append(
            Variable("orientation", ("grain", "orientation"), "f64", "1", "unit complex number or quaternion", True)
        )
    if tumbles:
        long_name = "angular momentum half a step before, world frame"
        rows.append(Variable("angular_momentum", ("grain", "rotation"), "f64", "kg m2 s-1", long_name, True))
    if multi_part:
        long_name = "orientation when the list was built"
        rows.append(Variable("built_orientation", ("grain", "orientation"), "f64", "1", long_name, True))
    if shaped:
        rows += [
            Variable("shape_index", ("grain",), "i32", "1", "row of the shape table", True),
            Variable("diameter", ("grain",), "real", "m", "length unit of the shape", True),
            Variable("overlap_limit", ("grain",), "real", "m", "least curvature radius, limits the depth", True),
            Variable("travel", ("grain",), "f64", "m", "way of the farthest surface point so far, at most", True),
        ]
    if sheared:
        rows.append(Variable("shear_work", ("grain",), "f64", "J", "work of shearing the cell, of its row", True))
    if track_dissipation:
        rows.append(Variable("dissipated", ("grain", "channel"), "f64", "J", "energy dissipated by effect", True))
    return rows


@ti.data_oriented
class Grains:
    """Varying state of all grains, in slots that are re-sorted for locality; `id` never changes.

    The fields of `grain_variables` are attributes. Columns by persistent id are read with `column`.
    """

    def __init__(self, dim, count, variables, channels):
        self.dim = dim
        self.count = ti.field(ti.i32, ())
        self.sizes = {
            "space": dim,
            "rotation": rotation_size(dim),
            "orientation": orientation_size(dim),
            "channel": channels,
        }
        self.variables = {v.name: v for v in variables}
        capacity = rounded_capacity(count)
        for name, field in vars(allocate(variables, capacity, self.sizes)).items():
            setattr(self, name, field)
        self.slot_of = ti.field(ti.i32, capacity)
        self.previous_slot = ti.field(ti.i32, capacity)
        when_allocated(lambda: self._begin(count))

    def _begin(self, count):
        self.count[None] = count
        self.slots = np.arange(count)  # of each id: what slot_of holds
        self.number_slots()

    @ti.kernel
    def number_slots(self):
        ti.loop_config(serialize=True)
        for k in range(self.slot_of.shape[0]):
            self.id[k] = self.slot_of[k] = self.previous_slot[k] = k

    def __len__(self):
        return int(self.count[None])

    def has(self, name):
        """Does this scene carry the state row `name`?"""
        return name in self.variables

    def column(self, name):
        """State row `name` as a NumPy array (grain, ...), ordered by persistent id."""
        return getattr(self, name).to_numpy()[self.slots]

    def set_column(self, name, values):
        """Write a state row given in the order of persistent ids."""
        field = getattr(self, name)
        width = (field.n,) if isinstance(field, ti.MatrixField) else ()
        raw = np.zeros((self.slot_of.shape[0], *width), NUMPY_TYPES[field.dtype])
        raw[self.slots] = values
        field.from_numpy(raw)

    def set_order(self, id_of_slot):
        """Declare which grain each slot holds; the state rows themselves are not moved."""
        count, capacity = len(id_of_slot), self.slot_of.shape[0]
        padded = np.zeros(capacity, np.int32)
        padded[:count] = id_of_slot
        self.id.from_numpy(padded)
        padded[id_of_slot] = np.arange(count)
        self.slots = padded[:count].copy()
        self.slot_of.from_numpy(padded)
        self.previous_slot.from_numpy(np.arange(capacity, dtype=np.int32))

    def reorder(self, order):
        """Move the grain of slot order[s] to slot s, in every row. Results do not depend on the order."""
        ids = self.id.to_numpy()[: len(self)][order]
        for name in self.variables:
            raw = getattr(self, name).to_numpy()
            raw[: len(self)] = raw[order]
            getattr(self, name).from_numpy(raw)
        self.set_order(ids)
        previous = np.arange(self.slot_of.shape[0], dtype=np.int32)
        previous[: len(self)] = order
        self.previous_slot.from_numpy(previous)
