"""Time integration: Verlet with onset correction, the default, and velocity Verlet.

Verlet's half kicks are merged: velocities live half a step before positions. One step is: platens, then all grains
(gather the force, kick, drift), then all contacts at the new positions. It ends with positions, contact forces and
histories at the same time t; `diagnostics` synchronises velocities to t.
Many steps are made in one launch, by a crew of threads that share its stages; any number of them gives the same bits.
"""

from ..core.rotation import advanced_orientation, angular_velocity_of, free_rotor, momentum_of, unrotate
from ..core.runtime import current, ti, when_allocated
from .step_loop_gpu import Offloaded
from .thread_team import SPREAD, ThreadTeam

ROTATION_MARGIN = 1.01  # the spin is a mean over the step; the turn may be a little more
STAGES = 4  # of a step: platens, drift, contacts, and before these the bonds
MOST_STEPS = 512  # of a launch
LAST_STAGE = STAGES * (MOST_STEPS + 1)
GRAIN_STEPS = 4_000_000  # of a launch: short enough to answer a signal at once
OFFLOADED_STEPS = 8  # launched before the flags are read


@ti.data_oriented
class VelocityVerlet(Offloaded):
    """Symplectic, second order for conservative scenes: Eqs. (12)-(17) with the velocity of Eq. (14) at t + dt/2.

    dt [s] lives in a field. `halted` is 1 when a grain moved half the skin since the list was built: the step then
    waits with its drift done and its contacts missing, until the contacts are evaluated after the rebuild.
    """

    onset = False  # add impulses where contacts begin and end
    half_step = True  # velocities belong half a step before positions
    conservative = False  # only for scenes that lose no energy

    def __init__(self, forces, platens, skin, dt, threads=1):
        self.forces, self.platens, self.crew = forces, platens, ThreadTeam(threads, LAST_STAGE + 1)
        self.grains, self.domain = forces.grains, forces.domain
        self.driven, self.walled = platens is not None, forces.walled
        self.led = self.driven or self.walled or self.domain.sheared
        self.rotates, self.oriented = forces.rotates, self.grains.has("orientation")
        self.tumbles = self.grains.has("angular_momentum")
        self.shaped = self.grains.has("travel")
        self.bonds, self.bonded = forces.bonds, forces.bonded
        self.offloaded, self.serial = current().arch != "cpu", current().serial
        self.dt = ti.field(ti.f64, ())
        self.half_skin = ti.field(ti.f64, ())
        self.moved = ti.field(ti.i32, ())
        self.halted = ti.field(ti.i32, ())
        self.steps_done = ti.field(ti.i32, ())
        when_allocated(lambda: self.set_step(dt, skin))

    def set_step(self, dt, skin):
        """Choose the time step [s] and the skin of the neighbour list [m]."""
        self.dt[None] = dt
        self.half_skin[None] = 0.5 * skin

    @ti.func
    def drift_time(self, step):
        """Time [s] of the drift in this step of a launch."""
        return self.dt[None]

    @ti.func
    def kick_time(self, step):
        """Time [s] for which the forces act at the start of this step: half of the last drift and half of this."""
        return self.dt[None]

    @ti.func
    def last_time(self):
        """Time [s] of the drift that led to the present positions."""
        return self.dt[None]

    def go_on_from(self, former):
        """Take over what an integrator of the same class remembers beside the state."""

    @ti.func
    def advance(self, k, step):
        """Kick and drift of the mobile grain k, Eqs. (12)-(18)."""
        g, dt, push_time = self.grains, self.drift_time(step), self.kick_time(step)
        before = g.position[k]
        self.keep_velocity(k)
        force, torque, kick, angular_impulse = self.forces.gathered(k)
        push = force * push_time + kick
        g.velocity[k] = self.kicked(k, g.velocity[k], push * g.inverse_mass[k], g.inverse_mass[k])
        g.position[k] = g.position[k] + g.velocity[k] * dt
        if ti.static(self.domain.sheared):
            self.forces.geometry.add_shear_work(k, self.domain.carried(g.velocity[k], before, dt) / g.inverse_mass[k])
        if ti.static(self.tumbles):
            self.tumble(k, torque * push_time + angular_impulse, dt)
        else:
            if ti.static(self.rotates):
                inverse = g.inverse_inertia[k]
                g.angular_velocity[k] = self.kicked(
                    k, g.angular_velocity[k], (torque * push_time + angular_impulse) * inverse, inverse
                )
            if ti.static(self.oriented):
                g.orientation[k] = advanced_orientation(g.orientation[k], g.angular_velocity[k], dt)
        self.watch(k, before, step)

    @ti.func
    def kicked(self, k, before, change, inverse_inertia):
        """Velocity or spin of grain k after the kick of a step and the laws of motion, which book what they take."""
        result = before + change
        for effect in ti.static(self.forces.motion_effects):
            left = effect.on_velocity(before, result, self.dt[None])
            self.channel(k, effect, (0.5 * (before + left) * (result - left) / inverse_inertia).sum())
            result = left
        return result

    @ti.func
    def pushed(self, k, push, inverse):
        """Angular momentum of grain k after an angular impulse, like `kicked`."""
        old, turn = self.grains.angular_momentum[k], self.grains.orientation[k]
        result = old + push
        for effect in ti.static(self.forces.motion_effects):
            left = effect.on_velocity(old, result, self.dt[None])
            self.channel(k, effect, angular_velocity_of(turn, 0.5 * (old + left), inverse).dot(result - left))
            result = left
        return result

    @ti.func
    def channel(self, k, effect: ti.template(), lost):
        """Enter the energy [J] that a law of motion took from grain k."""
        g = self.grains
        if ti.static(self.forces.track_dissipation and effect.dissipates):
            channel = ti.static(self.forces.channel_of(effect))
            g.dissipated[k][channel] = g.dissipated[k][channel] + lost

    @ti.func
    def carry(self, k, step):
        """Drift of grain k, which is glued to a platen."""
        before = self.grains.position[k]
        self.keep_velocity(k)
        self.platens.carry(k, self.dt[None])
        self.watch(k, before, step)

    @ti.func
    def move_walls(self, step, count, resume, contact_dt):
        """Sum the forces on the plane walls and book their work, then let them drift, and shear the cell."""
        dt = ti.select(step < count and step >= resume, self.dt[None], 0.0)
        if ti.static(self.walled):
            self.forces.walls.go_on(self.forces, step > 0, self.dt[None] if step > resume else contact_dt, dt)
        if ti.static(self.domain.sheared):
            self.domain.shear(dt)

    @ti.func
    def move_platens(self, step, count, resume):
        """Sum the forces of the contacts on the platens, then kick them and let their grains drift."""
        g = self.grains
        if step > 0:
            self.platens.gather(self.forces, self.dt[None])
        if step < count and step >= resume:
            self.platens.kick(self.dt[None])
            for m in range(self.platens.glued):
                self.carry(g.slot_of[self.platens.member[m]], step)

    @ti.func
    def keep_velocity(self, k):
        """Remember the velocities of the last step, from which the onset of contacts knows their acceleration."""
        g = self.grains
        if ti.static(self.forces.onset):
            g.last_velocity[k] = g.velocity[k]
            if ti.static(self.shaped):
                g.last_angular_velocity[k] = g.angular_velocity[k]

    @ti.func
    def tumble(self, k, push, dt):
        """Kick of the angular momentum and free rotation of a grain in 3D, Eqs. (16), (17) with the gyroscopic term.

        The spin that contacts see is the mean of those at the two ends of the step: that of the half step.
        """
        g = self.grains
        inverse = ti.cast(g.inverse_inertia[k], ti.f64)
        before, momentum = g.orientation[k], self.pushed(k, push, inverse)
        after = free_rotor(before, momentum, inverse, dt)
        g.angular_momentum[k] = momentum
        g.orientation[k] = after
        g.angular_velocity[k] = 0.5 * (
            angular_velocity_of(before, momentum, inverse) + angular_velocity_of(after, momentum, inverse)
        )

    @ti.func
    def watch(self, k, before, step):
        """Ask for a new neighbour list when grain k has moved by half the skin, or a part of it may have.

        before: its position [m] at the start of the step, from which the way of its surface follows; step: number of
        the step in the launch, kept in `moved` plus one.
        """
        g = self.grains
        limit, passed = self.half_skin[None], (g.position[k] - before).norm()
        if ti.static(self.domain.sheared):
            passed = self.domain.passed(g.position[k], before, limit, self.dt[None])
        if ti.static(self.shaped):
            fastest = ti.abs(g.angular_velocity[k][0]) if ti.static(g.dim == 2) else g.angular_velocity[k].norm()
            turning = ROTATION_MARGIN * fastest * self.drift_time(step) * g.radius[k]
            if ti.static(self.conservative):  # such schemes also go back in time
                turning = ti.abs(turning)
            g.travel[k] = g.travel[k] + passed + turning
        way = g.position[k] - g.built_position[k]
        if ti.static(self.domain.sheared):
            way, limit = self.domain.displacement_in_flow(way, g.built_position[k], limit, (step + 1) * self.dt[None])
        if ti.static(
            self.forces.multi_part
        ):  # a point at the distance R moves by less than R |turn| (2D), 2 R |turn| (3D)
            turn = (g.orientation[k] - g.built_orientation[k]).norm()
            limit -= ti.static(1.0 if self.grains.dim == 2 else 2.0) * turn * g.radius[k]
        if not (limit > 0.0 and way.dot(way) < limit * limit):  # also true for a position that is not a number
            self.moved[None] = 1 + step

    @ti.func
    def synchronised(self, k):
        """(velocity [m s-1], spin [rad s-1]) of grain k at the time of its position."""
        g = self.grains
        v = g.velocity[k]
        omega = ti.Vector([ti.cast(0.0, ti.f64)] * g.sizes["rotation"])
        if ti.static(self.rotates):
            omega = g.angular_velocity[k]
        if ti.static(self.half_step):
            if g.platen_index[k] < 0:
                h = 0.5 * self.last_time()
                force, torque, kick, angular_impulse = self.forces.gathered(k)
                v += (force * h + kick) * g.inverse_mass[k]
                if ti.static(self.tumbles):
                    momentum = g.angular_momentum[k] + torque * h + angular_impulse
                    omega = angular_velocity_of(g.orientation[k], momentum, ti.cast(g.inverse_inertia[k], ti.f64))
                elif ti.static(self.rotates):
                    omega += (torque * h + angular_impulse) * g.inverse_inertia[k]
        elif ti.static(self.tumbles):
            omega = angular_velocity_of(g.orientation[k], g.angular_momentum[k], ti.cast(g.inverse_inertia[k], ti.f64))
        return v, omega

    @ti.func
    def momentum(self, k):
        """Angular momentum [kg m2 s-1] of grain k, in the world frame, at the time of its position (3D)."""
        result = self.grains.angular_momentum[k]
        if ti.static(self.half_step):
            if self.grains.platen_index[k] < 0:
                force, torque, kick, angular_impulse = self.forces.gathered(k)
                result += torque * (0.5 * self.last_time()) + angular_impulse
        return result

    @ti.func
    def principal(self, k, a):
        """World vector `a` along the axes to which `inverse_inertia` belongs."""
        result = a
        if ti.static(self.tumbles):
            result = unrotate(self.grains.orientation[k], a)
        return result

    @ti.kernel
    def steps(self, count: ti.i32, resume: ti.i32, contact_dt: ti.f64):
        """Up to `count` steps; stops early if the list must be rebuilt.

        resume: the first step has drifted already and only lacks its contacts, whose step is contact_dt [s]: after a
        rebuild, or (contact_dt = 0) at the start of a run. One body serves both, for it takes long to compile.
        """
        self.crew.begin(self.grains.count[None], self.forces.pairs.row_start)
        self.moved[None] = 0
        self.domain.note_strain()
        ti.loop_config(serialize=self.crew.size == 1)
        for i in range(self.crew.size * SPREAD):
            if i % SPREAD == 0:
                self.work(i // SPREAD, count, resume, contact_dt)

    @ti.func
    def work(self, t, count, resume, contact_dt):
        """What thread t does in a launch, see `steps`."""
        block = self.forces.block(0)
        step, going, fault = 0, 1, 0
        while step <= count and going == 1 and fault == 0:
            stage = STAGES * step  # a thread that slept through a step must not mistake one stage for another
            if ti.static(self.led):
                if self.crew.alone(stage):  # one thread moves the platens while others move the grains between
                    if ti.static(self.driven):
                        self.move_platens(step, count, resume)
                    self.move_walls(step, count, resume, contact_dt)
                    self.crew.alone_done(t, stage)
            if step < count:
                dt = contact_dt
                if step >= resume:
                    dt = self.dt[None]
                    part = self.crew.take(t, stage + 1)
                    while part >= 0:
                        for k in range(self.crew.first[part], self.crew.first[part + 1]):
                            if self.grains.platen_index[k] < 0:
                                self.advance(k, step)
                        part = self.crew.hand_in(t, stage + 1)
                    if ti.static(self.led):
                        self.crew.wait(t, stage)
                    self.crew.wait(t, stage + 1)
                if ti.static(self.bonded):
                    if step >= resume or contact_dt == 0.0:
                        self.work_on_bonds(t, stage + 3, step)
                if step >= resume:
                    going = ti.cast(self.moved[None] != 1 + step, ti.i32)  # others may have gone on, and moved later
                if going == 1:
                    part = self.crew.take(t, stage + 2)
                    while part >= 0:
                        self.forces.rows(block, self.crew.first[part], self.crew.first[part + 1], dt)
                        part = self.crew.hand_in(t, stage + 2)
                    self.crew.wait(t, stage + 2)
                    fault = self.forces.geometry.error_flags.code[
                        None
                    ]  # of this step, or of one that others have begun
            step += going
        if self.crew.alone(LAST_STAGE):
            self.halted[None] = 1 - going
        ti.atomic_max(self.steps_done[None], ti.min(step, count) - resume)

    @ti.func
    def work_on_bonds(self, t, stage, step):
        """Evaluate the bonds. Where one breaks the contact of its grains is missing: a new list, as in `watch`."""
        part = self.crew.take(t, stage)
        while part >= 0:
            for k in range(self.crew.first[part], self.crew.first[part + 1]):
                if self.bonds.evaluate(k) == 1:
                    self.moved[None] = 1 + step
            part = self.crew.hand_in(t, stage)
        self.crew.wait(t, stage)

    def launch(self, count):
        """Make up to `count` steps, fewer if the list must be rebuilt or a launch would take long."""
        if self.offloaded:
            for _ in range(min(count, OFFLOADED_STEPS)):
                self.step_offloaded()
        else:
            most = max(1, min(MOST_STEPS, GRAIN_STEPS // len(self.grains)))
            self.steps(min(count, most), 0, 0.0)

    def contacts_only(self, dt):
        """Contacts at the present positions: ends a step that waited for a rebuild, or (dt = 0) starts a run."""
        if self.offloaded:
            self.contacts_offloaded(dt)
        else:
            self.steps(1, 1, dt)

    @ti.kernel
    def shift_velocities(self):
        """Move the velocities of the start half a step back, before the positions."""
        ti.loop_config(serialize=self.serial)
        for k in range(self.grains.count[None]):
            g = self.grains
            if ti.static(self.tumbles):
                g.angular_momentum[k] = momentum_of(g.orientation[k], g.angular_velocity[k], 1.0 / g.inverse_inertia[k])
            if ti.static(self.half_step):
                if g.platen_index[k] < 0:
                    h = -0.5 * self.last_time()
                    force, torque, kick, angular_impulse = self.forces.gathered(k)
                    g.velocity[k] = g.velocity[k] + force * (g.inverse_mass[k] * h)
                    if ti.static(self.tumbles):
                        g.angular_momentum[k] = g.angular_momentum[k] + torque * h
                    elif ti.static(self.rotates):
                        g.angular_velocity[k] = g.angular_velocity[k] + torque * (g.inverse_inertia[k] * h)
            self.keep_velocity(k)


@ti.data_oriented
class OnsetVerlet(VelocityVerlet):
    """Velocity Verlet with an impulse in the first step after each contact begins and after it ends.

    Verlet is the trapezoidal rule for the impulse of a force; where the force starts inside a step the rule errs by
    a Hurwitz zeta term (generalised Euler-Maclaurin), which the impulse makes up for. One linear collision is then
    of fourth order in dt instead of second.
    """

    onset = True
