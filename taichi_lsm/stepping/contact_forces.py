"""Forces of the contacts, in blocks of pairs: geometry and effects as the scene composes them."""

from ..contact.contact_block import AXIS, block_width, contact_block_type, get, padded, put
from ..contact.pair_storage import ACTING, HAS_IMPULSE, SLIDING, TOUCHING
from ..contact.primitives import sphere_overlap
from ..core.rotation import torque_of
from ..core.runtime import ti
from ..effects.base import LENGTHS
from .effect_set import EffectSet
from .onset_correction import OnsetCorrection

NEARLY = 1.0 - 1e-12  # rounding of a long path must not hide a contact


@ti.data_oriented
class ContactForces(EffectSet):
    """Evaluates the half list in blocks of pairs; stores each pair's force for its second grain and sums the rows.

    A block passes through four stages, so that the arithmetic becomes vector instructions (`contact_block.py`):

    1. `find_near_pairs`: which pairs are near, or touched in the last step;
    2. `contact_kinematics`: what the effects need of each, gathered from the fields;
    3. `apply_effects`: forces and torques, arithmetic over the block alone;
    4. `store_results`: forces, histories and status, scattered back to the fields.
    """

    def __init__(self, spec, geometry, domain, effects, walls=None, bonds=None):
        super().__init__(spec, geometry, effects, bonds)
        self.domain, self.walls = domain, walls
        self.crosses_seams = spec.onset and spec.remembers_features
        self.correction = OnsetCorrection(spec, geometry, self.contact_effects, self.contact_type)
        self.load_type = self._load_type()
        self.width, channels = block_width(), self.contact_channel_count if spec.tracks_dissipation else 0
        self.block = contact_block_type(spec, self.needs, channels, self.crosses_seams)

    def _load_type(self):
        """Taichi struct of what acts on a grain: force [N], torque [N m], impulse [N s], angular impulse [N m s]."""
        linear, angular = ti.types.vector(self.dim, ti.f64), ti.types.vector(self.rotation_size, ti.f64)
        return ti.types.struct(force=linear, torque=angular, impulse=linear, angular_impulse=angular)

    @ti.func
    def evaluate_rows(self, block: ti.template(), first, last, dt, noted):
        """Evaluate the contacts in the rows of grains first to last - 1 and store their forces.

        Pairs are oriented from the lower id. A pair that has just parted is evaluated once more, so that what its
        history holds is added to the dissipated energy and the history is cleared. noted: 1 in a step after which the
        contacts can be read, the last one of a launch: their losses are then noted, if they are kept.
        """
        pairs = self.pairs
        cleared = first
        s, end = pairs.row_start[first], pairs.row_start[last]
        self.forget_parted(first, last, noted)
        while s < end:
            stop = ti.min(s + self.width, end)
            # A block may span several rows: the sums of a row begin before its first pair is stored.
            while cleared < last and pairs.row_start[cleared] < stop:
                self.clear_sums(cleared)
                cleared += 1
            near = self.find_near_pairs(block, s, stop - s)
            count = self.contact_kinematics(block, near, dt)
            self.apply_effects(block, count, dt)
            self.store_results(block, count, dt)
            self.note_losses(block, count, noted)
            s = stop
        for k in range(cleared, last):
            self.clear_sums(k)
        if ti.static(self.spec.walls > 0):
            for k in range(first, last):
                self.walls.evaluate(self, k, dt, noted)

    @ti.func
    def clear_sums(self, k):
        """Begin the sums over the row of grain k."""
        g = self.grains
        g.force[k] = ti.Vector([ti.cast(0.0, self.real)] * self.dim)
        if ti.static(self.spec.cell_servo):  # the share of its motion in the normal stress
            g.virial[k] = g.velocity[k][1] * g.velocity[k][1] / ti.cast(g.inverse_mass[k], ti.f64)
        if ti.static(self.spec.onset):
            g.has_impulse[k] = ti.cast(0, ti.i8)
        if ti.static(self.spec.rotates):
            g.torque[k] = ti.Vector([ti.cast(0.0, self.real)] * self.rotation_size)
        if ti.static(self.spec.has_angular_impulses):
            g.angular_impulse[k] = ti.Vector([ti.cast(0.0, self.real)] * self.rotation_size)

    @ti.func
    def find_near_pairs(self, block: ti.template(), first, count):
        """Put the slots from `first` on that are near, or that touched before, into the first places of the block.

        Returns how many there are. No branch depends on a distance: many of them would be mispredicted. All pairs are
        written, and a place is kept by moving on to the next one.
        """
        g, pairs = self.grains, self.pairs
        for c in range(count):
            s = first + c
            k, l = pairs.first_slot[s], pairs.second_slot[s]
            branch = self.geometry.shortest(k, l)
            put(block, "branch", c, branch)
            if ti.static(self.spec.shaped):
                block.near[c] = self.geometry.near(k, l, s, branch)
            else:
                block.radius_sum[c] = self.geometry.counted_depth(s, g.radius[k] + g.radius[l])
        # Of spheres the overlap is cheaper than a decision whether to compute it.
        if ti.static(not self.spec.shaped):
            for c in range(padded(count)):
                depth, n, _ = sphere_overlap(get(block, "branch", c, self.dim), block.radius_sum[c], 0.0)
                put(block, "normal", c, n)
                block.depth[c] = depth
                block.near[c] = ti.cast(depth > self.geometry.least_depth(), ti.i32)
        near = 0
        for c in range(count):
            previous_status = ti.cast(pairs.status[first + c], ti.i32)
            block.slot[near], block.previous_status[near] = first + c, previous_status
            if ti.static(self.spec.shaped):
                put(block, "branch", near, get(block, "branch", c, self.dim))
            else:
                put(block, "normal", near, get(block, "normal", c, self.dim))
                block.depth[near] = block.depth[c]
            near += block.near[c] | ti.cast(previous_status != 0, ti.i32)
        return near

    @ti.func
    def contact_kinematics(self, block: ti.template(), near, dt):
        """Gather what the effects need of the near pairs that touch or touched before; returns how many there are."""
        g, pairs = self.grains, self.pairs
        count = near
        if ti.static(self.spec.shaped):
            count = 0
            for i in range(near):
                s, previous_status = block.slot[i], block.previous_status[i]
                branch = get(block, "branch", i, self.dim)
                block.slot[count], block.previous_status[count] = s, previous_status
                count += self.surface_kinematics(block, count, s, previous_status, branch, dt)
        else:
            for i in range(near):
                s = block.slot[i]
                k, l = pairs.first_slot[s], pairs.second_slot[s]
                self.geometry.check_overlap_limit(k, l, self.geometry.whole_overlap(s, block.depth[i]))
                put(block, "velocity", i, self.geometry.relative_velocity(k, l))
                block.inverse_mass[i] = g.inverse_mass[k] + g.inverse_mass[l]
                self.geometry.put_lengths(self.needs, block, i, k, l, s)
                if ti.static(self.spec.rotates):
                    block.radius_k[i], block.radius_l[i] = self.geometry.radii_of_spheres(k, l, s)
                    put(block, "omega_k", i, ti.cast(g.angular_velocity[k], self.real))
                    put(block, "omega_l", i, ti.cast(g.angular_velocity[l], self.real))
        if ti.static(self.spec.history > 0):
            for i in range(count):
                put(block, "memory", i, pairs.history[block.slot[i]])
        return count

    @ti.func
    def surface_kinematics(self, block: ti.template(), i, s, previous_status, branch, dt):
        """Find where the surfaces of slot s touch and put the contact into place i; returns 0 if it can be forgotten.

        branch [m]: from the centre of the first grain to that of the second.
        """
        g, pairs = self.grains, self.pairs
        k, l = pairs.first_slot[s], pairs.second_slot[s]
        last_features, last_normal = self.geometry.remembered(s)
        depth, n, arm_k, arm_l = self.geometry.overlap(k, l, s, branch, previous_status)
        # Surfaces a gap apart need not be examined until their points have travelled as far.
        if ti.static(self.spec.remembers_features):
            travel = g.travel[k] + g.travel[l]
            gap = ti.cast(self.geometry.least_depth() - self.geometry.whole_overlap(s, depth), ti.f64)
            pairs.free_until[s] = ti.select(gap > 0.0, NEARLY * travel + gap, -1.0)
        block.depth[i] = depth
        put(block, "normal", i, n)
        block.inverse_mass[i] = self.geometry.inverse_effective_mass(k, l, n, arm_k, arm_l)
        v, change = self.velocity_of_shapes(k, l, s, depth, n, arm_k, arm_l, dt)
        put(block, "velocity", i, v)
        self.geometry.put_lengths(self.needs, block, i, k, l, s)
        if ti.static("relative_angular_velocity" in self.needs):
            relative = ti.cast(g.angular_velocity[l] - g.angular_velocity[k], self.real)
            put(block, "relative_angular_velocity", i, relative)
        put(block, "arm_k", i, arm_k)
        put(block, "arm_l", i, arm_l)
        if ti.static(self.dim == 3):
            omega = ti.cast(g.angular_velocity[k] + g.angular_velocity[l], self.real)
            block.normal_angular_velocity[i] = 0.5 * n.dot(omega)
            if ti.static(self.spec.remembers_normal):  # exact, also where the contact has moved to another feature
                if n.dot(last_normal) > 0.0:
                    change = 2.0 * (n - (n + last_normal) / (1.0 + n.dot(last_normal)))
            put(block, "normal_change", i, change)
        if ti.static(self.crosses_seams):
            block.feature_k[i], block.feature_l[i] = last_features[0], last_features[1]
            if ti.static(self.spec.remembers_normal):
                put(block, "last_normal", i, last_normal)
        return ti.cast(depth > self.geometry.least_depth(), ti.i32) | ti.cast(previous_status != 0, ti.i32)

    @ti.func
    def contact_in(self, block: ti.template(), i, dt):
        """The contact in place i of the block as the effects see it."""
        depth, n = block.depth[i], get(block, "normal", i, self.dim)
        v = get(block, "velocity", i, self.dim)
        normal_angular_velocity, normal_change = 0.0 * depth, 0.0 * n
        if ti.static(self.spec.rotates and self.spec.shaped):
            normal_angular_velocity = block.normal_angular_velocity[i]
            if ti.static(self.dim == 3):
                normal_change = get(block, "normal_change", i, self.dim)
        elif ti.static(self.spec.rotates):  # of spheres both arms lie along the normal
            omega_k = get(block, "omega_k", i, self.rotation_size)
            omega_l = get(block, "omega_l", i, self.rotation_size)
            a, b = block.radius_k[i] - 0.5 * depth, block.radius_l[i] - 0.5 * depth
            v, normal_change = self.velocity_of_spheres(v, n, a, b, omega_k, omega_l, dt)
            if ti.static(self.dim == 3):
                normal_angular_velocity = 0.5 * n.dot(omega_k + omega_l)
        contact = self.make_contact(v, n, depth, block.inverse_mass[i], normal_angular_velocity, dt)
        if ti.static(self.spec.rotates and self.dim == 3):
            contact.normal_change = normal_change
        for name in ti.static(LENGTHS):
            if ti.static(name in self.needs):
                contact[name] = block[name][i]
        if ti.static("relative_angular_velocity" in self.needs):
            if ti.static(self.spec.shaped):
                relative = get(block, "relative_angular_velocity", i, self.rotation_size)
                contact.relative_angular_velocity = relative
            else:
                omega_k = get(block, "omega_k", i, self.rotation_size)
                contact.relative_angular_velocity = get(block, "omega_l", i, self.rotation_size) - omega_k
        return contact

    @ti.func
    def apply_effects(self, block: ti.template(), count, dt):
        """Forces of the contacts in the first `count` places, Eq. (10), and torques on both grains, Eq. (15)."""
        for i in range(padded(count)):
            contact = self.contact_in(block, i, dt)
            for effect in ti.static(self.contact_effects):
                self.apply_effect(block, i, contact, effect)
            f = contact.normal_force * contact.normal + contact.tangential_force
            put(block, "force", i, f)
            if ti.static(self.spec.rotates):
                self.contact_torques(block, i, contact, f)
            status = ti.select(contact.touching == 1, TOUCHING + SLIDING * contact.sliding, 0)
            if ti.static(self.spec.reaches):
                status += ti.select(block.depth[i] > self.geometry.least_depth(), ACTING, 0)
            block.status[i] = status

    @ti.func
    def contact_torques(self, block: ti.template(), i, contact: ti.template(), f):
        """Torques on both grains of the contact in place i, Eq. (15): of the force f [N] on l, and contact moments.

        Of spheres the normal force goes through the centres: only the tangential force turns them.
        """
        n_cross_f = torque_of(contact.normal, contact.tangential_force)
        torque_k, torque_l = n_cross_f, n_cross_f
        if ti.static(self.spec.shaped):
            torque_k = torque_of(get(block, "arm_k", i, self.dim), f)
            torque_l = torque_of(get(block, "arm_l", i, self.dim), f)
        else:
            torque_k = (block.radius_k[i] - 0.5 * block.depth[i]) * n_cross_f
            torque_l = -(block.radius_l[i] - 0.5 * block.depth[i]) * n_cross_f
        if ti.static(self.adds_moment):
            torque_k += contact.contact_moment
            torque_l += contact.contact_moment
        put(block, "torque_k", i, torque_k)
        put(block, "torque_l", i, torque_l)

    @ti.func
    def apply_effect(self, block: ti.template(), i, contact: ti.template(), effect: ti.template()):
        """Add one effect to the contact in place i; its history is read from the block and written back."""
        lost = 0.0 * contact.depth
        if ti.static(effect.history_size(self.dim) > 0):
            begin, size = ti.static(self.history_slice(effect))
            memory = ti.Vector([block["memory" + AXIS[begin + c]][i] for c in range(size)])
            lost = effect.on_contact(contact, memory)
            for c in ti.static(range(size)):
                block["memory" + AXIS[begin + c]][i] = memory[c]
        else:
            lost = effect.on_contact(contact, 0)
        if ti.static(self.spec.tracks_dissipation and effect.dissipates):
            block["lost" + AXIS[ti.static(self.channel_of(effect))]][i] = lost

    @ti.func
    def store_results(self, block: ti.template(), count, dt):
        """Store forces, histories and status of the contacts in the first places, and add up their rows."""
        # Rows are summed at the first grain; the second one reads pair_force and pair_torque in `total_load`.
        g, pairs = self.grains, self.pairs
        for i in range(count):
            s = block.slot[i]
            k = pairs.first_slot[s]
            f = get(block, "force", i, self.dim)
            pairs.pair_force[s] = f
            g.force[k] = g.force[k] - f
            if ti.static(self.spec.rotates):
                pairs.pair_torque[s] = get(block, "torque_l", i, self.rotation_size)
                g.torque[k] = g.torque[k] - get(block, "torque_k", i, self.rotation_size)
            if ti.static(self.spec.history > 0):
                pairs.history[s] = get(block, "memory", i, self.spec.history)
            if ti.static(self.spec.tracks_dissipation and self.contact_channel_count > 0):
                for channel in ti.static(range(self.contact_channel_count)):
                    lost = ti.cast(block["lost" + AXIS[channel]][i], ti.f64)
                    g.dissipated[k][channel] = g.dissipated[k][channel] + lost
            status = block.status[i]
            if ti.static(self.spec.onset):
                status += self.store_onset(block, i, s, k, dt)
            if ti.static(self.spec.has_rest_overlaps):
                status += self.geometry.shrink_rest_overlap(s, block.depth[i])
            pairs.status[s] = ti.cast(status, ti.i8)
            if ti.static(self.spec.sheared):
                self.geometry.add_to_cell(k, s, f, status, dt)

    @ti.func
    def store_onset(self, block: ti.template(), i, s, k, dt):
        """Store the impulse if the contact in place i began, ended or crossed a seam in this step: HAS_IMPULSE, else 0.

        Few contacts do, so that their kinematics are read once more rather than carried along for all.
        """
        pairs = self.pairs
        touched, touching = block.previous_status[i] & TOUCHING, block.status[i] & TOUCHING
        result = 0
        if touching != touched:
            n, depth, branch, arm_k = self.reload_contact(block, i, s, k)
            l = pairs.second_slot[s]
            size, lost = self.correction.end_impulse(k, l, s, branch, touching, depth, n, arm_k, arm_k - branch, dt)
            if size != 0.0:
                self.add_lost_at_onset(k, lost)
                if ti.static(self.spec.keeps_losses and len(self.dashpots) > 0):
                    self.add_to_block(block, i, lost)
                impulse = size * n
                self.store_impulse(s, k, impulse, -torque_of(arm_k, impulse), torque_of(arm_k - branch, impulse))
                result = HAS_IMPULSE
        if ti.static(self.crosses_seams):
            before, now = ti.Vector([block.feature_k[i], block.feature_l[i]]), pairs.feature[s]
            if (now[0] != before[0] or now[1] != before[1]) and touched == 1 and touching == 1:
                n, depth, branch, arm_k = self.reload_contact(block, i, s, k)
                last_normal = 0.0 * n
                if ti.static(self.spec.remembers_normal):
                    last_normal = get(block, "last_normal", i, self.dim)
                l = pairs.second_slot[s]
                impulse, angular_impulse_k, angular_impulse_l = self.correction.seam_impulse(
                    k, l, s, branch, before, last_normal, depth, n, arm_k, dt
                )
                self.store_impulse(s, k, impulse, angular_impulse_k, angular_impulse_l)
                result = HAS_IMPULSE
        return result

    @ti.func
    def reload_contact(self, block: ti.template(), i, s, k):
        """(normal, depth [m], branch vector [m], arm of grain k [m]) of the contact in place i."""
        n, depth = get(block, "normal", i, self.dim), block.depth[i]
        branch = self.geometry.shortest(k, self.pairs.second_slot[s])
        arm_k = (self.grains.radius[k] - 0.5 * self.geometry.whole_overlap(s, depth)) * n
        if ti.static(self.spec.shaped):
            arm_k = get(block, "arm_k", i, self.dim)
        return n, depth, branch, arm_k

    @ti.func
    def store_impulse(self, s, k, impulse, angular_impulse_k, angular_impulse_l):
        """Store the impulse on the second grain of slot s [N s] and the angular impulses on both [N m s]."""
        g, pairs = self.grains, self.pairs
        pairs.pair_impulse[s] = impulse
        g.has_impulse[k] = ti.cast(1, ti.i8)
        if ti.static(self.spec.has_angular_impulses):
            pairs.pair_angular_impulse[s] = angular_impulse_l
            g.angular_impulse[k] = g.angular_impulse[k] + angular_impulse_k

    @ti.func
    def total_load(self, k):
        """All that acts on grain k, as `load_type`: Eqs. (11) and (15) with the sum over contacts.

        Its own row, then its column in rising ids, bonds, and, if it is mobile, body forces: always in this order, so
        that the bits of a sum do not depend on threads. Impulses are zero but where contacts begin or end.
        """
        g, pairs = self.grains, self.pairs
        load = self.load_type(0)
        load.force = ti.cast(g.force[k], ti.f64)
        if ti.static(self.spec.rotates):
            load.torque = ti.cast(g.torque[k], ti.f64)
        # Impulses of the own row: rare, so that the row is searched only if the flag is set.
        if ti.static(self.spec.onset):
            if g.has_impulse[k]:
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.status[s] & HAS_IMPULSE:
                        load.impulse -= pairs.pair_impulse[s]
                if ti.static(self.spec.walls > 0):
                    load.impulse += self.walls.impulse_on(self, k)
        if ti.static(self.spec.has_angular_impulses):
            load.angular_impulse = ti.cast(g.angular_impulse[k], ti.f64)
        # Pairs of which k is the second grain.
        for c in range(pairs.column_start[k], pairs.column_start[k + 1]):
            s = pairs.column[c]
            load.force += pairs.pair_force[s]  # zero where the pair is apart: a branch would often be mispredicted
            if ti.static(self.spec.rotates):
                load.torque += pairs.pair_torque[s]
            if ti.static(self.spec.onset):
                if pairs.status[s] & HAS_IMPULSE:
                    load.impulse += pairs.pair_impulse[s]
                    if ti.static(self.spec.has_angular_impulses):
                        load.angular_impulse += pairs.pair_angular_impulse[s]
        if ti.static(self.spec.bonds > 0):
            bond_force, bond_torque = self.bonds.load_on(g.id[k])
            load.force += bond_force
            load.torque += bond_torque
        if g.platen_index[k] < 0:  # the force on a platen is that of its contacts
            force = load.force
            for effect in ti.static(self.body_effects):
                effect.on_grain(g.inverse_mass[k], force)
            load.force = force
        return load
