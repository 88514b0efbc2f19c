"""The first-order schemes of the seed, for comparison: one that works and the one that is printed."""

from ..core.rotation import angular_velocity_of, linear_orientation_change
from ..core.runtime import ti
from .verlet import VelocityVerlet


@ti.data_oriented
class SymplecticEuler(VelocityVerlet):
    """The seed's first-order scheme in its working form: Eqs. (13), (14) with x moved by the new velocity.

    The update is Verlet's; but velocities and positions are taken to belong to the same time, so that energies
    ripple at first order.
    """

    half_step = False


@ti.data_oriented
class ExplicitEuler(VelocityVerlet):
    """The seed's scheme as printed: x moves by the old velocity, Eq. (14), and R by omega * R, Eq. (18).

    It gains energy and its rotations grow; it is here to show why it is not used.
    """

    half_step = False

    @ti.func
    def advance(self, k, step):
        g, dt = self.grains, self.dt[None]
        before = g.position[k]
        force, torque, kick, angular_impulse = self.forces.gathered(k)
        g.position[k] = g.position[k] + g.velocity[k] * dt
        g.velocity[k] = self.kicked(k, g.velocity[k], force * (g.inverse_mass[k] * dt), g.inverse_mass[k])
        if ti.static(self.oriented):
            g.orientation[k] = g.orientation[k] + linear_orientation_change(
                g.orientation[k], g.angular_velocity[k] * dt
            )
        if ti.static(self.tumbles):
            inverse = ti.cast(g.inverse_inertia[k], ti.f64)
            g.angular_momentum[k] = self.pushed(k, torque * dt, inverse)
            g.angular_velocity[k] = angular_velocity_of(g.orientation[k], g.angular_momentum[k], inverse)
        elif ti.static(self.rotates):
            g.angular_velocity[k] = self.kicked(
                k, g.angular_velocity[k], torque * (g.inverse_inertia[k] * dt), g.inverse_inertia[k]
            )
        self.watch(k, before, step)
