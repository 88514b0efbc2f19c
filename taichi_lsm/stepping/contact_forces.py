"""Forces of the contacts, in blocks of pairs: geometry and laws as the scene composes them."""

from ..contact.contact_block import AXIS, block_type, block_width, get, padded, put
from ..contact.pair_storage import ACTING, HAS_IMPULSE, SLIDING, TOUCHING
from ..contact.primitives import sphere_overlap
from ..core.rotation import rotational_velocity, torque_of
from ..core.runtime import ti
from .effect_set import EffectSet
from .onset_correction import OnsetCorrection

NEARLY = 1.0 - 1e-12  # rounding of a long way must not hide a contact


@ti.data_oriented
class ContactForces(EffectSet):
    """Evaluates the half list in blocks of pairs; stores each pair's force for its partner and sums the rows.

    A block passes through four stages, see contact/lanes.py: `survey` finds the pairs that are near, `meet` gathers
    what the laws need, `apply_effects` is arithmetic over lanes alone, `keep` scatters the results.
    """

    def __init__(self, geometry, domain, effects, walls=None, bonds=None):
        super().__init__(geometry, effects, bonds)
        self.domain, self.walls, self.walled = domain, walls, walls is not None
        pairs = self.pairs
        self.has_angular_impulse = pairs.onset and self.shaped  # impulses that do not go through the centres
        self.remembers, self.remembers_normal = pairs.remembers_feature, pairs.remembers_normal
        self.seams = pairs.onset and self.remembers
        self.correction = OnsetCorrection(self.geometry, self.springs, self.contact_type)
        self.width, self.block = block_width(), self._lanes()

    def _lanes(self):
        """What a block holds of each contact. `lost` and `memory` have a component per book and per history value."""
        scalars = ["depth", "inverse_mass"]
        vectors = {"normal": self.dim, "velocity": self.dim, "force": self.dim}
        vectors |= {
            "lost": self.contact_channel_count if self.track_dissipation else 0,
            "memory": self.pairs.history_size,
        }
        integers = ["slot", "was", "near", "status"]
        scalars += ["reduced_radius"] if "reduced_radius" in self.needs else []
        if self.rotates:
            vectors |= {"torque_k": self.rotation_size, "torque_l": self.rotation_size}
            if self.shaped:
                scalars += ["normal_angular_velocity"]
                vectors |= {"arm_k": self.dim, "arm_l": self.dim}
                vectors |= {
                    "relative_angular_velocity": self.rotation_size if "relative_angular_velocity" in self.needs else 0
                }
            else:
                scalars += ["radius_k", "radius_l"]
                vectors |= {"omega_k": self.rotation_size, "omega_l": self.rotation_size}
        if self.seams:
            integers += ["feature_k", "feature_l"]
            vectors |= {"last_normal": self.dim if self.remembers_normal else 0}
        return block_type(scalars, vectors, integers)

    @ti.func
    def rows(self, block: ti.template(), first, last, dt):
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
            near = self.survey(block, s, stop - s)
            met = self.meet(block, near)
            self.apply_effects(block, met, dt)
            self.keep(block, met, dt)
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
            g.has_impulse[k] = ti.cast(0, ti.i8)
        if ti.static(self.rotates):
            g.torque[k] = ti.Vector([ti.cast(0.0, self.real)] * self.rotation_size)
        if ti.static(self.has_angular_impulse):
            g.angular_impulse[k] = ti.Vector([ti.cast(0.0, self.real)] * self.rotation_size)

    @ti.func
    def survey(self, block: ti.template(), first, count):
        """Put the slots from `first` on that are near, or that have a past, into the first lanes; returns how many.

        No branch depends on a distance: many of them would be mispredicted. Of spheres the lanes then hold normal and
        depth, of other grains the vector between the centres in place of the normal.
        """
        g, pairs = self.grains, self.pairs
        for c in range(count):
            s = first + c
            k, l = pairs.first[s], pairs.partner[s]
            d = self.geometry.shortest(k, l)
            put(block, "normal", c, d)
            if ti.static(self.shaped):
                block.near[c] = self.geometry.near(k, l, s, d)
            else:
                block.depth[c] = g.radius[k] + g.radius[l]
        if ti.static(not self.shaped):
            for c in range(padded(count)):
                depth, n, _ = sphere_overlap(get(block, "normal", c, self.dim), block.depth[c], 0.0)
                put(block, "normal", c, n)
                block.depth[c] = depth
                block.near[c] = ti.cast(depth > self.geometry.least_depth(), ti.i32)
        near = 0
        for c in range(count):
            was = ti.cast(pairs.status[first + c], ti.i32)
            block.slot[near], block.was[near] = first + c, was
            put(block, "normal", near, get(block, "normal", c, self.dim))
            if ti.static(not self.shaped):
                block.depth[near] = block.depth[c]
            near += block.near[c] | ti.cast(was != 0, ti.i32)
        return near

    @ti.func
    def meet(self, block: ti.template(), near):
        """Gather what the laws need of the near pairs that touch or did so before; returns how many there are."""
        g, pairs = self.grains, self.pairs
        met = near
        if ti.static(self.shaped):
            met = 0
            for i in range(near):
                s, was = block.slot[i], block.was[i]
                block.slot[met], block.was[met] = s, was
                met += self.meet_surfaces(block, met, s, was, get(block, "normal", i, self.dim))
        else:
            for i in range(near):
                s = block.slot[i]
                k, l = pairs.first[s], pairs.partner[s]
                self.geometry.check_overlap_limit(k, l, block.depth[i])
                put(block, "velocity", i, self.geometry.relative_velocity(k, l))
                block.inverse_mass[i] = g.inverse_mass[k] + g.inverse_mass[l]
                if ti.static("reduced_radius" in self.needs):
                    block.reduced_radius[i] = self.geometry.reduced_radius(k, l, s)
                if ti.static(self.rotates):
                    block.radius_k[i], block.radius_l[i] = g.radius[k], g.radius[l]
                    put(block, "omega_k", i, ti.cast(g.angular_velocity[k], self.real))
                    put(block, "omega_l", i, ti.cast(g.angular_velocity[l], self.real))
        if ti.static(pairs.history_size > 0):
            for i in range(met):
                put(block, "memory", i, pairs.history[block.slot[i]])
        return met

    @ti.func
    def meet_surfaces(self, block: ti.template(), i, s, was, d):
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
        block.depth[i] = depth
        put(block, "normal", i, n)
        put(block, "velocity", i, self.velocity_at(k, l, arm_k, arm_l))
        block.inverse_mass[i] = g.inverse_mass[k] + g.inverse_mass[l]
        if ti.static("reduced_radius" in self.needs):
            block.reduced_radius[i] = self.geometry.reduced_radius(k, l, s)
        if ti.static("relative_angular_velocity" in self.needs):
            put(
                block, "relative_angular_velocity", i, ti.cast(g.angular_velocity[l] - g.angular_velocity[k], self.real)
            )
        put(block, "arm_k", i, arm_k)
        put(block, "arm_l", i, arm_l)
        if ti.static(self.dim == 3):
            block.normal_angular_velocity[i] = 0.5 * n.dot(
                ti.cast(g.angular_velocity[k] + g.angular_velocity[l], self.real)
            )
        if ti.static(self.seams):
            block.feature_k[i], block.feature_l[i] = before[0], before[1]
            if ti.static(self.remembers_normal):
                put(block, "last_normal", i, last_n)
        return ti.cast(depth > self.geometry.least_depth(), ti.i32) | ti.cast(was != 0, ti.i32)

    @ti.func
    def in_lane(self, block: ti.template(), i, dt):
        """The contact in lane i as the laws see it."""
        depth, n = block.depth[i], get(block, "normal", i, self.dim)
        v = get(block, "velocity", i, self.dim)
        normal_angular_velocity = 0.0 * depth
        if ti.static(self.rotates and self.shaped):
            normal_angular_velocity = block.normal_angular_velocity[i]
        elif ti.static(self.rotates):  # both arms lie along the normal
            omega_k, omega_l = (
                get(block, "omega_k", i, self.rotation_size),
                get(block, "omega_l", i, self.rotation_size),
            )
            a, b = block.radius_k[i] - 0.5 * depth, block.radius_l[i] - 0.5 * depth
            v -= rotational_velocity(a * omega_k + b * omega_l, n)
            if ti.static(self.dim == 3):
                normal_angular_velocity = 0.5 * n.dot(omega_k + omega_l)
        contact = self.make_contact(v, n, depth, block.inverse_mass[i], normal_angular_velocity, dt)
        if ti.static("reduced_radius" in self.needs):
            contact.reduced_radius = block.reduced_radius[i]
        if ti.static("relative_angular_velocity" in self.needs):
            if ti.static(self.shaped):
                contact.relative_angular_velocity = get(block, "relative_angular_velocity", i, self.rotation_size)
            else:
                omega_k, omega_l = (
                    get(block, "omega_k", i, self.rotation_size),
                    get(block, "omega_l", i, self.rotation_size),
                )
                contact.relative_angular_velocity = omega_l - omega_k
        return contact

    @ti.func
    def apply_effects(self, block: ti.template(), count, dt):
        """Forces of the contacts in the first lanes, Eq. (10), and torques on both grains, Eq. (15)."""
        for i in range(padded(count)):
            contact = self.in_lane(block, i, dt)
            for effect in ti.static(self.contact_effects):
                self.apply(block, i, contact, effect)
            n = contact.normal
            f = contact.normal_force * n + contact.tangential_force
            put(block, "force", i, f)
            if ti.static(self.rotates):
                self.turn(block, i, contact, f)
            status = ti.select(contact.touching == 1, TOUCHING + SLIDING * contact.sliding, 0)
            if ti.static(self.reaches):
                status += ti.select(block.depth[i] > self.geometry.least_depth(), ACTING, 0)
            block.status[i] = status

    @ti.func
    def turn(self, block: ti.template(), i, contact: ti.template(), f):
        """Torques on both grains of the contact in lane i, Eq. (15): of the force f [N] on l, and the laws' couple."""
        turning = torque_of(contact.normal, contact.tangential_force)
        torque_k, torque_l = turning, turning
        if ti.static(self.shaped):
            torque_k = torque_of(get(block, "arm_k", i, self.dim), f)
            torque_l = torque_of(get(block, "arm_l", i, self.dim), f)
        else:
            torque_k = (block.radius_k[i] - 0.5 * block.depth[i]) * turning
            torque_l = -(block.radius_l[i] - 0.5 * block.depth[i]) * turning
        if ti.static(self.adds_moment):
            torque_k += contact.contact_moment
            torque_l += contact.contact_moment
        put(block, "torque_k", i, torque_k)
        put(block, "torque_l", i, torque_l)

    @ti.func
    def apply(self, block: ti.template(), i, contact: ti.template(), effect: ti.template()):
        """Add one law to the contact in lane i; its history is read from the lanes and written back."""
        lost = 0.0 * contact.depth
        if ti.static(effect.history_size(self.dim) > 0):
            first, size = ti.static(self.history_slice(effect))
            memory = ti.Vector([block["memory" + AXIS[first + c]][i] for c in range(size)])
            lost = effect.on_contact(contact, memory)
            for c in ti.static(range(size)):
                block["memory" + AXIS[first + c]][i] = memory[c]
        else:
            lost = effect.on_contact(contact, 0)
        if ti.static(self.track_dissipation and effect.dissipates):
            block["lost" + AXIS[ti.static(self.channel_of(effect))]][i] = lost

    @ti.func
    def keep(self, block: ti.template(), count, dt):
        """Store forces, histories and status of the contacts in the first lanes, and add up their rows."""
        g, pairs = self.grains, self.pairs
        for i in range(count):
            s = block.slot[i]
            k = pairs.first[s]
            f = get(block, "force", i, self.dim)
            pairs.pair_force[s] = f
            g.force[k] = g.force[k] - f
            if ti.static(self.rotates):
                pairs.pair_torque[s] = get(block, "torque_l", i, self.rotation_size)
                g.torque[k] = g.torque[k] - get(block, "torque_k", i, self.rotation_size)
            if ti.static(pairs.history_size > 0):
                pairs.history[s] = get(block, "memory", i, pairs.history_size)
            if ti.static(self.track_dissipation and self.contact_channel_count > 0):
                for channel in ti.static(range(self.contact_channel_count)):
                    lost = ti.cast(block["lost" + AXIS[channel]][i], ti.f64)
                    g.dissipated[k][channel] = g.dissipated[k][channel] + lost
            status = block.status[i]
            if ti.static(self.onset):
                status += self.correct(block, i, s, k, dt)
            pairs.status[s] = ti.cast(status, ti.i8)
            if ti.static(self.domain.sheared):
                push = ti.cast(f[0], ti.f64) * dt
                if ti.static(self.onset):
                    if status & HAS_IMPULSE:
                        push += pairs.pair_impulse[s][0]
                self.geometry.add_shear_work(k, push * self.geometry.shortest(k, pairs.partner[s])[1])

    @ti.func
    def correct(self, block: ti.template(), i, s, k, dt):
        """Store the impulse if the contact in lane i began, ended or crossed a seam in this step: KICKED, else 0."""
        pairs = self.pairs
        was, touching = block.was[i] & TOUCHING, block.status[i] & TOUCHING
        result = 0
        if touching != was:
            n, depth, d, arm_k = self.met_again(block, i, s, k)
            l = pairs.partner[s]
            size = self.correction.end_impulse(k, l, s, d, touching, depth, n, arm_k, arm_k - d, dt)
            if size != 0.0:
                impulse = size * n
                self.store_impulse(s, k, impulse, -torque_of(arm_k, impulse), torque_of(arm_k - d, impulse))
                result = HAS_IMPULSE
        if ti.static(self.seams):
            before, now = ti.Vector([block.feature_k[i], block.feature_l[i]]), pairs.feature[s]
            if (now[0] != before[0] or now[1] != before[1]) and was == 1 and touching == 1:
                n, depth, d, arm_k = self.met_again(block, i, s, k)
                last_n = 0.0 * n
                if ti.static(self.remembers_normal):
                    last_n = get(block, "last_normal", i, self.dim)
                l = pairs.partner[s]
                impulse, angular_impulse_k, angular_impulse_l = self.correction.seam_impulse(
                    k, l, s, d, before, last_n, depth, n, arm_k, dt
                )
                self.store_impulse(s, k, impulse, angular_impulse_k, angular_impulse_l)
                result = HAS_IMPULSE
        return result

    @ti.func
    def met_again(self, block: ti.template(), i, s, k):
        """(normal, depth [m], vector between the centres [m], arm of grain k [m]) of the contact in lane i."""
        n, depth = get(block, "normal", i, self.dim), block.depth[i]
        d = self.geometry.shortest(k, self.pairs.partner[s])
        arm_k = (self.grains.radius[k] - 0.5 * depth) * n
        if ti.static(self.shaped):
            arm_k = get(block, "arm_k", i, self.dim)
        return n, depth, d, arm_k

    @ti.func
    def store_impulse(self, s, k, impulse, angular_impulse_k, angular_impulse_l):
        """Impulse on the second grain of slot s [N s] and angular impulses on both [N m s]."""
        g, pairs = self.grains, self.pairs
        pairs.pair_impulse[s] = impulse
        g.has_impulse[k] = ti.cast(1, ti.i8)
        if ti.static(self.has_angular_impulse):
            pairs.pair_angular_impulse[s] = angular_impulse_l
            g.angular_impulse[k] = g.angular_impulse[k] + angular_impulse_k

    @ti.func
    def gathered(self, k):
        """(force [N], torque [N m], impulse [N s], angular impulse [N m s]) on grain k: its own row, then its column
        in rising ids, then body forces, if it is mobile. Impulses are zero but where contacts begin or end."""
        g, pairs = self.grains, self.pairs
        force = ti.cast(g.force[k], ti.f64)
        torque = ti.Vector([ti.cast(0.0, ti.f64)] * g.sizes["rotation"])
        impulse, angular_impulse = 0.0 * force, 0.0 * torque
        if ti.static(self.rotates):
            torque = ti.cast(g.torque[k], ti.f64)
        if ti.static(self.onset):
            if g.has_impulse[k]:
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.status[s] & HAS_IMPULSE:
                        impulse -= pairs.pair_impulse[s]
                if ti.static(self.walled):
                    impulse += self.walls.impulse_on(self, k)
        if ti.static(self.has_angular_impulse):
            angular_impulse = ti.cast(g.angular_impulse[k], ti.f64)
        for c in range(pairs.column_start[k], pairs.column_start[k + 1]):
            s = pairs.column[c]
            force += pairs.pair_force[s]  # zero where the pair is apart: a branch would often be mispredicted
            if ti.static(self.rotates):
                torque += pairs.pair_torque[s]
            if ti.static(self.onset):
                if pairs.status[s] & HAS_IMPULSE:
                    impulse += pairs.pair_impulse[s]
                    if ti.static(self.has_angular_impulse):
                        angular_impulse += pairs.pair_angular_impulse[s]
        if ti.static(self.bonded):
            bond_force, bond_torque = self.bonds.gathered(g.id[k])
            force += bond_force
            torque += bond_torque
        if g.platen_index[k] < 0:  # the force on a platen is that of its contacts
            for effect in ti.static(self.body_effects):
                effect.on_grain(g.inverse_mass[k], force)
        return force, torque, impulse, angular_impulse
