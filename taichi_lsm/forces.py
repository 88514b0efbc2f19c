"""Forces of the contacts: composes the geometry and the effects that a scene lists, at compile time."""

from .contact.narrow import sphere_overlap
from .contact.pairs import KICKED, PART_BASE, SLIDING, TOUCHING
from .effects import contact_type
from .effects.base import PHASES
from .rotation import spin_velocity, torque_of, turned, unrotate
from .runtime import current, ti

NEARLY = 1.0 - 1e-12  # rounding of a long way must not hide a contact
LEAST_FRACTION = 0.03  # of a step after a seam: in less the features do not differ by more than their errors
GREATEST_KINK = 0.05  # change of the force in the step of a crossing, over the force: more is no mere kink


def in_order(effects):
    """Effects sorted by phase: tangential laws read the complete normal force."""
    return sorted(effects, key=lambda e: PHASES.index(e.phase))


@ti.data_oriented
class ContactForces:
    """One row of the half list at a time: sums stay in registers, the pair's force is stored for its partner.

    surfaces: table of the patches, None for spheres; parts: table of the parts, None if every grain has one.
    A depth that reaches its cap, where no pair of patches faces each other uniquely any more, goes to `faults`.
    """

    def __init__(self, grains, surfaces, parts, domain, pairs, effects, faults):
        self.grains, self.domain, self.pairs, self.faults = grains, domain, pairs, faults
        self.parts, self.several = parts, parts is not None
        self.shaped = surfaces is not None
        if self.shaped:
            self.geometry = surfaces.contact(grains, pairs, faults)
        self.real = current().real
        self.dim = grains.dim
        self.rotates = grains.has("spin")
        self.tumbles = grains.has("angular_momentum")
        self.ledger = grains.has("dissipated")
        self.laws = [e for e in in_order(effects) if e.phase != "body"]
        self.body_laws = [e for e in effects if e.phase == "body"]
        self.onset = pairs.onset
        self.remembers = pairs.remembers_feature
        self.seams = pairs.onset and self.remembers
        self.springs = [e for e in self.laws if hasattr(type(e), "onset_impulse")]
        self.books = [e for e in self.laws if e.dissipates]
        self.book_count = max(1, len(self.books))
        self.contact_type = contact_type(self.dim)

    def history_slice(self, law):
        """(first, size) of a law's values in the pair's history."""
        first = sum(e.history_size(self.dim) for e in self.laws[: self.laws.index(law)])
        return first, law.history_size(self.dim)

    def book_of(self, law):
        """Column of the energy ledger in which a law books what it dissipates."""
        return self.books.index(law)

    @ti.func
    def shortest(self, k, l):
        """Vector from grain k to the nearest image of grain l [m], in the precision of the contact geometry."""
        return ti.cast(self.domain.displacement(self.grains.position[k], self.grains.position[l]), self.real)

    @ti.func
    def overlap(self, k, l, s, d, was):
        """(depth [m], normal k -> l, arm_k, arm_l [m]) of grains d = c_l - c_k apart; depth < 0 if they are apart.

        Beyond the bounding spheres, Eq. (1), only a pair that touched in the last step (`was`) is looked at.
        """
        g = self.grains
        depth = ti.cast(-1.0, self.real)
        n, arm_k, arm_l = 0.0 * d, 0.0 * d, 0.0 * d
        r_k, r_l = g.radius[k], g.radius[l]
        if d.dot(d) < (r_k + r_l) ** 2 or was != 0:
            if ti.static(self.shaped):
                a, b = self.parts_of(k, l, s)
                depth, n, arm_k = self.geometry.overlap(a, b, k, l, s, d)
            else:
                depth, n, at = sphere_overlap(d, r_k, r_l)
                arm_k = at * n
                if depth >= r_k + r_l:
                    self.faults.report(1, g.id[k], g.id[l])
            arm_l = arm_k - d
        return depth, n, arm_k, arm_l

    @ti.func
    def met(self, c, k, l, s, d, was):
        """As `overlap`, of the pair that `near_pairs` noted at place c; a depth beyond the cap is reported."""
        g = self.grains
        depth = ti.cast(-1.0, self.real)
        n, arm_k, arm_l = 0.0 * d, 0.0 * d, 0.0 * d
        if ti.static(self.shaped):
            depth, n, arm_k, arm_l = self.overlap(k, l, s, d, was)
        else:
            n = ti.Vector([self.pairs.gap[c][axis] for axis in range(self.dim)], self.real)
            depth = self.pairs.gap[c][self.dim]
            arm_k = (g.radius[k] - 0.5 * depth) * n
            arm_l = arm_k - d
            if depth >= g.radius[k] + g.radius[l]:
                self.faults.report(1, g.id[k], g.id[l])
        return depth, n, arm_k, arm_l

    @ti.func
    def parts_of(self, k, l, s):
        """Rows of the surface table that list slot s is about: the part of grain k and that of grain l."""
        g = self.grains
        a, b = g.shape[k], g.shape[l]
        if ti.static(self.several):
            code = self.pairs.part_code[s]
            a = self.parts.first[a] + code // PART_BASE
            b = self.parts.first[b] + code % PART_BASE
        return a, b

    @ti.func
    def spin_difference(self, omega_k, omega_l, arm_k, arm_l):
        """Part of the relative velocity of l against k at the contact that comes from the spins [m s-1]."""
        return spin_velocity(omega_l, arm_l) - spin_velocity(omega_k, arm_k)

    @ti.func
    def contact_of(self, k, l, depth, n, arm_k, arm_l, dt):
        """The kinematics of a contact as the laws see it."""
        g = self.grains
        contact = self.contact_type(0)
        v = ti.cast(g.velocity[l] - g.velocity[k], self.real)
        if ti.static(self.rotates):
            omega_k, omega_l = ti.cast(g.spin[k], self.real), ti.cast(g.spin[l], self.real)
            if ti.static(self.shaped):
                v += self.spin_difference(omega_k, omega_l, arm_k, arm_l)
            else:  # both arms lie along the normal
                a, b = g.radius[k] - 0.5 * depth, g.radius[l] - 0.5 * depth
                v -= spin_velocity(a * omega_k + b * omega_l, n)
            if ti.static(self.dim == 3):
                contact.spin_about_normal = 0.5 * n.dot(omega_k + omega_l)
        v_n = v.dot(n)
        contact.touching = depth > 0.0
        contact.depth = ti.max(depth, 0.0)
        contact.normal = n
        contact.approach = -v_n
        contact.slip = v - v_n * n
        contact.mass = 1.0 / (g.inverse_mass[k] + g.inverse_mass[l])
        contact.dt = dt
        return contact

    @ti.func
    def history_of(self, law: ti.template(), s):
        """The law's own values of list slot s."""
        first, size = ti.static(self.history_slice(law))
        return ti.Vector([self.pairs.history[s][first + c] for c in range(size)], self.real)

    @ti.func
    def onset_kick(self, contact, k, l, s, d, was, depth, n, arm_k, arm_l):
        """Impulse along the contact in the first step after it begins or ends; 0 in all others [N s].

        It makes up for the part of the step in which the force was not the trapezoid that Verlet takes it for; see
        `passage`. A contact that began and ended within one step leaves nothing to correct.
        """
        before = was & TOUCHING
        kick = 0.0 * depth
        if contact.touching != before:
            dt = contact.dt
            last, earlier = self.depths_before(k, l, s, d, n, dt)
            u, inside = (depth - last) / dt, depth
            acceleration = (u - (last - earlier) / dt) / dt
            if before == 1:  # with time reversed the contact begins; its own force fades within the step
                u, inside = -u, last
                ease = self.mobility(k, torque_of(arm_k, n)) + self.mobility(l, torque_of(arm_l, n))
                acceleration += self.elastic_force(ti.max(last, 0.0)) * ease
            u, time = self.passage(inside, u, acceleration, dt)
            if u > 0.0 and time < dt:
                for law in ti.static(self.springs):
                    kick += law.onset_impulse(u, acceleration, time / dt, dt)
        return kick

    @ti.func
    def depths_before(self, k, l, s, d, n, dt):
        """Depths [m] one and two steps ago of the features that face each other now, continued beyond their bounds."""
        g = self.grains
        d_1 = d - ti.cast(g.velocity[l] - g.velocity[k], self.real) * dt
        d_2 = d_1 - ti.cast(g.last_velocity[l] - g.last_velocity[k], self.real) * dt
        depth_1 = g.radius[k] + g.radius[l] - d_1.norm()
        depth_2 = g.radius[k] + g.radius[l] - d_2.norm()
        if ti.static(self.shaped):
            a, b = self.parts_of(k, l, s)
            features = self.remembered(s)[0]
            turn_k = turned(g.orientation[k], g.spin[k], -dt)
            turn_l = turned(g.orientation[l], g.spin[l], -dt)
            depth_1, m, _ = self.geometry.continued(a, b, k, l, features, d_1, turn_k, turn_l, n)
            turn_k, turn_l = turned(turn_k, g.last_spin[k], -dt), turned(turn_l, g.last_spin[l], -dt)
            depth_2, m, _ = self.geometry.continued(a, b, k, l, features, d_2, turn_k, turn_l, n)
        return depth_1, depth_2

    @ti.func
    def passage(self, d, u, acceleration, dt):
        """(speed [m s-1] at which the depth passed zero, time since then [s]) if it is d now and grew at the mean speed
        u over the step; of a contact that ends the same with time reversed. Speed 0 where there is no such time."""
        now = u + 0.5 * acceleration * dt
        square = now * now - 2.0 * acceleration * d
        speed, time = 0.0 * d, dt
        if now > 0.0 and square > 0.0:
            speed = ti.sqrt(square)
            time = 2.0 * d / (now + speed)
        return speed, time

    @ti.func
    def principal(self, k, a):
        """World vector `a` along the axes to which `inverse_inertia` of grain k belongs."""
        result = a
        if ti.static(self.tumbles):
            result = unrotate(ti.cast(self.grains.orientation[k], self.real), a)
        return result

    @ti.func
    def mobility(self, k, lever):
        """Acceleration of a point of grain k per force [kg-1]; lever = arm x direction of the force [m]."""
        result = self.grains.inverse_mass[k]
        if ti.static(self.rotates):
            lever = self.principal(k, lever)
            result += (lever * lever * self.grains.inverse_inertia[k]).sum()
        return result

    @ti.func
    def elastic_force(self, depth):
        """Force of the springs alone at this depth [N]."""
        contact = self.contact_type(0)
        contact.depth = depth
        for law in ti.static(self.springs):
            law.on_contact(contact, 0)
        return contact.normal_force

    @ti.func
    def remembered(self, s):
        """(features, normal) of list slot s before the step, as far as the geometry keeps them."""
        features = ti.Vector([0, 0])
        n = ti.Vector([ti.cast(0.0, self.real)] * self.dim)
        if ti.static(self.remembers):
            features = self.pairs.feature[s]
            if ti.static(self.pairs.remembers_normal):
                n = self.pairs.normal[s]
        return features, n

    @ti.func
    def seam_kick(self, k, l, s, d, before, last_n, depth, n, arm_k, dt):
        """(impulse on l [N s], angular impulses on k and on l [N m s]) in the step in which a contact crosses a seam.

        At a seam the radius of curvature jumps, and with it the rate at which the normal turns: force and torques are
        continuous but have a kink. What the old features, continued beyond the seam, would give now differs from what
        the new ones give by the jump of the rates times the time since the crossing, a dt. The trapezoidal rule errs
        by -c dt^2 zeta(-1, a), c the jump of the rate, as where a contact begins.
        """
        a, b = self.parts_of(k, l, s)
        fraction, old_depth, old_n, old_x = self.geometry.crossing(a, b, k, l, d, before, last_n, dt)
        kick = 0.0 * n
        twist_k, twist_l = torque_of(n, kick), torque_of(n, kick)
        if fraction > LEAST_FRACTION and fraction < 1.0 and old_depth > 0.0:
            f, old_f = self.elastic_force(depth) * n, self.elastic_force(old_depth) * old_n
            if (f - old_f).norm() < GREATEST_KINK * f.norm():
                scale = 0.5 * dt * (fraction - 1.0 + 1.0 / (6.0 * fraction))
                kick = scale * (f - old_f)
                twist_k = -scale * (torque_of(arm_k, f) - torque_of(old_x, old_f))
                twist_l = scale * (torque_of(arm_k - d, f) - torque_of(old_x - d, old_f))
        return kick, twist_k, twist_l

    @ti.func
    def near_pairs(self, k):
        """Write the row's slots whose bounding spheres meet, or that have a past, to `pairs.near`, from the start of
        the row on; returns the end. No branch depends on a distance: many of them would be mispredicted.

        The geometry of spheres is kept in `pairs.gap`: done here for all pairs, one does not wait for the laws of the
        one before, and the processor works on several roots and divisions at once. Shaped grains that were a gap apart
        are left out until their surfaces have travelled so far that they may touch.
        """
        g, pairs = self.grains, self.pairs
        end = pairs.row_start[k]
        for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
            l = pairs.partner[s]
            d = self.shortest(k, l)
            meet = d.dot(d) < (g.radius[k] + g.radius[l]) ** 2
            if ti.static(not self.shaped):
                depth, n, _ = sphere_overlap(d, g.radius[k], g.radius[l])
                meet = depth > 0.0
                for axis in ti.static(range(self.dim)):
                    pairs.gap[end][axis] = n[axis]
                pairs.gap[end][self.dim] = depth
            if ti.static(self.several):
                code = pairs.part_code[s]
                meet = self.parts.apart(k, l, code // PART_BASE, code % PART_BASE, d) < 0.0
            if ti.static(self.remembers):
                meet = meet and g.travel[k] + g.travel[l] >= pairs.free_until[s]
            pairs.near[end] = s
            end += ti.cast(meet, ti.i32) | ti.cast(pairs.status[s] != 0, ti.i32)
        return end

    @ti.func
    def row(self, k, dt):
        """Evaluate the contacts in grain k's row and store their forces; pairs are oriented from the lower id.

        A pair that has just parted is evaluated once more, so that its history is booked and cleared.
        """
        g, pairs = self.grains, self.pairs
        force = ti.Vector([ti.cast(0.0, self.real)] * self.dim)
        torque = ti.Vector([ti.cast(0.0, self.real)] * g.sizes["spin"])
        push, twist = 0.0 * force, 0.0 * torque
        spent = ti.Vector([ti.cast(0.0, ti.f64)] * self.book_count)
        for c in range(pairs.row_start[k], self.near_pairs(k)):
            s = pairs.near[c]
            l = pairs.partner[s]
            d = self.shortest(k, l)
            was = pairs.status[s]
            before, last_n = self.remembered(s)
            depth, n, arm_k, arm_l = self.met(c, k, l, s, d, was)
            if depth > 0.0 or was != 0:
                contact = self.contact_of(k, l, depth, n, arm_k, arm_l, dt)
                for law in ti.static(self.laws):
                    if ti.static(law.history_size(self.dim) > 0):
                        first, size = ti.static(self.history_slice(law))
                        memory = self.history_of(law, s)
                        lost = law.on_contact(contact, memory)
                        for c in ti.static(range(size)):
                            pairs.history[s][first + c] = memory[c]
                        if ti.static(self.ledger and law.dissipates):
                            spent[ti.static(self.book_of(law))] += lost
                    else:
                        memory = 0
                        law.on_contact(contact, memory)
                f = contact.normal_force * n + contact.tangential_force
                pairs.pair_force[s] = f
                force -= f
                if ti.static(self.rotates):
                    if ti.static(self.shaped):
                        pairs.pair_torque[s] = torque_of(arm_l, f)
                        torque -= torque_of(arm_k, f)
                    else:
                        turning = torque_of(n, contact.tangential_force)
                        pairs.pair_torque[s] = -(g.radius[l] - 0.5 * depth) * turning
                        torque -= (g.radius[k] - 0.5 * depth) * turning
                status = ti.select(contact.touching == 1, TOUCHING + SLIDING * contact.sliding, 0)
                if ti.static(self.onset):
                    size = self.onset_kick(contact, k, l, s, d, was, depth, n, arm_k, arm_l)
                    kick = size * n
                    kicked = size != 0.0
                    if ti.static(self.rotates):
                        twist_k, twist_l = -torque_of(arm_k, kick), torque_of(arm_l, kick)
                        if ti.static(self.seams):
                            now = pairs.feature[s]
                            moved = now[0] != before[0] or now[1] != before[1]
                            if moved and (was & TOUCHING) and contact.touching == 1:
                                kick, twist_k, twist_l = self.seam_kick(
                                    k, l, s, d, before, last_n, depth, n, arm_k, contact.dt
                                )
                                kicked = True
                        if kicked:
                            twist += twist_k
                            pairs.pair_twist[s] = twist_l
                    if kicked:
                        status += KICKED
                        pairs.pair_kick[s] = kick
                        push -= kick
                pairs.status[s] = status
            if ti.static(self.remembers):
                way = g.travel[k] + g.travel[l]
                pairs.free_until[s] = ti.select(depth < 0.0, NEARLY * way - ti.cast(depth, ti.f64), -1.0)
        g.force[k] = force
        if ti.static(self.onset):
            g.kick[k] = push
            if ti.static(self.rotates):
                g.twist[k] = twist
        if ti.static(self.rotates):
            g.torque[k] = torque
        if ti.static(self.ledger):
            g.dissipated[k] += spent

    @ti.func
    def gathered(self, k):
        """(force [N], torque [N m], impulse [N s], angular impulse [N m s]) on grain k: its own row, then its column
        in rising ids, then body forces. Impulses are zero but where contacts begin or end."""
        g, pairs = self.grains, self.pairs
        force = ti.cast(g.force[k], ti.f64)
        torque = ti.Vector([ti.cast(0.0, ti.f64)] * g.sizes["spin"])
        kick, twist = 0.0 * force, 0.0 * torque
        if ti.static(self.rotates):
            torque = ti.cast(g.torque[k], ti.f64)
        if ti.static(self.onset):
            kick = ti.cast(g.kick[k], ti.f64)
            if ti.static(self.rotates):
                twist = ti.cast(g.twist[k], ti.f64)
        for c in range(pairs.column_start[k], pairs.column_start[k + 1]):
            s = pairs.column[c]
            force += pairs.pair_force[s]  # zero where the pair is apart: a branch would often be mispredicted
            if ti.static(self.rotates):
                torque += pairs.pair_torque[s]
            if ti.static(self.onset):
                if pairs.status[s] & KICKED:
                    kick += pairs.pair_kick[s]
                    if ti.static(self.rotates):
                        twist += pairs.pair_twist[s]
        for law in ti.static(self.body_laws):
            law.on_grain(g.inverse_mass[k], force)
        return force, torque, kick, twist
