"""Impulses in the step in which a contact begins, ends or crosses a seam.

Verlet is the trapezoidal rule for the impulse of a force; where the force starts, stops or bends inside a step the rule
errs by a Hurwitz zeta term (generalised Euler-Maclaurin), which these impulses make up for. The force of a dashpot
starts with a jump, that of a spring with a slope.
"""

from ..contact.feature_pairs import NO_NORMAL
from ..core.rotation import advanced_orientation, torque_of
from ..core.runtime import current, ti

# Of a step after a seam: in less the features are taken not to differ by more than their errors. In f64 they do, by ten
# digits and more; the larger one leaves 3 % of the crossings without a correction.
LEAST_FRACTION, LEAST_OF_HERTZ = 0.03, 1e-6
GREATEST_KINK = 0.05  # change of the force in the step of a crossing, over the force: more is no mere kink


@ti.data_oriented
class OnsetCorrection:
    """The impulses of one scene. geometry: PairGeometry; effects: those of contacts, in the order of their phases.

    reduced_radius [m] in its functions is that of the contact, 0 where no effect needs it.
    """

    def __init__(self, spec, geometry, effects, contact_type):
        self.spec, self.geometry, self.contact_type = spec, geometry, contact_type
        self.springs = [e for e in effects if hasattr(type(e), "onset_impulse")]
        self.along_normal = [e for e in effects if e.phase in ("normal", "damping")]
        self.damped = any(e.phase == "damping" for e in effects)
        self.curved = any("reduced_radius" in e.needs for e in effects)
        exact = self.curved and current().precision == "f64"
        self.least_fraction = LEAST_OF_HERTZ if exact else LEAST_FRACTION
        self.grains = geometry.grains
        self.surface = geometry.surface if spec.shaped else None
        self.real = current().real

    @ti.func
    def end_impulse(self, k, l, s, d, began, depth, n, arm_k, arm_l, dt):
        """(impulse along the contact [N s], energy lost by it [J]) in the first step after it begins (1) or ends (0).

        It makes up for the share of the step in which the force was not the trapezoid that Verlet takes it for; see
        `passage`. A contact that began and ended within one step leaves nothing to correct; nor is one corrected whose
        features, continued to where they were, had no normal: when it began is then not known.
        """
        last, earlier = self.depths_before(k, l, s, d, n, dt)
        inverse_effective_mass = self.geometry.inverse_effective_mass(k, l, n, arm_k, arm_l)
        reduced_radius = self.reduced_radius(k, l, s)
        last_depth, earlier_depth = self.geometry.counted_depth(s, last), self.geometry.counted_depth(s, earlier)
        impulse, lost = self.impulse(
            began, depth, last_depth, earlier_depth, inverse_effective_mass, reduced_radius, dt
        )
        if ti.static(self.spec.shaped):
            if last == NO_NORMAL or earlier == NO_NORMAL:
                impulse, lost = 0.0 * depth, 0.0 * depth
        return impulse, lost

    @ti.func
    def reduced_radius(self, k, l, s):
        """Reduced radius [m] of the contact in slot s, 0 where no effect needs it."""
        radius = ti.cast(0.0, self.real)
        if ti.static(self.curved):
            radius = self.geometry.reduced_radius(k, l, s)
        return radius

    @ti.func
    def contact_of_radius(self, reduced_radius):
        """A contact of which only the reduced radius [m] is known."""
        contact = self.contact_type(0)
        if ti.static(self.curved):
            contact.reduced_radius = reduced_radius
        return contact

    @ti.func
    def impulse(self, began, depth, last, earlier, inverse_effective_mass, reduced_radius, dt):
        """`end_impulse` from the depths [m] now, a step ago (`last`) and two steps ago (`earlier`).

        inverse_effective_mass [kg-1]: acceleration of the depth per force. Speed and acceleration of the depth follow
        from the three depths; where the contact ends, time is reversed, so that it begins.
        """
        impulse, lost = 0.0 * depth, 0.0 * depth
        u, inside = (depth - last) / dt, depth
        acceleration = (u - (last - earlier) / dt) / dt
        if began == 0:  # the contact's own force fades within the step: it belongs to the acceleration of the last one
            u, inside = -u, last
            acceleration += self.elastic_force(ti.max(last, 0.0), reduced_radius) * inverse_effective_mass
        u, time = self.passage(inside, u, acceleration, dt)
        if u > 0.0 and time < dt:
            contact = self.contact_of_radius(reduced_radius)
            for effect in ti.static(self.springs):
                impulse += effect.onset_impulse(contact, u, acceleration, time / dt, dt)
            if ti.static(self.damped):
                if began == 1:
                    # The force of a dashpot begins with a jump F at once: c t^0, corrected by -F dt zeta(0, fraction).
                    jump = self.force_along_normal(0.0 * depth, u, inverse_effective_mass, reduced_radius, dt)
                    damping_impulse = jump * (time - 0.5 * dt)
                    impulse += damping_impulse
                    lost = damping_impulse * u
                else:
                    end = self.force_along_normal(ti.max(last, 0.0), -u, inverse_effective_mass, reduced_radius, dt)
                    if end == 0.0:
                        impulse = 0.0 * depth  # the force of a damped contact ends before the contact
        return impulse, lost

    @ti.func
    def depths_before(self, k, l, s, d, n, dt):
        """Overlaps [m] one and two steps ago of the features that face each other, continued beyond their bounds."""
        g = self.grains
        # Back along the velocities of the last two steps, which live half a step before the positions.
        d_1 = d - self.geometry.relative_velocity(k, l) * dt
        v = g.last_velocity[l] - g.last_velocity[k]
        if ti.static(self.spec.sheared):
            v[0] -= self.geometry.domain.border_speed(g.position[k], g.position[l])
        if ti.static(self.spec.cell_servo):
            v[1] += self.geometry.domain.stretch_rate() * d[1]
        d_2 = d_1 - ti.cast(v, self.real) * dt
        depth_1 = g.radius[k] + g.radius[l] - d_1.norm()
        depth_2 = g.radius[k] + g.radius[l] - d_2.norm()
        if ti.static(self.spec.shaped):
            a, b = self.geometry.parts_of(k, l, s)
            features = self.geometry.remembered(s)[0]
            q_k = advanced_orientation(g.orientation[k], g.angular_velocity[k], -dt)
            q_l = advanced_orientation(g.orientation[l], g.angular_velocity[l], -dt)
            depth_1, m, _ = self.surface.continued(a, b, k, l, features, d_1, q_k, q_l, n)
            q_k = advanced_orientation(q_k, g.last_angular_velocity[k], -dt)
            q_l = advanced_orientation(q_l, g.last_angular_velocity[l], -dt)
            depth_2, m, _ = self.surface.continued(a, b, k, l, features, d_2, q_k, q_l, n)
        return depth_1, depth_2

    @ti.func
    def passage(self, d, u, acceleration, dt):
        """(speed [m s-1] at which the depth passed zero, time since then [s]); speed 0 where there is no such time.

        The depth is d now and grew at the mean speed u over the step, with a constant acceleration: the root of
        d - u_now t + a t^2/2 = 0, in the form without cancellation.
        """
        now = u + 0.5 * acceleration * dt
        square = now * now - 2.0 * acceleration * d
        speed, time = 0.0 * d, dt
        if now > 0.0 and square > 0.0:
            speed = ti.sqrt(square)
            time = 2.0 * d / (now + speed)
        return speed, time

    @ti.func
    def elastic_force(self, depth, reduced_radius):
        """Force of the springs alone at this depth [N]."""
        contact = self.contact_of_radius(reduced_radius)
        contact.depth = depth
        for effect in ti.static(self.springs):
            effect.on_contact(contact, 0)
        return contact.normal_force

    @ti.func
    def force_along_normal(self, depth, approach, inverse_effective_mass, reduced_radius, dt):
        """Force of springs and dashpots [N] at this depth [m] and approach [m s-1] of a contact without a past."""
        contact = self.contact_of_radius(reduced_radius)
        contact.touching, contact.depth, contact.approach = 1, depth, approach
        contact.mass, contact.dt = 1.0 / inverse_effective_mass, dt
        for effect in ti.static(self.along_normal):
            if ti.static(effect.history_size(self.geometry.dim) > 0):
                history = ti.Vector([0.0 * depth] * ti.static(effect.history_size(self.geometry.dim)))
                effect.on_contact(contact, history)
            else:
                effect.on_contact(contact, 0)
        return contact.normal_force

    @ti.func
    def seam_impulse(self, k, l, s, d, before, last_normal, depth, n, arm_k, dt):
        """(impulse on l [N s], angular impulses on k and on l [N m s]) in the step in which a contact crosses a seam.

        At a seam the radius of curvature jumps, and with it the rate at which the normal turns: force and torques are
        continuous but have a kink. What the old features, continued beyond the seam, would give now differs from what
        the new ones give by the jump of the rates times the time since the crossing, a dt. The trapezoidal rule errs
        by -c dt^2 zeta(-1, a), c the jump of the rate, as where a contact begins.
        """
        a, b = self.geometry.parts_of(k, l, s)
        fraction, old_depth, old_normal, old_point = self.surface.crossing(a, b, k, l, d, before, last_normal, dt)
        old_depth = self.geometry.counted_depth(s, old_depth)
        impulse = 0.0 * n
        angular_impulse_k, angular_impulse_l = torque_of(n, impulse), torque_of(n, impulse)
        if fraction > self.least_fraction and fraction < 1.0 and old_depth > 0.0:
            reduced_radius = self.reduced_radius(k, l, s)
            f = self.elastic_force(depth, reduced_radius) * n
            old_f = self.elastic_force(old_depth, reduced_radius) * old_normal
            if (f - old_f).norm() < GREATEST_KINK * f.norm():
                scale = 0.5 * dt * (fraction - 1.0 + 1.0 / (6.0 * fraction))
                impulse = scale * (f - old_f)
                angular_impulse_k = -scale * (torque_of(arm_k, f) - torque_of(old_point, old_f))
                angular_impulse_l = scale * (torque_of(arm_k - d, f) - torque_of(old_point - d, old_f))
        return impulse, angular_impulse_k, angular_impulse_l
