"""What a listed pair of grains stores: partner, force, cached features and the history of its effects."""

from ..core.fields import allocate, bytes_per_row, rotation_size, rounded_capacity
from ..core.runtime import ti
from ..core.schema import Variable

PART_BASE = 2**15  # of `part_code`: more parts than any grain has
# Bits of `status`.
TOUCHING = 1
SLIDING = 2
HAS_IMPULSE = 4
ACTING = 8


def pair_variables(rotates, kind, history, onset=False, multi_part=False):
    """Rows stored per slot of the neighbour list.

    kind: of the surfaces, sphere | chain | polyhedron | cones; history: number of values that the effects remember;
    onset: impulses correct the begin and end of contacts; several: each slot is a pair of parts of the grains.
    """
    shaped = kind in ("chain", "polyhedron")
    rows = [
        Variable("first", ("contact",), "i32", "1", "slot of the first grain", True),
        Variable("partner", ("contact",), "i32", "1", "slot of the second grain", True),
        Variable("partner_id", ("contact",), "i32", "1", "persistent number of the second grain", True),
        Variable(
            "status",
            ("contact",),
            "i8",
            "1",
            "bit 1: touching, 2: sliding, 4: kicked, 8: within the reach of a law",
            True,
        ),
        Variable("pair_force", ("contact", "space"), "real", "N", "force on the second grain", True),
    ]
    if rotates:
        rows.append(Variable("pair_torque", ("contact", "rotation"), "real", "N m", "torque on the second grain", True))
    if onset:
        rows += [
            Variable("pair_impulse", ("contact", "space"), "real", "N s", "impulse on the second grain", True),
        ]
        if kind != "sphere":  # it goes through the centres of two spheres
            long_name = "angular impulse on the second grain"
            rows.append(Variable("pair_angular_impulse", ("contact", "rotation"), "real", "N m s", long_name, True))
    if shaped:
        rows.append(Variable("feature", ("contact", "two"), "i32", "1", "features that face each other", True))
        long_name = "sum of both grains' travel up to which they cannot touch"
        rows.append(Variable("free_until", ("contact",), "f64", "m", long_name, True))
    if kind == "polyhedron":
        rows.append(Variable("normal", ("contact", "space"), "real", "1", "last normal, first to second", True))
    if multi_part:
        rows.append(Variable("part_code", ("contact",), "i32", "1", "first part * 32768 + second part", True))
    if history:
        rows.append(Variable("history", ("contact", "history"), "real", "1", "values kept by the effects", True))
    return rows


@ti.data_oriented
class Pairs:
    """Half list in CSR order (each pair at its lower id) and its transpose, with the pair's memory per slot."""

    def __init__(self, dim, grain_capacity, capacity, rotates, kind, history, onset=False, multi_part=False):
        self.capacity = rounded_capacity(capacity)
        self.history_size = history
        self.kind = kind
        self.rotates = rotates
        self.onset = onset
        self.multi_part = multi_part
        self.remembers_feature = kind in ("chain", "polyhedron")
        self.remembers_normal = kind == "polyhedron"
        self.sizes = {"space": dim, "rotation": rotation_size(dim), "history": history, "two": 2}
        self.variables = pair_variables(rotates, kind, history, onset, multi_part)
        for name, field in vars(allocate(self.variables, self.capacity, self.sizes)).items():
            setattr(self, name, field)
        kept = {"partner_id", "part_code", "status", "feature", "free_until"}
        self.kept = [v for v in self.variables if v.name in kept]
        self.stash = self._stash_places(dim, rotates)
        self.column = ti.field(ti.i32, self.capacity)
        self.row_start = ti.field(ti.i32, grain_capacity + 1)
        self.column_start = ti.field(ti.i32, grain_capacity + 1)
        self.old_start = ti.field(ti.i32, grain_capacity + 1)
        self.cursor = ti.field(ti.i32, grain_capacity + 1)

    def _stash_places(self, dim, rotates):
        """Places (field, component, field of the shelf, component) of the real numbers that survive a rebuild: in the
        forces of the pair, which are evaluated anew after it, and what does not fit there in a row of its own."""
        stashed = [("normal", c) for c in range(dim if self.remembers_normal else 0)]
        stashed += [("history", c) for c in range(self.history_size)]
        room = [("pair_force", c) for c in range(dim)]
        room += [("pair_torque", c) for c in range(rotation_size(dim) if rotates else 0)]
        places = [(getattr(self, name), c) for name, c in room[: len(stashed)]]
        lacking = len(stashed) - len(places)
        if lacking > 0:
            self.sizes["spare"] = lacking
            self.kept.append(Variable("spare", ("contact", "spare"), "real", "1", "values kept over a rebuild"))
        self.old = allocate(self.kept, self.capacity, self.sizes)
        places += [(self.old.spare, c) for c in range(lacking)]
        return [(getattr(self, name), c, *place) for (name, c), place in zip(stashed, places, strict=True)]

    @ti.func
    def code(self, s):
        """Which parts of the two grains list slot `s` is about; 0 for grains of one part."""
        result = 0
        if ti.static(self.multi_part):
            result = self.part_code[s]
        return result

    @ti.func
    def rank(self, o, s):
        """Order of old slot `o` against slot `s` of the same row: -1 before, 0 the same pair, 1 after."""
        result = ti.select(self.old.partner_id[o] < self.partner_id[s], -1, 1)
        if self.old.partner_id[o] == self.partner_id[s]:
            result = 0
            if ti.static(self.multi_part):
                if self.old.part_code[o] != self.part_code[s]:
                    result = ti.select(self.old.part_code[o] < self.part_code[s], -1, 1)
        return result

    def bytes_per_pair(self):
        """Memory of one list slot, the copy needed at a rebuild and the transpose included [bytes]."""
        return bytes_per_row(self.variables, self.sizes) + bytes_per_row(self.kept, self.sizes) + 4

    @ti.func
    def keep(self, s):
        """Copy what must survive a rebuild of the list."""
        self.old.partner_id[s] = self.partner_id[s]
        self.old.status[s] = self.status[s]
        if ti.static(self.multi_part):
            self.old.part_code[s] = self.part_code[s]
        if ti.static(self.remembers_feature):
            self.old.feature[s] = self.feature[s]
            self.old.free_until[s] = self.free_until[s]
        for value, c, shelf, place in ti.static(self.stash):
            shelf[s][place] = value[s][c]

    @ti.func
    def clear_forces(self, s):
        """No force acts at slot `s`; call when every slot has been restored."""
        self.pair_force[s] = ti.Vector([0.0] * self.sizes["space"])
        if ti.static(self.rotates):
            self.pair_torque[s] = ti.Vector([0.0] * self.sizes["rotation"])

    @ti.func
    def restore(self, s, o):
        """Give slot `s` the memory of old slot `o`, or an empty one if o < 0."""
        self.status[s] = ti.cast(0, ti.i8)
        if ti.static(self.remembers_feature):
            self.feature[s] = ti.Vector([-1, -1])  # not known yet
            self.free_until[s] = -1.0
        if ti.static(self.history_size > 0):
            self.history[s] = ti.Vector([0.0] * self.history_size)
        if o >= 0:
            self.status[s] = self.old.status[o]
            if ti.static(self.remembers_feature):
                self.feature[s] = self.old.feature[o]
                self.free_until[s] = self.old.free_until[o]
            for value, c, shelf, place in ti.static(self.stash):
                value[s][c] = shelf[o][place]
