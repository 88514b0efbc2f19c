"""Velocity Verlet, the scheme alone: what a step does to one grain. The step loops say when, and to which grains.

The two half kicks of a step are merged into one: velocities live half a step before positions. After the drift the
contacts are evaluated at the new positions, so that a step ends with positions, contact forces and histories at the
same time t; `synchronised` brings velocities to t.
"""

from ..core.allocation import when_allocated, write
from ..core.rotation import advanced_orientation, angular_velocity_of, free_rotor, momentum_of, unrotate
from ..core.runtime import current, ti


@ti.data_oriented
class VelocityVerlet:
    """Symplectic and of second order for conservative scenes: Eqs. (12)-(17) with the velocity of Eq. (14) at t + dt/2.

    The time step dt [s] lives in a field, so that one compilation serves all its values.
    """

    onset = False  # impulses where contacts begin and end
    half_step = True  # velocities belong half a step before positions
    conservative = False  # only for scenes that lose no energy

    def __init__(self, spec, forces, dt):
        self.spec, self.forces = spec, forces
        self.grains, self.domain = forces.grains, forces.domain
        self.serial = current().serial
        self.dt = ti.field(ti.f64, ())
        when_allocated(lambda: self.set_time_step(dt))

    def set_time_step(self, dt: float) -> None:
        """Choose the time step [s]."""
        write(self.dt, dt)

    def restart(self, step: int = 0) -> None:
        """Begin a run, or go on with one that has made `step` steps; for schemes whose steps differ."""

    def count_steps(self, steps: int) -> None:
        """Take note of the steps that a launch has made; for schemes whose steps differ."""

    def take_over(self, former: "VelocityVerlet") -> None:
        """Take over what an integrator of the same class remembers beside the state."""

    @ti.func
    def drift_time(self, step):
        """Time [s] of the drift in this step of a launch."""
        return self.dt[None]

    @ti.func
    def kick_time(self, step):
        """Time [s] for which the forces act at the start of this step: half of the last drift and half of this."""
        return self.dt[None]

    @ti.func
    def last_drift_time(self):
        """Time [s] of the drift that led to the present positions."""
        return self.dt[None]

    @ti.func
    def advance(self, k, step):
        """Kick, drift and rotation of the mobile grain k in this step of a launch, Eqs. (12)-(18)."""
        load = self.forces.total_load(k)
        self.remember_velocity(k)
        self.kick(k, load, self.kick_time(step))
        self.drift(k, self.drift_time(step))
        self.rotate(k, self.drift_time(step))

    @ti.func
    def kick(self, k, load: ti.template(), time):
        """V += (F time + J)/m and L += torque time + angular impulse, Eqs. (13) and (16)."""
        g = self.grains
        push = load.force * time + load.impulse
        g.velocity[k] = self.velocity_after_kick(k, g.velocity[k], push * g.inverse_mass[k], g.inverse_mass[k])
        # In 3D the angular momentum is the state: the angular velocity changes while the body turns without torque.
        if ti.static(self.spec.tumbles):
            push_angular = load.torque * time + load.angular_impulse
            g.angular_momentum[k] = self.momentum_after_kick(k, push_angular, ti.cast(g.inverse_inertia[k], ti.f64))
        elif ti.static(self.spec.rotates):
            inverse = g.inverse_inertia[k]
            push_angular = (load.torque * time + load.angular_impulse) * inverse
            g.angular_velocity[k] = self.velocity_after_kick(k, g.angular_velocity[k], push_angular, inverse)

    @ti.func
    def drift(self, k, time):
        """X += v time, Eq. (14); in a sheared cell with the work of the shear on the momentum that grain k carries.

        Where the height of the cell moves, grain k is carried with it.
        """
        g = self.grains
        before = g.position[k]
        if ti.static(self.spec.cell_servo):
            place, after, carried = self.domain.flight(before, g.velocity[k], time)
            g.position[k], g.velocity[k] = place, after
            self.forces.geometry.add_shear_work(k, carried / g.inverse_mass[k])
        else:
            g.position[k] = before + g.velocity[k] * time
            if ti.static(self.spec.sheared):
                carried = self.domain.carried(g.velocity[k], before, time) / g.inverse_mass[k]
                self.forces.geometry.add_shear_work(k, carried)

    @ti.func
    def rotate(self, k, time):
        """Rotation of grain k for `time` [s], Eqs. (17) and (18) in a form that stays a rotation.

        In 3D the body turns freely, with the gyroscopic term. The angular velocity that contacts see is the mean of
        those at the two ends of the step: that of the half step.
        """
        g = self.grains
        if ti.static(self.spec.tumbles):
            inverse = ti.cast(g.inverse_inertia[k], ti.f64)
            before, momentum = g.orientation[k], g.angular_momentum[k]
            after = free_rotor(before, momentum, inverse, time)
            g.orientation[k] = after
            omega = angular_velocity_of(before, momentum, inverse) + angular_velocity_of(after, momentum, inverse)
            g.angular_velocity[k] = 0.5 * omega
        elif ti.static(self.spec.oriented):
            g.orientation[k] = advanced_orientation(g.orientation[k], g.angular_velocity[k], time)

    @ti.func
    def velocity_after_kick(self, k, before, change, inverse_inertia):
        """Velocity or angular velocity of grain k after the kick and the effects of motion.

        The energy that such an effect takes is that of the mean of the velocities before and after it.
        """
        result = before + change
        for effect in ti.static(self.forces.motion_effects):
            left = effect.on_velocity(before, result, self.dt[None])
            self.add_dissipated(k, effect, (0.5 * (before + left) * (result - left) / inverse_inertia).sum())
            result = left
        return result

    @ti.func
    def momentum_after_kick(self, k, push, inverse):
        """Angular momentum [kg m2 s-1] of grain k after the angular impulse `push` [N m s], as for velocities."""
        old, q = self.grains.angular_momentum[k], self.grains.orientation[k]
        result = old + push
        for effect in ti.static(self.forces.motion_effects):
            left = effect.on_velocity(old, result, self.dt[None])
            lost = angular_velocity_of(q, 0.5 * (old + left), inverse).dot(result - left)
            self.add_dissipated(k, effect, lost)
            result = left
        return result

    @ti.func
    def add_dissipated(self, k, effect: ti.template(), lost):
        """Add the energy [J] that an effect of motion took from grain k to its energy channel."""
        g = self.grains
        if ti.static(self.spec.tracks_dissipation and effect.dissipates):
            channel = ti.static(self.forces.channel_of(effect))
            g.dissipated[k][channel] = g.dissipated[k][channel] + lost

    @ti.func
    def remember_velocity(self, k):
        """Keep the velocities of the last step, from which the onset correction knows the acceleration of contacts."""
        g = self.grains
        if ti.static(self.spec.onset):
            g.last_velocity[k] = g.velocity[k]
            if ti.static(self.spec.shaped):
                g.last_angular_velocity[k] = g.angular_velocity[k]

    @ti.func
    def synchronised(self, k):
        """(velocity [m s-1], angular velocity [rad s-1]) of grain k at the time of its position."""
        g = self.grains
        v = g.velocity[k]
        omega = ti.Vector([ti.cast(0.0, ti.f64)] * g.sizes["rotation"])
        if ti.static(self.spec.rotates):
            omega = g.angular_velocity[k]
        # The second half kick of the step, which is merged with the first one of the next step otherwise.
        if ti.static(self.half_step):
            if g.platen_index[k] < 0:
                h = 0.5 * self.last_drift_time()
                load = self.forces.total_load(k)
                v += (load.force * h + load.impulse) * g.inverse_mass[k]
                if ti.static(self.spec.tumbles):
                    momentum = g.angular_momentum[k] + load.torque * h + load.angular_impulse
                    omega = angular_velocity_of(g.orientation[k], momentum, ti.cast(g.inverse_inertia[k], ti.f64))
                elif ti.static(self.spec.rotates):
                    omega += (load.torque * h + load.angular_impulse) * g.inverse_inertia[k]
        elif ti.static(self.spec.tumbles):
            inverse = ti.cast(g.inverse_inertia[k], ti.f64)
            omega = angular_velocity_of(g.orientation[k], g.angular_momentum[k], inverse)
        return v, omega

    @ti.func
    def momentum(self, k):
        """Angular momentum [kg m2 s-1] of grain k, in the world frame, at the time of its position (3D)."""
        result = self.grains.angular_momentum[k]
        if ti.static(self.half_step):
            if self.grains.platen_index[k] < 0:
                load = self.forces.total_load(k)
                result += load.torque * (0.5 * self.last_drift_time()) + load.angular_impulse
        return result

    @ti.func
    def principal(self, k, a):
        """World vector `a` along the axes to which `inverse_inertia` belongs."""
        result = a
        if ti.static(self.spec.tumbles):
            result = unrotate(self.grains.orientation[k], a)
        return result

    @ti.kernel
    def shift_velocities(self):
        """At the start of a run: move the velocities half a step back, before the positions."""
        ti.loop_config(serialize=self.serial)
        for k in range(self.grains.count[None]):
            g = self.grains
            if ti.static(self.spec.tumbles):
                g.angular_momentum[k] = momentum_of(g.orientation[k], g.angular_velocity[k], 1.0 / g.inverse_inertia[k])
            if ti.static(self.half_step):
                if g.platen_index[k] < 0:
                    h = -0.5 * self.last_drift_time()
                    load = self.forces.total_load(k)
                    g.velocity[k] = g.velocity[k] + load.force * (g.inverse_mass[k] * h)
                    if ti.static(self.spec.tumbles):
                        g.angular_momentum[k] = g.angular_momentum[k] + load.torque * h
                    elif ti.static(self.spec.rotates):
                        g.angular_velocity[k] = g.angular_velocity[k] + load.torque * (g.inverse_inertia[k] * h)
            self.remember_velocity(k)


@ti.data_oriented
class OnsetVerlet(VelocityVerlet):
    """Velocity Verlet with an impulse in the first step after each contact begins and after it ends; the default.

    Verlet is the trapezoidal rule for the impulse of a force; where the force starts inside a step the rule errs by
    a Hurwitz zeta term (generalised Euler-Maclaurin), which the impulse makes up for (`onset_correction.py`). One
    linear collision is then of fourth order in dt instead of second.
    """

    onset = True
