"""The first-order schemes of Abe & Mora (2003), for comparison: one that works and the one that is printed."""

from ..core.rotation import angular_velocity_of, linear_orientation_change
from ..core.runtime import ti
from .verlet import VelocityVerlet


@ti.data_oriented
class SymplecticEuler(VelocityVerlet):
    """The paper's first-order scheme in its working form: Eqs. (13), (14) with x moved by the new velocity.

    The update is Verlet's; but velocities and positions are taken to belong to the same time, so that energies
    oscillate at first order.
    """

    half_step = False


@ti.data_oriented
class ExplicitEuler(VelocityVerlet):
    """The paper's scheme as printed: x moves by the old velocity, Eq. (14), and R by omega * R, Eq. (18).

    It gains energy and its rotations grow; it is here to show why it is not used.
    """

    half_step = False

    @ti.func
    def advance(self, k, step):
        """Drift by the old velocity, then kick; rotation by the old angular velocity."""
        g, dt = self.grains, self.dt[None]
        load = self.forces.total_load(k)
        g.position[k] = g.position[k] + g.velocity[k] * dt
        g.velocity[k] = self.velocity_after_kick(
            k, g.velocity[k], load.force * (g.inverse_mass[k] * dt), g.inverse_mass[k]
        )
        if ti.static(self.spec.oriented):
            change = linear_orientation_change(g.orientation[k], g.angular_velocity[k] * dt)
            g.orientation[k] = g.orientation[k] + change
        if ti.static(self.spec.tumbles):
            inverse = ti.cast(g.inverse_inertia[k], ti.f64)
            g.angular_momentum[k] = self.momentum_after_kick(k, load.torque * dt, inverse)
            g.angular_velocity[k] = angular_velocity_of(g.orientation[k], g.angular_momentum[k], inverse)
        elif ti.static(self.spec.rotates):
            inverse = g.inverse_inertia[k]
            g.angular_velocity[k] = self.velocity_after_kick(
                k, g.angular_velocity[k], load.torque * (inverse * dt), inverse
            )
