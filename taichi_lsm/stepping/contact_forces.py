"""Forces of the contacts, in blocks of pairs: geometry and laws as the scene composes them."""

from ..contact.contact_block import AXIS, block_width, get, lane_type, padded, put
from ..contact.pair_storage import ACTING, KICKED, SLIDING, TOUCHING
from ..contact.primitives import sphere_overlap
from ..core.rotation import spin_velocity, torque_of
from ..core.runtime import ti
from .effect_set import Composition
from .onset_correction import OnsetCorrection

NEARLY = 1.0 - 1e-12  # rounding of a long way must not hide a contact


@ti.data_oriented
class ContactForces(Composition):
    """Evaluates the half list in blocks of pairs; stores each pair's force for its partner and sums the rows.

    A block passes through four stages, see contact/lanes.py: `survey` finds the pairs that are near, `meet` gathers
    what the laws need, `apply_laws` is arithmetic over lanes alone, `keep` scatters the results.
    """

    def __init__(self, geometry, domain, effects, walls=None, bonds=None):
        super().__init__(geometry, effects, bonds)
        self.domain, self.walls, self.walled = domain, walls, walls is not None
        pairs = self.pairs
        self.twists = pairs.onset and self.shaped  # impulses that do not go through the centres
        self.remembers, self.remembers_normal = pairs.remembers_feature, pairs.remembers_normal
        self.seams = pairs.onset and self.remembers
        self.correction = OnsetCorrection(self.geometry, self.springs, self.contact_type)
        self.width, self.lanes = block_width(), self._lanes()

    def _lanes(self):
        """What a block holds of each contact. `lost` and `memory` have a component per book and per history value."""
        scalars = ["depth", "inverse_mass"]
        vectors = {"normal": self.dim, "velocity": self.dim, "force": self.dim}
        vectors |= {"lost": self.book_count if self.ledger else 0, "memory": self.pairs.history_size}
        integers = ["slot", "was", "near", "status"]
        scalars += ["reduced_radius"] if "reduced_radius" in self.needs else []
        if self.rotates:
            vectors |= {"torque_k": self.spin_size, "torque_l": self.spin_size}
            if self.shaped:
                scalars += ["spin_about_normal"]
                vectors |= {"arm_k": self.dim, "arm_l": self.dim}
                vectors |= {"relative_spin": self.spin_size if "relative_spin" in self.needs else 0}
            else:
                scalars += ["radius_k", "radius_l"]
                vectors |= {"spin_k": self.spin_size, "spin_l": self.spin_size}
        if self.seams:
            integers += ["feature_k", "feature_l"]
            vectors |= {"last_normal": self.dim if self.remembers_normal else 0}
        return lane_type(scalars, vectors, integers)

    @ti.func
    def rows(self, lanes: ti.template(), first, last, dt):
        """Evaluate the contacts in the rows of grains first to last - 1 and store their forces.

        Pairs are oriented from the lower id. A pair that has just parted is evaluated once more, so that its history
        is booked and cleared.
        """
        pairs = self.pairs
        cleared = first
        s, end = pairs.row_start[first], pairs.row_start[last]
        while s < end:
            stop = ti.min(s + self.width, end)
            while cleared < last and pairs.row_start[cleared] < stop:
                self.clear(cleared)
                cleared += 1
            near = self.survey(lanes, s, stop - s)
            met = self.meet(lanes, near)
            self.apply_laws(lanes, met, dt)
            self.keep(lanes, met, dt)
            s = stop
        for k in range(cleared, last):
            self.clear(k)
        if ti.static(self.walled):
            for k in range(first, last):
                self.walls.touch(self, k, dt)

    @ti.func
    def clear(self, k):
        """Begin the sums over the row of grain k."""
        g = self.grains
        g.force[k] = ti.Vector([ti.cast(0.0, self.real)] * self.dim)
        if ti.static(self.onset):
            g.kicked[k] = ti.cast(0, ti.i8)
        if ti.static(self.rotates):
            g.torque[k] = ti.Vector([ti.cast(0.0, self.real)] * self.spin_size)
        if ti.static(self.twists):
            g.twist[k] = ti.Vector([ti.cast(0.0, self.real)] * self.spin_size)

    @ti.func
    def survey(self, lanes: ti.template(), first, count):
        """Put the slots from `first` on that are near, or that have a past, into the first lanes; returns how many.

        No branch depends on a distance: many of them would be mispredicted. Of spheres the lanes then hold normal and
        depth, of other grains the vector between the centres in place of the normal.
        """
        g, pairs = self.grains, self.pairs
        for c in range(count):
            s = first + c
            k, l = pairs.first[s], pairs.partner[s]
            d = self.geometry.shortest(k, l)
            put(lanes, "normal", c, d)
            if ti.static(self.shaped):
                lanes.near[c] = self.geometry.near(k, l, s, d)
            else:
                lanes.depth[c] = g.radius[k] + g.radius[l]
        if ti.static(not self.shaped):
            for c in range(padded(count)):
                depth, n, _ = sphere_overlap(get(lanes, "normal", c, self.dim), lanes.depth[c], 0.0)
                put(lanes, "normal", c, n)
                lanes.depth[c] = depth
                lanes.near[c] = ti.cast(depth > self.geometry.least_depth(), ti.i32)
        near = 0
        for c in range(count):
            was = ti.cast(pairs.status[first + c], ti.i32)
            lanes.slot[near], lanes.was[near] = first + c, was
            put(lanes, "normal", near, get(lanes, "normal", c, self.dim))
            if ti.static(not self.shaped):
                lanes.depth[near] = lanes.depth[c]
            near += lanes.near[c] | ti.cast(was != 0, ti.i32)
        return near

    @ti.func
    def meet(self, lanes: ti.template(), near):
        """Gather what the laws need of the near pairs that touch or did so before; returns how many there are."""
        g, pairs = self.grains, self.pairs
        met = near
        if ti.static(self.shaped):
            met = 0
            for i in range(near):
                s, was = lanes.slot[i], lanes.was[i]
                lanes.slot[met], lanes.was[met] = s, was
                met += self.meet_surfaces(lanes, met, s, was, get(lanes, "normal", i, self.dim))
        else:
            for i in range(near):
                s = lanes.slot[i]
                k, l = pairs.first[s], pairs.partner[s]
                self.geometry.check_cap(k, l, lanes.depth[i])
                put(lanes, "velocity", i, self.geometry.relative_velocity(k, l))
                lanes.inverse_mass[i] = g.inverse_mass[k] + g.inverse_mass[l]
                if ti.static("reduced_radius" in self.needs):
                    lanes.reduced_radius[i] = self.geometry.reduced_radius(k, l, s)
                if ti.static(self.rotates):
                    lanes.radius_k[i], lanes.radius_l[i] = g.radius[k], g.radius[l]
                    put(lanes, "spin_k", i, ti.cast(g.spin[k], self.real))
                    put(lanes, "spin_l", i, ti.cast(g.spin[l], self.real))
        if ti.static(pairs.history_size > 0):
            for i in range(met):
                put(lanes, "memory", i, pairs.history[lanes.slot[i]])
        return met

    @ti.func
    def meet_surfaces(self, lanes: ti.template(), i, s, was, d):
        """Find where the surfaces of slot s, d = c_l - c_k apart [m], touch and put the contact into lane i; returns 0
        if it can be forgotten."""
        g, pairs = self.grains, self.pairs
        k, l = pairs.first[s], pairs.partner[s]
        before, last_n = self.geometry.remembered(s)
        depth, n, arm_k, arm_l = self.geometry.overlap(k, l, s, d, was)
        if ti.static(self.remembers):
            way = g.travel[k] + g.travel[l]
            apart = ti.cast(self.geometry.least_depth() - depth, ti.f64)
            pairs.free_until[s] = ti.select(apart > 0.0, NEARLY * way + apart, -1.0)
        lanes.depth[i] = depth
        put(lanes, "normal", i, n)
        put(lanes, "velocity", i, self.velocity_at(k, l, arm_k, arm_l))
        lanes.inverse_mass[i] = g.inverse_mass[k] + g.inverse_mass[l]
        if ti.static("reduced_radius" in self.needs):
            lanes.reduced_radius[i] = self.geometry.reduced_radius(k, l, s)
        if ti.static("relative_spin" in self.needs):
            put(lanes, "relative_spin", i, ti.cast(g.spin[l] - g.spin[k], self.real))
        put(lanes, "arm_k", i, arm_k)
        put(lanes, "arm_l", i, arm_l)
        if ti.static(self.dim == 3):
            lanes.spin_about_normal[i] = 0.5 * n.dot(ti.cast(g.spin[k] + g.spin[l], self.real))
        if ti.static(self.seams):
            lanes.feature_k[i], lanes.feature_l[i] = before[0], before[1]
            if ti.static(self.remembers_normal):
                put(lanes, "last_normal", i, last_n)
        return ti.cast(depth > self.geometry.least_depth(), ti.i32) | ti.cast(was != 0, ti.i32)

    @ti.func
    def in_lane(self, lanes: ti.template(), i, dt):
        """The contact in lane i as the laws see it."""
        depth, n = lanes.depth[i], get(lanes, "normal", i, self.dim)
        v = get(lanes, "velocity", i, self.dim)
        spin_about_normal = 0.0 * depth
        if ti.static(self.rotates and self.shaped):
            spin_about_normal = lanes.spin_about_normal[i]
        elif ti.static(self.rotates):  # both arms lie along the normal
            omega_k, omega_l = get(lanes, "spin_k", i, self.spin_size), get(lanes, "spin_l", i, self.spin_size)
            a, b = lanes.radius_k[i] - 0.5 * depth, lanes.radius_l[i] - 0.5 * depth
            v -= spin_velocity(a * omega_k + b * omega_l, n)
            if ti.static(self.dim == 3):
                spin_about_normal = 0.5 * n.dot(omega_k + omega_l)
        contact = self.seen(v, n, depth, lanes.inverse_mass[i], spin_about_normal, dt)
        if ti.static("reduced_radius" in self.needs):
            contact.reduced_radius = lanes.reduced_radius[i]
        if ti.static("relative_spin" in self.needs):
            if ti.static(self.shaped):
                contact.relative_spin = get(lanes, "relative_spin", i, self.spin_size)
            else:
                spin_k, spin_l = get(lanes, "spin_k", i, self.spin_size), get(lanes, "spin_l", i, self.spin_size)
                contact.relative_spin = spin_l - spin_k
        return contact

    @ti.func
    def apply_laws(self, lanes: ti.template(), count, dt):
        """Forces of the contacts in the first lanes, Eq. (10), and torques on both grains, Eq. (15)."""
        for i in range(padded(count)):
            contact = self.in_lane(lanes, i, dt)
            for law in ti.static(self.laws):
                self.apply(lanes, i, contact, law)
            n = contact.normal
            f = contact.normal_force * n + contact.tangential_force
            put(lanes, "force", i, f)
            if ti.static(self.rotates):
                self.turn(lanes, i, contact, f)
            status = ti.select(contact.touching == 1, TOUCHING + SLIDING * contact.sliding, 0)
            if ti.static(self.reaches):
                status += ti.select(lanes.depth[i] > self.geometry.least_depth(), ACTING, 0)
            lanes.status[i] = status

    @ti.func
    def turn(self, lanes: ti.template(), i, contact: ti.template(), f):
        """Torques on both grains of the contact in lane i, Eq. (15): of the force f [N] on l, and the laws' couple."""
        turning = torque_of(contact.normal, contact.tangential_force)
        torque_k, torque_l = turning, turning
        if ti.static(self.shaped):
            torque_k = torque_of(get(lanes, "arm_k", i, self.dim), f)
            torque_l = torque_of(get(lanes, "arm_l", i, self.dim), f)
        else:
            torque_k = (lanes.radius_k[i] - 0.5 * lanes.depth[i]) * turning
            torque_l = -(lanes.radius_l[i] - 0.5 * lanes.depth[i]) * turning
        if ti.static(self.couples):
            torque_k += contact.couple
            torque_l += contact.couple
        put(lanes, "torque_k", i, torque_k)
        put(lanes, "torque_l", i, torque_l)

    @ti.func
    def apply(self, lanes: ti.template(), i, contact: ti.template(), law: ti.template()):
        """Add one law to the contact in lane i; its history is read from the lanes and written back."""
        lost = 0.0 * contact.depth
        if ti.static(law.history_size(self.dim) > 0):
            first, size = ti.static(self.history_slice(law))
            memory = ti.Vector([lanes["memory" + AXIS[first + c]][i] for c in range(size)])
            lost = law.on_contact(contact, memory)
            for c in ti.static(range(size)):
                lanes["memory" + AXIS[first + c]][i] = memory[c]
        else:
            lost = law.on_contact(contact, 0)
        if ti.static(self.ledger and law.dissipates):
            lanes["lost" + AXIS[ti.static(self.book_of(law))]][i] = lost

    @ti.func
    def keep(self, lanes: ti.template(), count, dt):
        """Store forces, histories and status of the contacts in the first lanes, and add up their rows."""
        g, pairs = self.grains, self.pairs
        for i in range(count):
            s = lanes.slot[i]
            k = pairs.first[s]
            f = get(lanes, "force", i, self.dim)
            pairs.pair_force[s] = f
            g.force[k] = g.force[k] - f
            if ti.static(self.rotates):
                pairs.pair_torque[s] = get(lanes, "torque_l", i, self.spin_size)
                g.torque[k] = g.torque[k] - get(lanes, "torque_k", i, self.spin_size)
            if ti.static(pairs.history_size > 0):
                pairs.history[s] = get(lanes, "memory", i, pairs.history_size)
            if ti.static(self.ledger and self.book_count > 0):
                for book in ti.static(range(self.book_count)):
                    lost = ti.cast(lanes["lost" + AXIS[book]][i], ti.f64)
                    g.dissipated[k][book] = g.dissipated[k][book] + lost
            status = lanes.status[i]
            if ti.static(self.onset):
                status += self.correct(lanes, i, s, k, dt)
            pairs.status[s] = ti.cast(status, ti.i8)
            if ti.static(self.domain.sheared):
                push = ti.cast(f[0], ti.f64) * dt
                if ti.static(self.onset):
                    if status & KICKED:
                        push += pairs.pair_kick[s][0]
                self.geometry.book_shear(k, push * self.geometry.shortest(k, pairs.partner[s])[1])

    @ti.func
    def correct(self, lanes: ti.template(), i, s, k, dt):
        """Store the impulse if the contact in lane i began, ended or crossed a seam in this step: KICKED, else 0."""
        pairs = self.pairs
        was, touching = lanes.was[i] & TOUCHING, lanes.status[i] & TOUCHING
        result = 0
        if touching != was:
            n, depth, d, arm_k = self.met_again(lanes, i, s, k)
            l = pairs.partner[s]
            size = self.correction.end_kick(k, l, s, d, touching, depth, n, arm_k, arm_k - d, dt)
            if size != 0.0:
                kick = size * n
                self.store_kick(s, k, kick, -torque_of(arm_k, kick), torque_of(arm_k - d, kick))
                result = KICKED
        if ti.static(self.seams):
            before, now = ti.Vector([lanes.feature_k[i], lanes.feature_l[i]]), pairs.feature[s]
            if (now[0] != before[0] or now[1] != before[1]) and was == 1 and touching == 1:
                n, depth, d, arm_k = self.met_again(lanes, i, s, k)
                last_n = 0.0 * n
                if ti.static(self.remembers_normal):
                    last_n = get(lanes, "last_normal", i, self.dim)
                l = pairs.partner[s]
                kick, twist_k, twist_l = self.correction.seam_kick(k, l, s, d, before, last_n, depth, n, arm_k, dt)
                self.store_kick(s, k, kick, twist_k, twist_l)
                result = KICKED
        return result

    @ti.func
    def met_again(self, lanes: ti.template(), i, s, k):
        """(normal, depth [m], vector between the centres [m], arm of grain k [m]) of the contact in lane i."""
        n, depth = get(lanes, "normal", i, self.dim), lanes.depth[i]
        d = self.geometry.shortest(k, self.pairs.partner[s])
        arm_k = (self.grains.radius[k] - 0.5 * depth) * n
        if ti.static(self.shaped):
            arm_k = get(lanes, "arm_k", i, self.dim)
        return n, depth, d, arm_k

    @ti.func
    def store_kick(self, s, k, kick, twist_k, twist_l):
        """Impulse on the second grain of slot s [N s] and angular impulses on both [N m s]."""
        g, pairs = self.grains, self.pairs
        pairs.pair_kick[s] = kick
        g.kicked[k] = ti.cast(1, ti.i8)
        if ti.static(self.twists):
            pairs.pair_twist[s] = twist_l
            g.twist[k] = g.twist[k] + twist_k

    @ti.func
    def gathered(self, k):
        """(force [N], torque [N m], impulse [N s], angular impulse [N m s]) on grain k: its own row, then its column
        in rising ids, then body forces, if it is mobile. Impulses are zero but where contacts begin or end."""
        g, pairs = self.grains, self.pairs
        force = ti.cast(g.force[k], ti.f64)
        torque = ti.Vector([ti.cast(0.0, ti.f64)] * g.sizes["spin"])
        kick, twist = 0.0 * force, 0.0 * torque
        if ti.static(self.rotates):
            torque = ti.cast(g.torque[k], ti.f64)
        if ti.static(self.onset):
            if g.kicked[k]:
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.status[s] & KICKED:
                        kick -= pairs.pair_kick[s]
                if ti.static(self.walled):
                    kick += self.walls.kick_on(self, k)
        if ti.static(self.twists):
            twist = ti.cast(g.twist[k], ti.f64)
        for c in range(pairs.column_start[k], pairs.column_start[k + 1]):
            s = pairs.column[c]
            force += pairs.pair_force[s]  # zero where the pair is apart: a branch would often be mispredicted
            if ti.static(self.rotates):
                torque += pairs.pair_torque[s]
            if ti.static(self.onset):
                if pairs.status[s] & KICKED:
                    kick += pairs.pair_kick[s]
                    if ti.static(self.twists):
                        twist += pairs.pair_twist[s]
        if ti.static(self.bonded):
            bond_force, bond_torque = self.bonds.gathered(g.id[k])
            force += bond_force
            torque += bond_torque
        if g.platen[k] < 0:  # the force on a platen is that of its contacts
            for law in ti.static(self.body_laws):
                law.on_grain(g.inverse_mass[k], force)
        return force, torque, kick, twist
