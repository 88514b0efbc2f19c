"""Calls the hooks of one effect for many contacts at once."""

import functools

import numpy as np

from taichi_lsm.core.runtime import ti
from taichi_lsm.effects import contact_type
from taichi_lsm.effects.base import LENGTHS

COUNT = 1000
MOST_HISTORY = 16  # numbers that an effect of these tests may remember
NUMBERS = (
    "depth",
    "gap",
    "approach",
    "normal_angular_velocity",
    *LENGTHS,
    "mass",
    "dt",
    "normal_force",
    "stiffness",
)
VECTORS = ("normal", "slip", "normal_change", "tangential_force")
AXIAL = ("relative_angular_velocity", "contact_moment")  # one component in 2D


@ti.data_oriented
class Columns:
    """Fields that all benches of a dimension share, read and written by one launch each: a step needs all of them."""

    def __init__(self, dim):
        self.fields = {name: ti.field(ti.f64, COUNT) for name in (*NUMBERS, "touching", "sliding", "lost", "energy")}
        self.fields |= {name: ti.Vector.field(dim, ti.f64, COUNT) for name in VECTORS}
        self.fields |= {name: ti.Vector.field(axial_size(dim), ti.f64, COUNT) for name in AXIAL}
        self.fields["history"] = ti.Vector.field(MOST_HISTORY, ti.f64, COUNT)
        self.places, self.components, first = {}, [], 0
        for name, field in self.fields.items():
            size = getattr(field, "n", 1)
            self.places[name] = slice(first, first + size)
            self.components += [(field, first + a, a if hasattr(field, "n") else -1) for a in range(size)]
            first += size
        self.values = np.zeros((COUNT, first))

    @ti.kernel
    def write(self, values: ti.types.ndarray()):
        for c in range(COUNT):
            for field, column, axis in ti.static(self.components):
                if ti.static(axis < 0):
                    field[c] = values[c, column]
                else:
                    field[c][axis] = values[c, column]

    @ti.kernel
    def read(self, values: ti.types.ndarray()):
        for c in range(COUNT):
            for field, column, axis in ti.static(self.components):
                if ti.static(axis < 0):
                    values[c, column] = field[c]
                else:
                    values[c, column] = field[c][axis]


columns_of = functools.cache(Columns)


@ti.data_oriented
class Bench:
    """Calls the hooks of one effect for COUNT contacts in one launch; what it reads and writes is in `columns`."""

    def __init__(self, effect, dim):
        self.effect, self.dim = effect.bound(), dim
        self.contact_type = contact_type(dim, [effect])
        self.columns = columns_of(dim)
        self.reaches = effect.reach() > 0.0
        self.size = effect.history_size(dim)
        self.has_energy = hasattr(type(effect), "contact_energy")
        for name, field in self.columns.fields.items():
            setattr(self, name, field)
        self.lengths = [(name, self.columns.fields[name]) for name in LENGTHS if name in effect.needs]

    def take(self, effect):
        """Go on with the parameters of another effect of the same variant."""
        self.effect.write_parameters(effect)

    @ti.kernel
    def launch(self):
        for c in range(COUNT):
            contact = self.contact_type(0)
            contact.depth, contact.approach = self.depth[c], self.approach[c]
            contact.normal, contact.slip = self.normal[c], self.slip[c]
            contact.normal_angular_velocity, contact.mass = self.normal_angular_velocity[c], self.mass[c]
            contact.dt, contact.stiffness = self.dt[c], self.stiffness[c]
            contact.normal_force, contact.tangential_force = self.normal_force[c], self.tangential_force[c]
            contact.touching = ti.cast(self.touching[c], ti.i32)
            self.give_optional(contact, c)
            if ti.static(self.size > 0):
                memory = ti.Vector([self.history[c][i] for i in range(self.size)])
                self.lost[c] = self.effect.on_contact(contact, memory)
                for i in ti.static(range(self.size)):
                    self.history[c][i] = memory[i]
                if ti.static(self.has_energy):
                    self.energy[c] = self.effect.contact_energy(contact, memory)
            else:
                memory = 0
                self.lost[c] = self.effect.on_contact(contact, memory)
                if ti.static(self.has_energy):
                    self.energy[c] = self.effect.contact_energy(contact, memory)
            self.normal_force[c] = contact.normal_force
            self.tangential_force[c] = contact.tangential_force
            self.sliding[c] = contact.sliding
            if ti.static(self.effect.adds_moment):
                self.contact_moment[c] = contact.contact_moment

    @ti.func
    def give_optional(self, contact: ti.template(), c):
        """Inputs that only some contacts have."""
        if ti.static(self.dim == 3):
            contact.normal_change = self.normal_change[c]
        for name, lengths in ti.static(self.lengths):
            contact[name] = lengths[c]
        if ti.static("relative_angular_velocity" in self.effect.needs):
            contact.relative_angular_velocity = self.relative_angular_velocity[c]
        if ti.static(self.effect.adds_moment):
            contact.contact_moment = self.contact_moment[c]
        if ti.static(self.reaches):
            contact.gap = self.gap[c]

    @ti.kernel
    def measure(self):
        for c in range(COUNT):
            contact = self.contact_type(0)
            contact.depth, contact.normal = self.depth[c], self.normal[c]
            self.give_optional(contact, c)
            memory = ti.Vector([self.history[c][i] for i in range(max(1, self.size))])
            self.energy[c] = self.effect.contact_energy(contact, memory)

    def stored(self, history, **inputs):
        """Energy that contacts hold with this history [J]."""
        self.load(history, inputs)
        self.measure()
        return self.energy.to_numpy()

    def load(self, history, inputs):
        values, places = self.columns.values, self.columns.places
        values[:] = 0.0
        for name, value in inputs.items():
            value = np.asarray(value, float)
            values[:, places[name]] = value[:, None] if value.shape == (COUNT,) else value
        if history is not None:
            values[:, places["history"]][:, : history.shape[1]] = history
        self.columns.write(values)

    def __call__(self, history=None, **inputs):
        """Outputs of one step as {name: array}; normal forces are what the effect added."""
        self.load(history, inputs)
        self.launch()
        self.columns.read(self.columns.values)
        names = ("normal_force", "tangential_force", "contact_moment", "lost", "energy", "history", "sliding")
        out = {name: self.columns.values[:, self.columns.places[name]].copy() for name in names}
        out |= {name: out[name][:, 0] for name in ("normal_force", "lost", "energy", "sliding")}
        out["history"] = out["history"][:, : max(1, self.size)]
        out["normal_force"] -= inputs.get("normal_force", 0.0)
        return out


def axial_size(dim):
    """Components of an angular velocity or a contact moment."""
    return 1 if dim == 2 else 3


_benches = {}


def bench_of(cls, i, dim):
    """Bench of one case; those of one variant differ in the values of parameters, and share their kernels."""
    effect = cls.cases()[i]
    variant = cls, effect.variant, effect.reach() > 0.0, dim
    if variant not in _benches:
        _benches[variant] = Bench(effect, dim)
    _benches[variant].take(effect)
    return _benches[variant]
