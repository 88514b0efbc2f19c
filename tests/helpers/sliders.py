"""Many sliders at once, each one contact under a constant normal force: a bench for friction in 2D and 3D."""

import numpy as np

from taichi_lsm.core.runtime import ti
from taichi_lsm.effects import contact_type

NUMBERS = ("force", "lowest", "highest", "lost", "velocity", "stretch", "stiffness", "load", "dt")


@ti.data_oriented
class Sliders:
    """`slide` moves the surfaces at a given velocity, `pull` draws blocks of mass [kg] over them by springs.

    The slip is along x, the normal along y. Fields per slider: force [N] that resists, lowest and highest since the
    last call, lost [J], velocity of the block [m s-1], stretch [m] and stiffness [N m-1] of its spring, load [m s-1]:
    velocity of the surface or the load point, dt [s]; history as the effect lays it out.
    """

    def __init__(self, effect, count, normal_force=1.0, dim=2, mass=1.0):
        self.effect, self.dim, self.count = effect.bound(), dim, count
        self.contact_type = contact_type(dim, [effect])
        self.size, self.normal_force, self.mass = effect.history_size(dim), normal_force, mass
        for name in NUMBERS:
            setattr(self, name, ti.field(ti.f64, count))
        self.history = ti.Vector.field(self.size, ti.f64, count)

    def set(self, **values):
        """Fill fields, each with one number or one per slider."""
        for name, value in values.items():
            field = getattr(self, name)
            field.from_numpy(np.broadcast_to(np.asarray(value, float), field.to_numpy().shape).copy())

    @ti.func
    def resist(self, c, v):
        """Force [N] against the slip velocity v [m s-1]."""
        contact = self.contact_type(0)
        contact.touching, contact.mass = 1, 1.0
        contact.normal[1] = 1.0
        contact.slip[0] = v
        contact.dt, contact.normal_force = self.dt[c], self.normal_force
        memory = ti.Vector([self.history[c][i] for i in range(self.size)])
        self.lost[c] = self.lost[c] + self.effect.on_contact(contact, memory)
        for i in ti.static(range(self.size)):
            self.history[c][i] = memory[i]
        force = -contact.tangential_force[0]
        self.force[c] = force
        self.lowest[c] = ti.min(self.lowest[c], force)
        self.highest[c] = ti.max(self.highest[c], force)

    @ti.func
    def begin(self, c):
        self.lowest[c], self.highest[c] = 1e300, -1e300

    @ti.kernel
    def slide(self, steps: ti.i32):
        for c in range(self.count):
            self.begin(c)
            for step in range(steps):
                self.resist(c, self.load[c])

    @ti.kernel
    def pull(self, steps: ti.i32):
        for c in range(self.count):
            self.begin(c)
            for step in range(steps):
                push = self.stiffness[c] * self.stretch[c] - self.force[c]
                self.velocity[c] = self.velocity[c] + push / self.mass * self.dt[c]
                self.stretch[c] = self.stretch[c] + (self.load[c] - self.velocity[c]) * self.dt[c]
                self.resist(c, self.velocity[c])
