"""Platens: rigid bodies of glued grains that load a layer, driven axis by axis.

A platen does not rotate. Each of its axes is driven by one of `Fixed`, `ConstantVelocity`, `SpringLoadPoint`,
`ServoStress`, `VelocityOrStress`, `ServoWithSpring`; the kinds are compiled in, their values live in fields and may
change between stages (`Platens.set`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import when_allocated, write
from ..core.errors import InputError, require
from ..core.runtime import ti
from .platen_drives import VALUES, ConstantVelocity, Fixed, ServoStress, SpringLoadPoint
from .stress_drives import ServoWithSpring, VelocityOrStress

Drive = Fixed | ConstantVelocity | SpringLoadPoint | ServoStress | VelocityOrStress | ServoWithSpring

PUBLISHED = ("displacement", "velocity", "force_sum", "force_square_sum", "work", "dissipated")


@dataclass
class Platen:
    """A rigid body of glued grains.

    Parameters
    ----------
    name : str
        Name in files and error messages.
    drives : list
        One drive per axis: `Fixed`, `ConstantVelocity`, `SpringLoadPoint`, `ServoStress`, `VelocityOrStress` or
        `ServoWithSpring`.
    """

    name: str
    drives: list[Drive] = field(default_factory=list)


@ti.data_oriented
class Platens:
    """State and motion of all platens, stepped serially: a few rigid bodies with one force sum each.

    Parameters
    ----------
    platens : sequence of Platen
        The platens; grains name them by their index.
    grains
        State of the grains.
    area : float
        Surface on which stresses act [m2], the same for all platens.
    member : array (n,)
        Platen of each grain, -1 if it is mobile.
    mass : array (n,)
        Mass of each grain [kg].
    dt : float
        Time step [s], against which springs are checked.

    Raises
    ------
    InputError
        If a platen has no grain, not one drive per axis, or a spring too stiff for the time step.
    """

    def __init__(
        self, platens: Sequence[Platen], grains: Any, area: float, member: NDArray, mass: NDArray, dt: float
    ) -> None:
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
                raise InputError(f"platen {p.name!r}: {len(p.drives)} drives, must be one per axis ({self.dim})")
            wrong = [drive for drive in p.drives if not (hasattr(drive, "kick") or hasattr(drive, "pull"))]
            if wrong:
                kinds = [kind.__name__ for kind in get_args(Drive)]
                raise InputError(f"platen {p.name!r}: drive {wrong[0]!r}, must be one of {kinds}")
        glued = [np.flatnonzero(member == p) for p in range(self.count)]
        for p, ids in zip(platens, glued, strict=True):
            if len(ids) == 0:
                raise InputError(f"platen {p.name!r}: no grain is glued to it, see Scene.platen_index")
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

    def _begin(self, ids: NDArray) -> None:
        """Write the members, the values of the drives and the inertia of each platen along each axis."""
        write(self.member, ids)
        masses = np.repeat(self.glued_mass[:, None], self.dim, axis=1)
        for p, drives in enumerate(self.drives):
            for axis, drive in enumerate(drives):
                masses[p, axis] = getattr(drive, "inertia", masses[p, axis])
        write(self.mass, masses)
        self._write_drives()

    def clear(self) -> None:
        """Set displacements, velocities, forces, work and stretches to zero: a run starts again."""
        for row in (*self.state, self.force):
            row.fill(0.0)

    def set_time_step(self, dt: float) -> None:
        """Choose the time step [s]. Raises InputError if a spring is too stiff for it."""
        for drive in (drive for drives in self.drives for drive in drives):
            if hasattr(drive, "check_step"):
                drive.check_step(dt, self.area)
        self.dt = dt

    def _write_drives(self) -> None:
        """Write the values of all drives to the field that the kernel reads."""
        values = np.zeros((self.count, self.dim, VALUES))
        for p, drives in enumerate(self.drives):
            for axis, drive in enumerate(drives):
                if hasattr(drive, "check_step"):
                    drive.check_step(self.dt, self.area)
                given = drive.values(self.area)
                values[p, axis, : len(given)] = given
        write(self.values, values)

    def set(self, name: str, axis: int, drive: Drive) -> None:
        """Change the values of a drive between two calls of `Simulation.run`.

        Parameters
        ----------
        name
            Name of the platen.
        axis
            Axis along which it is driven: 0, 1 or, in 3D, 2.
        drive
            Drive of the same class and inertia as at the start, which are compiled in.

        Raises
        ------
        InputError
            If there is no such platen or axis, or the drive cannot replace that of the start.
        """
        if name not in self.names:
            raise InputError(f"platen {name!r}: no such platen, must be one of {self.names}")
        if axis not in range(self.dim):
            raise InputError(f"platen {name!r}, axis {axis!r}: must be one of {list(range(self.dim))}")
        p = self.names.index(name)
        now = self.drives[p][axis]
        if type(drive) is not type(now):
            raise InputError(
                f"platen {name!r}, axis {axis}: {type(drive).__name__} cannot replace {type(now).__name__}; "
                "the kinds of the drives are fixed when the simulation is made"
            )
        if getattr(drive, "inertia", 0.0) != getattr(now, "inertia", 0.0):
            allowed = f"{now.inertia!r} kg as at the start"
            require(False, drive, "inertia", drive.inertia, allowed)
        if hasattr(drive, "check_step"):
            drive.check_step(self.dt, self.area)
        self.drives[p][axis] = drive
        self._write_drives()

    def load_velocity(self, velocity: NDArray) -> NDArray:
        """Velocities of what drives the platens.

        Parameters
        ----------
        velocity
            Velocities of the platens (platen, axis) [m s-1].

        Returns
        -------
        array (platen, axis)
            The same, with those of the load points where there are springs [m s-1].
        """
        result = velocity.copy()
        for p, drives in enumerate(self.drives):
            for axis, drive in enumerate(drives):
                if isinstance(drive, SpringLoadPoint):
                    result[p, axis] = drive.velocity
        return result

    @ti.func
    def kick(self, dt):
        """Advance velocities and displacements of the platens by dt [s] and add up the work of their drives."""
        for p in ti.static(range(self.count)):
            for axis in ti.static(range(self.dim)):
                v, work, lost = self.driven(p, axis, dt)
                self.velocity[p][axis] = v
                self.work[p][axis] = self.work[p][axis] + work
                self.dissipated[p][axis] = self.dissipated[p][axis] + lost
                self.displacement[p][axis] = self.displacement[p][axis] + v * dt

    @ti.func
    def driven(self, p: ti.template(), axis: ti.template(), dt):
        """New velocity [m s-1], work [J] and dissipated energy [J] of one drive in a step of dt [s]."""
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
        """Move the glued grain k with its platen for dt [s]; world frame."""
        g = self.grains
        v = self.velocity[g.platen_index[k]]
        g.velocity[k] = v
        g.position[k] = g.position[k] + v * dt

    @ti.func
    def gather(self, forces: ti.template(), dt):
        """Sum the contact forces on each platen [N]; impulses count as a force over dt [s].

        The order is that of the ids of its grains, so that the bits depend neither on threads nor on slots.
        """
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
        """Copy the published rows to `values` (row, platen, axis): one launch for all of them."""
        for q in ti.static(range(len(self.state))):
            for p in ti.static(range(self.count)):
                for axis in ti.static(range(self.dim)):
                    values[q, p, axis] = self.state[q][p][axis]

    def snapshot(self) -> dict[str, NDArray]:
        """State of the platens now.

        Returns
        -------
        dict
            Arrays (platen, axis): `displacement` [m], `velocity` [m s-1], sums over steps of the contact force,
            `force_sum` [N], and of its square, `force_square_sum` [N2], `work` of the drives [J], energy that they
            `dissipated` [J] and, if there are springs, their `stretch` [m].
        """
        values = np.zeros((len(self.published), self.count, self.dim))
        self.publish(values)
        return dict(zip(self.published, values, strict=True))
