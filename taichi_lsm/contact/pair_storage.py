"""What a listed pair of grains stores: its grains, force, remembered features and the history of its effects."""

from typing import Any

from ..core.fields import allocate, bytes_per_row, rotation_size, rounded_capacity
from ..core.runtime import ti
from ..core.schema import Variable

PART_BASE = 2**15  # of `part_code`: more parts than any grain has
# Bits of `status`, see `pair_variables`.
TOUCHING = 1
SLIDING = 2
HAS_IMPULSE = 4
ACTING = 8
RESTING = 16


def pair_variables(spec: Any) -> list[Variable]:
    """Schema rows of a slot of the neighbour list: only those that a scene of this KernelSpec needs."""

    def row(name: str, width: str, dtype: str, units: str, long_name: str) -> Variable:
        dims = ("contact", width) if width else ("contact",)
        return Variable(name, dims, dtype, units, long_name, restart=True)

    bits = "bit 1: touching, 2: sliding, 4: has an impulse, 8: within the reach of an effect, 16: has a rest overlap"
    rows = [
        row("first_slot", "", "i32", "1", "slot of the first grain"),
        row("second_slot", "", "i32", "1", "slot of the second grain"),
        row("second_id", "", "i32", "1", "persistent number of the second grain"),
        row("status", "", "i8", "1", bits),
        row("pair_force", "space", "real", "N", "force on the second grain"),
    ]
    if spec.rotates:
        rows.append(row("pair_torque", "rotation", "real", "N m", "torque on the second grain"))
    if spec.onset:
        rows.append(row("pair_impulse", "space", "real", "N s", "impulse on the second grain"))
    if spec.has_angular_impulses:
        long_name = "angular impulse on the second grain"
        rows.append(row("pair_angular_impulse", "rotation", "real", "N m s", long_name))
    if spec.remembers_features:
        rows.append(row("feature", "two", "i32", "1", "features that face each other"))
        rows.append(
            row("free_until", "", "f64", "m", "sum of the path lengths of both grains up to which they cannot touch")
        )
    if spec.remembers_normal:
        rows.append(row("normal", "space", "real", "1", "last normal, first to second"))
    if spec.multi_part:
        rows.append(row("part_code", "", "i32", "1", "first part * 32768 + second part"))
    if spec.history:
        rows.append(row("history", "history", "real", "1", "values kept by the effects"))
    if spec.keeps_losses:
        rows.append(row("pair_loss", "", "f64", "J", "energy dissipated in the last step, by all effects"))
    if spec.has_rest_overlaps:
        rows.append(row("rest_overlap", "", "real", "m", "overlap from which the depth counts since a bond broke"))
    return rows


@ti.data_oriented
class Pairs:
    """Half list in CSR order (each pair at its lower id), its transpose, and what each pair remembers.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    grain_capacity : int
        Rows of grains that the list has room for.
    capacity : int
        Pairs that the list has room for.

    Notes
    -----
    The fields of `pair_variables` are attributes, by list slot. The row of grain k is the slots row_start[k] to
    row_start[k + 1]; its column, the slots in which it is the second grain, is column[column_start[k]] to
    column[column_start[k + 1]]. At a rebuild of the list pairs move to other slots: `save_slot` copies what a pair
    remembers to the fields of `old`, `restore` brings it back to its new slot.
    """

    def __init__(self, spec: Any, grain_capacity: int, capacity: int) -> None:
        self.spec = spec
        self.capacity = rounded_capacity(capacity)
        self.sizes = {"space": spec.dim, "rotation": rotation_size(spec.dim), "history": spec.history, "two": 2}
        self.variables = pair_variables(spec)
        for name, field in vars(allocate(self.variables, self.capacity, self.sizes)).items():
            setattr(self, name, field)
        self._allocate_old()
        self.column = ti.field(ti.i32, self.capacity)
        self.row_start = ti.field(ti.i32, grain_capacity + 1)
        self.column_start = ti.field(ti.i32, grain_capacity + 1)
        self.old_start = ti.field(ti.i32, grain_capacity + 1)
        self.cursor = ti.field(ti.i32, grain_capacity + 1)

    def _allocate_old(self) -> None:
        """Allocate the fields that hold the memory of the pairs during a rebuild.

        Real numbers (normals, histories) are stashed in the pair forces and torques, which are evaluated anew after
        the rebuild anyway: the largest rows need no copy of their own. What does not fit there goes to a row `spare`.
        `stash` lists (field, component, field of the stash, its component).
        """
        spec, dim = self.spec, self.spec.dim
        saved = {"second_id", "part_code", "status", "feature", "free_until", "rest_overlap"}
        self.saved = [v for v in self.variables if v.name in saved]
        # Components that need a place, and those of forces and torques that are free during a rebuild.
        stashed = [("normal", c) for c in range(dim if spec.remembers_normal else 0)]
        stashed += [("history", c) for c in range(spec.history)]
        free = [("pair_force", c) for c in range(dim)]
        free += [("pair_torque", c) for c in range(rotation_size(dim) if spec.rotates else 0)]
        places = [(getattr(self, name), c) for name, c in free[: len(stashed)]]
        # What does not fit gets a field of its own.
        lacking = len(stashed) - len(places)
        if lacking > 0:
            self.sizes["spare"] = lacking
            self.saved.append(Variable("spare", ("contact", "spare"), "real", "1", "values kept over a rebuild"))
        self.old = allocate(self.saved, self.capacity, self.sizes)
        places += [(self.old.spare, c) for c in range(lacking)]
        self.stash = [(getattr(self, name), c, *place) for (name, c), place in zip(stashed, places, strict=True)]

    @ti.func
    def code(self, s):
        """Parts of the two grains to which slot s belongs, as `part_code`; 0 for grains of one part."""
        result = 0
        if ti.static(self.spec.multi_part):
            result = self.part_code[s]
        return result

    @ti.func
    def rank(self, o, s):
        """Order of old slot o relative to slot s of the same row: -1 before, 0 the same pair, 1 after."""
        # Rows rise in the id of the second grain, and among pairs of the same grains in the part.
        result = ti.select(self.old.second_id[o] < self.second_id[s], -1, 1)
        if self.old.second_id[o] == self.second_id[s]:
            result = 0
            if ti.static(self.spec.multi_part):
                if self.old.part_code[o] != self.part_code[s]:
                    result = ti.select(self.old.part_code[o] < self.part_code[s], -1, 1)
        return result

    def bytes_per_pair(self) -> int:
        """Memory of one list slot [bytes], with its copy during a rebuild and its entry in the transpose."""
        return bytes_per_row(self.variables, self.sizes) + bytes_per_row(self.saved, self.sizes) + 4

    @ti.func
    def save_slot(self, s):
        """Copy what slot s remembers to `old`; this overwrites force and torque of the slot with its history."""
        self.old.second_id[s] = self.second_id[s]
        self.old.status[s] = self.status[s]
        if ti.static(self.spec.multi_part):
            self.old.part_code[s] = self.part_code[s]
        if ti.static(self.spec.remembers_features):
            self.old.feature[s] = self.feature[s]
            self.old.free_until[s] = self.free_until[s]
        if ti.static(self.spec.has_rest_overlaps):
            self.old.rest_overlap[s] = self.rest_overlap[s]
        for value, c, stash, place in ti.static(self.stash):
            stash[s][place] = value[s][c]

    @ti.func
    def clear_forces(self, s):
        """Set force, torque and loss of slot s to zero; only after every slot has been restored."""
        self.pair_force[s] = ti.Vector([0.0] * self.sizes["space"])
        if ti.static(self.spec.rotates):
            self.pair_torque[s] = ti.Vector([0.0] * self.sizes["rotation"])
        if ti.static(self.spec.keeps_losses):
            self.pair_loss[s] = 0.0

    @ti.func
    def restore(self, s, o):
        """Copy what old slot o remembered to slot s; a pair that was not listed before (o < 0) starts empty."""
        # A new pair: features unknown, so that the search for them starts from the line of centres.
        self.status[s] = ti.cast(0, ti.i8)
        if ti.static(self.spec.remembers_features):
            self.feature[s] = ti.Vector([-1, -1])
            self.free_until[s] = -1.0
        if ti.static(self.spec.history > 0):
            self.history[s] = ti.Vector([0.0] * self.spec.history)
        if ti.static(self.spec.has_rest_overlaps):
            self.rest_overlap[s] = 0.0
        if o >= 0:
            self.status[s] = self.old.status[o]
            if ti.static(self.spec.remembers_features):
                self.feature[s] = self.old.feature[o]
                self.free_until[s] = self.old.free_until[o]
            if ti.static(self.spec.has_rest_overlaps):
                self.rest_overlap[s] = self.old.rest_overlap[o]
            for value, c, stash, place in ti.static(self.stash):
                value[s][c] = stash[o][place]
