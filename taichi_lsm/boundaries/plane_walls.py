"""Plane walls: rigid half-spaces that rest, move at a constant velocity, or follow a servo along their normal.

A grain touches a wall with its deepest point. Whatever its shape that point is unique, so that the effects act there
as between two grains, the second of which has no curvature and cannot be moved.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.error_flags import WALL
from ..contact.pair_geometry import half_width
from ..contact.pair_storage import ACTING, HAS_IMPULSE, SLIDING, TOUCHING
from ..core.allocation import read, share_kernels, when_allocated, write
from ..core.errors import InputError
from ..core.fields import allocate
from ..core.rotation import advanced_orientation, rotational_velocity, torque_of, velocity_turned_back
from ..core.runtime import current, ti
from ..core.schema import Variable
from .wall_servo import WallServo, WallServos, require_along
from .wall_setup import PlaneWall, as_vector, unit_normal

BLOCK = 64  # ids that share a mark: the sums over a wall visit only blocks that are marked
WALL_ROWS = [
    Variable("point", ("wall", "space"), "f64", "m", "point of the wall at the start", True),
    Variable("normal", ("wall", "space"), "f64", "1", "unit normal of the wall, into the grains", True),
    Variable("velocity", ("wall", "space"), "f64", "m s-1", "velocity of the wall", True),
    Variable("displacement", ("wall", "space"), "f64", "m", "displacement of the wall since the start", True),
    Variable("force", ("wall", "space"), "f64", "N", "force of the grains on the wall", True),
    Variable("force_sum", ("wall", "space"), "f64", "N", "sum of that force over steps", True),
    Variable("work", ("wall",), "f64", "J", "work that moves the wall against the grains", True),
]
PUBLISHED = ("point", "normal", "displacement", "velocity", "force", "force_sum", "work")


def contact_rows(spec: Any) -> list[Variable]:
    """Schema rows of a grain at a wall; row id * (number of walls) + wall, with the persistent id of the grain."""
    rows = [
        Variable("row_status", ("row",), "i8", "1", "as that of a pair of grains", True),
        Variable("row_force", ("row", "space"), "real", "N", "force on the wall", True),
    ]
    if spec.onset:
        rows.append(Variable("row_impulse", ("row", "space"), "real", "N s", "impulse on the wall", True))
    if spec.history:
        rows.append(Variable("row_history", ("row", "history"), "real", "1", "values kept by the effects", True))
    if spec.keeps_losses:
        rows.append(Variable("row_loss", ("row",), "f64", "J", "energy dissipated in the last step", True))
    return rows


@ti.data_oriented
class Walls:
    """State of all walls and of the contacts of grains with them.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    walls : sequence of PlaneWall
        The walls at the start.
    grains
        State of the grains.
    dt : float
        Time step [s], against which new servos are checked.

    Notes
    -----
    The rows of the contacts go by persistent id: they stay in place when the slots of the grains are sorted anew.
    """

    def __init__(self, spec: Any, walls: Sequence[PlaneWall], grains: Any, dt: float) -> None:
        self.spec, self.dt = spec, dt
        self.names = [wall.name for wall in walls]
        self.count, self.dim, self.real = len(walls), grains.dim, current().real
        self.rows = contact_rows(spec)
        sizes, capacity = {"space": self.dim, "history": spec.history}, grains.slot_of.shape[0]
        fields = vars(allocate(WALL_ROWS, self.count, sizes))
        for name, field in {**fields, **vars(allocate(self.rows, self.count * capacity, sizes))}.items():
            setattr(self, name, field)
        self.servos: Any = WallServos(self.count, self.dim) if spec.wall_servo else None
        self.radius_factor = ti.field(self.real, self.count)
        self.marked = ti.field(ti.i32, capacity // BLOCK + 1)
        when_allocated(lambda: self._place(walls))

    def begin(self, walls: Sequence[PlaneWall]) -> None:
        """Start again: put the walls in place and clear all contacts.

        Parameters
        ----------
        walls
            Walls of the same names as at the start.

        Raises
        ------
        InputError
            If the names differ.
        """
        if [wall.name for wall in walls] != self.names:
            raise InputError(f"Scene.walls: {[wall.name for wall in walls]}, must be {self.names} as at the start")
        for row in (*WALL_ROWS, *self.rows):
            getattr(self, row.name).fill(0)
        self._place(walls)

    def _place(self, walls: Sequence[PlaneWall]) -> None:
        """Write point, unit normal, velocity, stiffness and servo of each wall."""
        write(self.point, [wall.point for wall in walls])
        write(self.normal, [unit_normal(wall.normal, self.spec.periodic) for wall in walls])
        velocity = np.array([np.broadcast_to(np.asarray(wall.velocity, float), self.dim) for wall in walls])
        write(self.velocity, velocity)
        # Moduli at a rigid wall are twice those of like bodies; both go with the root of the radius.
        write(self.radius_factor, [4.0 if wall.rigid else 1.0 for wall in walls])
        if self.servos:
            self.servos.begin([wall.servo for wall in walls], velocity)

    def mark_all(self) -> None:
        """Mark all blocks, so that the next sum visits every grain; for rows that were loaded from a file."""
        self.marked.fill(1)

    def set_velocity(self, name: str, velocity: ArrayLike) -> None:
        """Change the velocity of a wall.

        Parameters
        ----------
        name
            Name of the wall.
        velocity
            New velocity (dim,) [m s-1], constant from now on; of a wall with a servo, the one along the plane.

        Raises
        ------
        InputError
            If there is no such wall, or the velocity is not a finite vector or not one that the servo allows.
        """
        value, w = as_vector(velocity), self._index(name)
        if value.shape != (self.dim,) or not np.isfinite(value).all():
            raise InputError(f"wall {name!r}: velocity = {velocity!r}, must be {self.dim} finite numbers")
        if self.servos and self.servos.driven()[w]:
            normal = read(self.normal)[w]
            require_along(name, velocity, normal)
            value = value + (read(self.velocity)[w] @ normal) * normal
        self.velocity[w] = value

    def set_servo(self, name: str, servo: WallServo) -> None:
        """Change the servo of a wall between two calls of `Simulation.run`.

        Parameters
        ----------
        name
            Name of the wall.
        servo
            Servo of the same inertia as at the start.

        Raises
        ------
        InputError
            If there is no such wall, it began without a servo, the inertia differs, or the step cannot follow it.
        """
        w = self._index(name)
        if not self.servos:
            raise InputError(f"wall {name!r}: set_servo, but no wall of the scene began with a servo")
        self.servos.set(w, name, servo, self.dt)

    def _index(self, name: str) -> int:
        """Row of the wall of this name; InputError if there is none."""
        if name not in self.names:
            raise InputError(f"wall {name!r}: no such wall, must be one of {self.names}")
        return self.names.index(name)

    def snapshot(self) -> dict[str, NDArray]:
        """State of the walls now.

        Returns
        -------
        dict
            Arrays (wall, dim): `point` at the start [m], unit `normal` [1], `displacement` [m], `velocity` [m s-1],
            `force` of the grains [N] and its sum over steps, `force_sum` [N], in which impulses count as force over
            dt. Array (wall,): `work` of what moves the walls, servos too [J].
        """
        share_kernels(getattr(self, name) for name in PUBLISHED)
        return {name: read(getattr(self, name)) for name in PUBLISHED}

    @ti.func
    def drift(self, dt):
        """Let the walls drift for dt [s], with a kick before for those that have a servo; 0: no step begins."""
        for w in range(self.count):
            if ti.static(self.spec.wall_servo):
                if dt > 0.0:
                    v, work = self.servos.kick(w, self.velocity[w], self.normal[w], dt)
                    self.velocity[w] = v
                    self.work[w] = self.work[w] + work
            self.displacement[w] = self.displacement[w] + self.velocity[w] * dt

    @ti.func
    def gather(self, forces: ti.template(), dt):
        """Sum the forces on each wall in rising ids and add up the work of what moves it.

        dt [s]: step that ended with these forces, 0 at the start of a run. The work is that of the trapezoidal rule,
        W -= ((F_old + F_new) dt/2 + J) . V, with the impulses J at contacts that began or ended, as for the effects.
        V is the velocity that is imposed: what a servo does along the normal is counted with its motion.
        """
        count = forces.grains.count[None]
        for w in range(self.count):
            force = ti.Vector([ti.cast(0.0, ti.f64)] * self.dim)
            impulse = 0.0 * force
            for block in range(count // BLOCK + 1):
                if self.marked[block]:
                    for i in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
                        r = i * self.count + w
                        if self.row_status[r]:
                            force += self.row_force[r]
                            if ti.static(self.spec.onset):
                                if self.row_status[r] & HAS_IMPULSE:
                                    impulse += self.row_impulse[r]
            v = self.velocity[w]
            if ti.static(self.spec.wall_servo):
                v = self.servos.imposed(w, v, self.normal[w])
                self.servos.note_force(w, force.dot(self.normal[w]), impulse.dot(self.normal[w]), dt)
            if dt > 0.0:
                push = 0.5 * (self.force[w] + force) * dt + impulse
                self.work[w] = self.work[w] - push.dot(v)
                self.force_sum[w] = self.force_sum[w] + force + impulse / dt
            self.force[w] = force
        # Contacts mark their block; a block in which no grain touches a wall any more loses its mark here.
        for block in range(count // BLOCK + 1):
            if self.marked[block]:
                busy = 0
                for r in range(block * BLOCK * self.count, ti.min((block + 1) * BLOCK, count) * self.count):
                    busy |= ti.cast(self.row_status[r], ti.i32)
                self.marked[block] = ti.cast(busy != 0, ti.i32)

    @ti.func
    def height(self, w, x):
        """Distance [m] of the point x [m] from the plane of wall w, negative beyond it."""
        return (x - self.point[w] - self.displacement[w]).dot(self.normal[w])

    @ti.func
    def contact(self, forces: ti.template(), k, w, dt):
        """Contact of grain k with wall w for the effects, its depth [m], arm [m] of the grain, and deepest feature.

        The wall is the second body of the pair: the normal n points from the grain into the wall. The depth is
        h(n) - z, h the support function of the grain and z the height of its centre; negative if they are apart.
        """
        g = forces.grains
        n = -ti.cast(self.normal[w], self.real)
        feature, radius = 0, g.radius[k]
        point = radius * n
        # Deepest point: that of the surface with the normal n, on the feature whose cone of normals holds n.
        if ti.static(self.spec.shaped):
            feature = forces.geometry.surface.feature_along(g.shape_index[k], k, n)
            point, radius = forces.geometry.surface.surface_point(g.shape_index[k], k, feature, g.orientation[k], n)
        depth = point.dot(n) - ti.cast(self.height(w, g.position[k]), self.real)
        arm = point - 0.5 * depth * n
        v = ti.cast(self.velocity[w] - g.velocity[k], self.real)
        normal_angular_velocity = 0.0 * depth
        if ti.static(self.spec.rotates):
            omega = ti.cast(g.angular_velocity[k], self.real)
            v -= rotational_velocity(omega, arm)
            # The ball with which the grain touches is fixed to it; velocities belong to half a step ago.
            if ti.static(self.spec.shaped):
                v -= velocity_turned_back(omega, arm - (radius - 0.5 * depth) * n, ti.cast(dt, self.real))
            if ti.static(self.dim == 3):  # mean of the grain and the wall, which does not rotate
                normal_angular_velocity = 0.5 * omega.dot(n)
        inverse_mass = g.inverse_mass[k]
        if ti.static(self.spec.shaped):
            inverse_mass = forces.geometry.mobility(k, torque_of(arm, n))
        contact = forces.make_contact(v, n, depth, inverse_mass, normal_angular_velocity, dt)
        if ti.static("reduced_radius" in forces.needs):
            contact.reduced_radius = radius
            if ti.static(not self.spec.local_radius):
                contact.reduced_radius = forces.geometry.equivalent_radius(k)
            contact.reduced_radius *= self.radius_factor[w]
        if ti.static("rolling_radius" in forces.needs):
            contact.rolling_radius = forces.geometry.equivalent_radius(k)
        if ti.static("footprint" in forces.needs):
            contact.footprint = half_width(radius, depth, g.radius[k])
        if ti.static("relative_angular_velocity" in forces.needs):
            contact.relative_angular_velocity = -ti.cast(g.angular_velocity[k], self.real)
        return contact, depth, arm, feature

    @ti.func
    def evaluate(self, forces: ti.template(), k, dt, noted):
        """Add the contacts of grain k with all walls to the sums of its row; glued grains do not touch walls."""
        g = forces.grains
        if g.platen_index[k] < 0:
            for w in range(self.count):
                r = g.id[k] * self.count + w
                # By the bounding sphere; a contact that ended in this step is evaluated once more.
                near = self.height(w, g.position[k]) < g.radius[k] - forces.geometry.least_depth()
                if near or self.row_status[r] != 0:
                    self.wall_contact(forces, k, w, r, dt, noted)

    @ti.func
    def wall_contact(self, forces: ti.template(), k, w, r, dt, noted):
        """Apply force, torque and impulse of wall w to grain k and store in row r those on the wall."""
        g = forces.grains
        contact, depth, arm, feature = self.contact(forces, k, w, dt)
        previous_status = ti.cast(self.row_status[r], ti.i32)
        least = forces.geometry.least_depth()
        if depth > least or previous_status != 0:
            if self.height(w, g.position[k]) <= 0.0:
                forces.geometry.error_flags.report(WALL, g.id[k], w)
            if ti.static(self.spec.keeps_losses):
                self.row_loss[r] = ti.cast(0.0, ti.f64)
            for effect in ti.static(forces.contact_effects):
                self.apply(forces, contact, effect, k, r)
            f = contact.normal_force * contact.normal + contact.tangential_force
            self.row_force[r] = f
            g.force[k] = g.force[k] - f
            if ti.static(self.spec.rotates):
                torque = torque_of(arm, contact.tangential_force)
                if ti.static(self.spec.shaped):  # else the normal force goes through the centre
                    torque = torque_of(arm, f)
                if ti.static(forces.adds_moment):
                    torque += contact.contact_moment
                g.torque[k] = g.torque[k] - torque
            # Bits of the status, as of a pair of grains.
            status = ti.select(contact.touching == 1, TOUCHING + SLIDING * contact.sliding, 0)
            if ti.static(self.spec.reaches):
                status += ti.select(depth > least, ACTING, 0)
            if ti.static(self.spec.onset):
                touching = ti.cast(contact.touching, ti.i32)
                # A contact that began or ended inside the step: correct the trapezoidal rule by an impulse.
                if touching != previous_status & TOUCHING:
                    last, earlier = self.depths_before(forces, k, w, feature, contact.normal, dt)
                    inverse_mass = forces.geometry.mobility(k, torque_of(arm, contact.normal))
                    radius = 0.0 * depth
                    if ti.static("reduced_radius" in forces.needs):
                        radius = contact.reduced_radius
                    size, lost = forces.correction.impulse(touching, depth, last, earlier, inverse_mass, radius, dt)
                    if size != 0.0:
                        forces.add_lost_at_onset(k, lost)
                        if ti.static(self.spec.keeps_losses):
                            self.row_loss[r] = self.row_loss[r] + ti.cast(lost, ti.f64)
                        status += HAS_IMPULSE
                        self.row_impulse[r] = size * contact.normal
                        g.has_impulse[k] = ti.cast(1, ti.i8)
                        if ti.static(self.spec.has_angular_impulses):
                            g.angular_impulse[k] = g.angular_impulse[k] - torque_of(arm, size * contact.normal)
            self.row_status[r] = ti.cast(status, ti.i8)
            if ti.static(self.spec.keeps_losses):
                if noted == 1 and status & (TOUCHING | ACTING) == 0:
                    g.parted_loss[k] = g.parted_loss[k] + self.row_loss[r]
            self.marked[g.id[k] // BLOCK] = 1  # a benign race: every thread writes the same number

    @ti.func
    def apply(self, forces: ti.template(), contact: ti.template(), effect: ti.template(), k, r):
        """Add one effect to the contact, its history in row r, and the energy that it dissipates to its channel."""
        lost = 0.0 * contact.depth
        if ti.static(effect.history_size(self.dim) > 0):
            memory = self.history_of(forces, effect, r)
            lost = effect.on_contact(contact, memory)
            begin, size = ti.static(forces.history_slice(effect))
            for c in ti.static(range(size)):
                self.row_history[r][begin + c] = memory[c]
        else:
            lost = effect.on_contact(contact, 0)
        forces.add_lost(k, effect, lost)
        if ti.static(self.spec.keeps_losses and effect.dissipates):
            self.row_loss[r] = self.row_loss[r] + ti.cast(lost, ti.f64)

    @ti.func
    def history_of(self, forces: ti.template(), effect: ti.template(), r):
        """Values of row r that belong to the history of one effect."""
        begin, size = ti.static(forces.history_slice(effect))
        return ti.Vector([self.row_history[r][begin + c] for c in range(size)], self.real)

    @ti.func
    def impulse_on(self, forces: ti.template(), k):
        """Impulse of all walls on grain k [N s], world frame."""
        impulse = ti.Vector([ti.cast(0.0, ti.f64)] * self.dim)
        for w in range(self.count):
            r = forces.grains.id[k] * self.count + w
            if self.row_status[r] & HAS_IMPULSE:
                impulse -= self.row_impulse[r]
        return impulse

    @ti.func
    def depths_before(self, forces: ti.template(), k, w, feature, n, dt):
        """Depths [m] one and two steps ago of the feature that is deepest now, continued beyond its bounds.

        Positions and orientations follow from the velocities of the last two steps: nothing more need be stored.
        """
        g = forces.grains
        normal, v, last = self.normal[w], self.velocity[w], self.velocity[w]
        if ti.static(self.spec.wall_servo):
            last = self.servos.last_velocity[w]
        height_1 = self.height(w, g.position[k]) - (g.velocity[k] - v).dot(normal) * dt
        height_2 = height_1 - (g.last_velocity[k] - last).dot(normal) * dt
        top_1 = g.radius[k]
        top_2 = top_1
        if ti.static(self.spec.shaped):
            q = advanced_orientation(g.orientation[k], g.angular_velocity[k], -dt)
            point, radius = forces.geometry.surface.surface_point(g.shape_index[k], k, feature, q, n)
            top_1 = point.dot(n)
            q = advanced_orientation(q, g.last_angular_velocity[k], -dt)
            point, radius = forces.geometry.surface.surface_point(g.shape_index[k], k, feature, q, n)
            top_2 = point.dot(n)
        return top_1 - ti.cast(height_1, self.real), top_2 - ti.cast(height_2, self.real)
