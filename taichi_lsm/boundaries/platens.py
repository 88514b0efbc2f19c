"""What moves the walls of an experiment: rigid platens of glued grains, driven axis by axis.

A platen does not rotate. Each of its axes is driven by one of `Fixed`, `ConstantVelocity`, `SpringLoadPoint`,
`ServoStress`; the kinds are compiled in, their values live in fields and may change between stages (`Platens.set`).
"""

from dataclasses import dataclass, field

import numpy as np

from ..core.errors import InputError
from ..core.runtime import ti, when_allocated
from .platen_drives import VALUES, _require

PUBLISHED = ("displacement", "velocity", "force_sum", "force_square_sum", "work", "dissipated")


@dataclass
class Platen:
    """A rigid body of glued grains: `drives` has one drive per axis; `name` appears in files and errors."""

    name: str
    drives: list = field(default_factory=list)


@ti.data_oriented
class Platens:
    """State and motion of all platens, stepped serially: a few rigid bodies with one force sum each.

    area [m2]: surface on which stresses act, the same for all; member (n,): platen of each grain, -1 if mobile;
    mass (n,) [kg] of each grain; dt [s]: the step, against which springs are checked.
    """

    def __init__(self, platens, grains, area, member, mass, dt):
        self.names = [p.name for p in platens]
        self.dim = grains.dim
        self.grains = grains
        self.area = area
        self.drives = [list(p.drives) for p in platens]
        self.count = len(platens)
        self.dt = dt
        self.springs = any(hasattr(drive, "pull") for drives in self.drives for drive in drives)
        for p in platens:
            if len(p.drives) != self.dim:
                raise InputError(f"platen {p.name!r}: {len(p.drives)} drives, needs one per axis ({self.dim})")
        glued = [np.flatnonzero(member == p) for p in range(self.count)]
        for p, ids in zip(platens, glued, strict=True):
            if len(ids) == 0:
                raise InputError(f"platen {p.name!r}: no grain is glued to it")
        self.first_member = [int(n) for n in np.concatenate([[0], np.cumsum([len(g) for g in glued])])]
        self.glued = self.first_member[-1]
        self.member = ti.field(ti.i32, self.glued)
        self.glued_mass = np.array([mass[ids].sum() for ids in glued])
        shape = self.count
        self.mass = ti.Vector.field(self.dim, ti.f64, shape)
        self.displacement = ti.Vector.field(self.dim, ti.f64, shape)
        self.velocity = ti.Vector.field(self.dim, ti.f64, shape)
        self.force = ti.Vector.field(self.dim, ti.f64, shape)
        self.force_sum = ti.Vector.field(self.dim, ti.f64, shape)
        self.force_square_sum = ti.Vector.field(self.dim, ti.f64, shape)
        self.work = ti.Vector.field(self.dim, ti.f64, shape)
        self.dissipated = ti.Vector.field(self.dim, ti.f64, shape)
        self.published = PUBLISHED
        if self.springs:
            self.stretch = ti.Vector.field(self.dim, ti.f64, shape)
            self.published += ("stretch",)
        self.state = [getattr(self, name) for name in self.published]
        self.values = ti.Vector.field(VALUES, ti.f64, (self.count, self.dim))
        when_allocated(lambda: self._begin(np.concatenate(glued)))

    def _begin(self, ids):
        for m, k in enumerate(ids):  # `from_numpy` would be a kernel to compile
            self.member[m] = k
        masses = np.repeat(self.glued_mass[:, None], self.dim, axis=1)
        for p, drives in enumerate(self.drives):
            for axis, drive in enumerate(drives):
                self._write(p, axis, drive)
                masses[p, axis] = getattr(drive, "inertia", masses[p, axis])
        for p, mass in enumerate(masses):
            self.mass[p] = mass

    def clear(self):
        """Forget displacements, velocities, forces, work and stretches: a run starts again."""
        for row in (*self.state, self.force):
            row.fill(0.0)

    def _write(self, p, axis, drive):
        if hasattr(drive, "check_step"):
            drive.check_step(self.dt)
        values = np.zeros(VALUES)
        given = drive.values(self.area)
        values[: len(given)] = given
        self.values[p, axis] = values

    def set(self, name, axis, drive):
        """Change the values of a drive; its kind was compiled in and must stay the same."""
        p = self.names.index(name)
        if type(drive) is not type(self.drives[p][axis]):
            kind = type(self.drives[p][axis]).__name__
            raise InputError(f"platen {name!r}, axis {axis}: {type(drive).__name__} cannot replace {kind}")
        if getattr(drive, "inertia", 0.0) != getattr(self.drives[p][axis], "inertia", 0.0):
            _require(False, drive, "inertia", drive.inertia, "as at the start")
        self._write(p, axis, drive)
        self.drives[p][axis] = drive

    def load_velocity(self, velocity):
        """Velocities (platen, axis) [m s-1] of what drives the platens: load points where there are springs."""
        result = velocity.copy()
        for p, drives in enumerate(self.drives):
            for axis, drive in enumerate(drives):
                if hasattr(drive, "pull"):
                    result[p, axis] = drive.velocity
        return result

    @ti.func
    def kick(self, dt):
        """Advance the platens' velocities by one step and add up the work of their drives."""
        for p in ti.static(range(self.count)):
            for axis in ti.static(range(self.dim)):
                v, work, lost = self.driven(p, axis, dt)
                self.velocity[p][axis] = v
                self.work[p][axis] = self.work[p][axis] + work
                self.dissipated[p][axis] = self.dissipated[p][axis] + lost
                self.displacement[p][axis] = self.displacement[p][axis] + v * dt

    @ti.func
    def driven(self, p: ti.template(), axis: ti.template(), dt):
        """(velocity [m s-1], work [J], energy dissipated [J]) of one drive in a step."""
        values, v, force = self.values[p, axis], self.velocity[p][axis], self.force[p][axis]
        if ti.static(hasattr(self.drives[p][axis], "pull")):
            stretch = self.stretch[p][axis]
            v_new, work, lost, after = self.drives[p][axis].pull(values, v, force, self.mass[p][axis], stretch, dt)
            self.stretch[p][axis] = after
            return v_new, work, lost
        else:
            return self.drives[p][axis].kick(values, v, force, self.mass[p][axis], dt)

    @ti.func
    def carry(self, k, dt):
        """Move a glued grain with its platen."""
        g = self.grains
        v = self.velocity[g.platen_index[k]]
        g.velocity[k] = v
        g.position[k] = g.position[k] + v * dt

    @ti.func
    def gather(self, forces: ti.template(), dt):
        """Sum the contact forces on each platen, in rising ids of its grains; impulses count as force over dt."""
        for p in ti.static(range(self.count)):
            total = ti.Vector([ti.cast(0.0, ti.f64)] * self.dim)
            for m in range(ti.static(self.first_member[p]), ti.static(self.first_member[p + 1])):
                load = forces.total_load(self.grains.slot_of[self.member[m]])
                total += load.force
                if ti.static(forces.spec.onset):
                    total += load.impulse / dt
            self.force[p] = total
            self.force_sum[p] = self.force_sum[p] + total
            self.force_square_sum[p] = self.force_square_sum[p] + total * total

    @ti.kernel
    def publish(self, values: ti.types.ndarray()):
        for q in ti.static(range(len(self.state))):
            for p in ti.static(range(self.count)):
                for axis in ti.static(range(self.dim)):
                    values[q, p, axis] = self.state[q][p][axis]

    def snapshot(self):
        """{name: array (platen, axis)} of displacement [m], velocity [m s-1], sums over steps of the contact force
        [N] and of its square [N2], work of the drives [J] and energy they dissipated [J], and, if there are springs,
        their stretch [m]; read in one go.
        """
        values = np.zeros((len(self.published), self.count, self.dim))
        self.publish(values)
        return dict(zip(self.published, values, strict=True))
