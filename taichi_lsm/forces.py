"""Forces of the contacts: composes the geometry and the effects that a scene lists, at compile time."""

from .contact.narrow import sphere_overlap
from .contact.pairs import KICKED, PART_BASE, SLIDING, TOUCHING
from .effects import contact_type
from .effects.base import PHASES
from .rotation import spin_velocity, torque_of
from .runtime import current, ti


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
        self.ledger = grains.has("dissipated")
        self.laws = [e for e in in_order(effects) if e.phase != "body"]
        self.body_laws = [e for e in effects if e.phase == "body"]
        self.onset = pairs.onset
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
                a, b = g.shape[k], g.shape[l]
                if ti.static(self.several):
                    code = self.pairs.part_code[s]
                    a = self.parts.first[a] + code // PART_BASE
                    b = self.parts.first[b] + code % PART_BASE
                depth, n, arm_k = self.geometry.overlap(a, b, k, l, s, d)
            else:
                depth, n, at = sphere_overlap(d, r_k, r_l)
                arm_k = at * n
                if depth >= r_k + r_l:
                    self.faults.report(1, g.id[k], g.id[l])
            arm_l = arm_k - d
        return depth, n, arm_k, arm_l

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
    def onset_kick(self, contact, s, was, depth):
        """Impulse along the contact in the first step after it begins or ends; 0 in all others [N s].

        It makes up for the part of the step in which the force was not the trapezoid that Verlet takes it for. Its
        speed is that of the half step; a contact that began and ended within one step leaves nothing to correct.
        """
        pairs = self.pairs
        before = was & TOUCHING
        kick = 0.0 * depth
        if contact.touching != before:
            d = depth
            u = contact.approach
            if before == 1:
                d = pairs.last_depth[s]
                u = -u
            if u > 0.0 and d < u * contact.dt:
                for law in ti.static(self.springs):
                    kick += law.onset_impulse(u, d / (u * contact.dt), contact.dt)
        pairs.last_depth[s] = contact.depth
        return kick

    @ti.func
    def near_pairs(self, k):
        """Write the row's slots whose bounding spheres meet, or that have a past, to `pairs.near`, from the start of
        the row on; returns the end. No branch depends on a distance: many of them would be mispredicted.
        """
        g, pairs = self.grains, self.pairs
        end = pairs.row_start[k]
        for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
            l = pairs.partner[s]
            d = self.shortest(k, l)
            meet = d.dot(d) < (g.radius[k] + g.radius[l]) ** 2
            if ti.static(self.several):
                code = pairs.part_code[s]
                meet = self.parts.apart(k, l, code // PART_BASE, code % PART_BASE, d) < 0.0
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
            depth, n, arm_k, arm_l = self.overlap(k, l, s, d, was)
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
                    kick = self.onset_kick(contact, s, was, depth)
                    if kick != 0.0:
                        status += KICKED
                        pairs.pair_kick[s] = kick * n
                        push -= kick * n
                        if ti.static(self.rotates):
                            pairs.pair_twist[s] = torque_of(arm_l, kick * n)
                            twist -= torque_of(arm_k, kick * n)
                pairs.status[s] = status
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
