"""The effects that a scene lists, what they need, and a contact as they see it: composed at compile time."""

from collections.abc import Iterable

from ..contact.contact_block import AXIS
from ..contact.pair_storage import ACTING, TOUCHING
from ..core.rotation import rotational_velocity, velocity_turned_back
from ..core.runtime import ti
from ..effects import Effect, contact_type
from ..effects.base import LENGTHS, ON_CONTACTS, PHASES


def sorted_by_phase(effects: Iterable[Effect]) -> list[Effect]:
    """The effects in the order of their phases, for tangential ones read the complete normal force."""
    return sorted(effects, key=lambda e: PHASES.index(e.phase))


def energy_channels(effects: Iterable[Effect]) -> list[Effect]:
    """The effects that dissipate, in the order of the columns of `dissipated`.

    Those of contacts come first, for their losses pass through the contact block; then those of motion; bonds last.
    """
    contacts = [e for e in sorted_by_phase(effects) if e.phase in ON_CONTACTS]
    others = [e for phase in ("motion", "bond") for e in effects if e.phase == phase]
    return [e for e in contacts + others if e.dissipates]


@ti.data_oriented
class EffectSet:
    """The effects that a scene lists, in the order in which they act.

    contact_effects: of contacts; body_effects, motion_effects: of grains; springs: effects whose onset is corrected;
    channels: effects that dissipate, in the order of the columns of `dissipated`, of which the first
    `contact_channel_count` act on contacts; dashpots: those among them that damp; needs: inputs that some effect wants.
    """

    def __init__(self, spec, geometry, effects, bonds=None):
        self.spec = spec
        self.geometry, self.grains, self.pairs = geometry, geometry.grains, geometry.pairs
        self.real, self.dim, self.rotation_size = geometry.real, spec.dim, self.grains.sizes["rotation"]
        self.contact_effects = [e for e in sorted_by_phase(effects) if e.phase in ON_CONTACTS]
        self.body_effects = [e for e in effects if e.phase == "body"]
        self.motion_effects = [e for e in effects if e.phase == "motion"]
        self.springs = [e for e in self.contact_effects if hasattr(type(e), "onset_impulse")]
        self.needs = {name for effect in self.contact_effects for name in effect.needs}
        self.adds_moment = any(effect.adds_moment for effect in self.contact_effects)
        self.contact_type = contact_type(self.dim, self.contact_effects)
        self.bonds = bonds
        self.channels = energy_channels(effects)
        self.dashpots = [e for e in self.channels if e.phase == "damping"]
        self.contact_channel_count = sum(e.phase in ON_CONTACTS for e in self.channels)

    def history_slice(self, effect: Effect) -> tuple[int, int]:
        """(begin, size) of an effect's values in the pair's history."""
        begin = sum(e.history_size(self.dim) for e in self.contact_effects[: self.contact_effects.index(effect)])
        return begin, effect.history_size(self.dim)

    def channel_of(self, effect: Effect) -> int:
        """Column of `dissipated` that holds what an effect dissipates."""
        return self.channels.index(effect)

    @ti.func
    def contact_of(self, k, l, s, depth, n, arm_k, arm_l, dt):
        """The contact in list slot s as the effects see it."""
        g = self.grains
        v = self.velocity_at(k, l, arm_k, arm_l)
        normal_angular_velocity = 0.0 * depth
        if ti.static(self.spec.rotates and self.dim == 3):
            normal_angular_velocity = 0.5 * n.dot(ti.cast(g.angular_velocity[k] + g.angular_velocity[l], self.real))
        inverse_mass = g.inverse_mass[k] + g.inverse_mass[l]
        if ti.static(self.spec.shaped):
            inverse_mass = self.geometry.inverse_effective_mass(k, l, n, arm_k, arm_l)
        contact = self.make_contact(v, n, depth, inverse_mass, normal_angular_velocity, dt)
        for name in ti.static(LENGTHS):
            if ti.static(name in self.needs):
                contact[name] = self.geometry.length(name, k, l, s, depth)
        if ti.static("relative_angular_velocity" in self.needs):
            contact.relative_angular_velocity = ti.cast(g.angular_velocity[l] - g.angular_velocity[k], self.real)
        return contact

    @ti.func
    def velocity_at(self, k, l, arm_k, arm_l):
        """Velocity of grain l against grain k at the contact [m s-1]."""
        g = self.grains
        v = self.geometry.relative_velocity(k, l)
        if ti.static(self.spec.rotates):
            omega_k, omega_l = ti.cast(g.angular_velocity[k], self.real), ti.cast(g.angular_velocity[l], self.real)
            v += rotational_velocity(omega_l, arm_l) - rotational_velocity(omega_k, arm_k)
        return v

    @ti.func
    def velocity_of_spheres(self, v, n, a, b, omega_k, omega_l, dt):
        """(velocity of l against k at their contact [m s-1], change of the normal in the step [1]) of two spheres.

        v [m s-1]: of the centres; a, b [m]: from the centres to the contact along n. Velocities belong to the middle of
        the step, where the vector (a + b) n between the centres was dt/2 v less than now; the arms were less in
        proportion. With the arms of now a pair that turns as one body with omega would slip by the part across n of
        dt/2 omega x v in every step; in 2D that has none. The change of the normal is for springs in 3D.
        """
        rolling = a * omega_k + b * omega_l
        change = 0.0 * n
        if ti.static(self.dim == 2):
            v -= rotational_velocity(rolling, n)
        else:
            moved = v * (ti.cast(dt, self.real) / (a + b))
            v -= rotational_velocity(rolling, n - 0.5 * moved)
            change = moved - moved.dot(n) * n
        return v, change

    @ti.func
    def velocity_of_shapes(self, k, l, s, depth, n, arm_k, arm_l, dt):
        """`velocity_of_spheres` for shaped grains, whose surfaces at the contact are balls fixed to the grains.

        Half a step ago the centre p of a ball, relative to its grain, was at p - dt/2 omega x p. Otherwise the balls
        touch as spheres do, so that a sphere that is cut into patches moves like the sphere.
        """
        g, dt = self.grains, ti.cast(dt, self.real)
        v = self.velocity_at(k, l, arm_k, arm_l)
        omega_k, omega_l = ti.cast(g.angular_velocity[k], self.real), ti.cast(g.angular_velocity[l], self.real)
        part_k, part_l = self.geometry.parts_of(k, l, s)
        radius_k, radius_l = self.geometry.surface.radii(part_k, part_l, k, l, s)
        overlap = self.geometry.whole_overlap(s, depth)
        a, b = radius_k - 0.5 * overlap, radius_l - 0.5 * overlap
        v -= velocity_turned_back(omega_k, arm_k - a * n, dt) - velocity_turned_back(omega_l, arm_l + b * n, dt)
        change = 0.0 * n
        if ti.static(self.dim == 3):
            rolling = a * omega_k + b * omega_l
            moved = (v + rotational_velocity(rolling, n)) * (dt / (a + b))
            v += rotational_velocity(rolling, 0.5 * moved)
            change = moved - moved.dot(n) * n
        return v, change

    @ti.func
    def make_contact(self, v, n, depth, inverse_mass, normal_angular_velocity, dt):
        """A contact with the velocity v of l against k [m s-1] and the inverse effective mass [kg-1]."""
        contact = self.contact_type(0)
        v_n = v.dot(n)
        contact.touching = ti.cast(depth > 0.0, ti.i32)
        contact.depth = ti.max(depth, 0.0)
        if ti.static(self.spec.reaches):
            contact.gap = ti.max(-depth, 0.0)
        contact.normal = n
        contact.approach = -v_n
        contact.slip = v - v_n * n
        contact.normal_angular_velocity = normal_angular_velocity
        contact.mass = 1.0 / inverse_mass
        contact.dt = dt
        return contact

    @ti.func
    def forget_parted(self, first, last, noted):
        """If losses are noted: begin the sums over contacts that end in this step, in rows first to last - 1."""
        if ti.static(self.spec.keeps_losses):
            if noted == 1:
                for k in range(first, last):
                    self.grains.parted_loss[k] = ti.cast(0.0, ti.f64)

    @ti.func
    def note_losses(self, block: ti.template(), count, noted):
        """If losses are noted: store what all effects dissipated at each of the first `count` contacts of the block.

        Of one that has ended in this step, which is no row of the table of contacts, at its first grain. A loop of its
        own: in the one over all steps a branch for each contact would cost more than this does.
        """
        if ti.static(self.spec.keeps_losses):
            if noted == 1:
                g, pairs = self.grains, self.pairs
                for i in range(count):
                    s = block.slot[i]
                    lost = ti.cast(0.0, ti.f64)
                    for channel in ti.static(range(self.contact_channel_count)):
                        lost += ti.cast(block["lost" + AXIS[channel]][i], ti.f64)
                    pairs.pair_loss[s] = lost
                    if pairs.status[s] & (TOUCHING | ACTING) == 0:
                        k = pairs.first_slot[s]
                        g.parted_loss[k] = g.parted_loss[k] + lost

    @ti.func
    def add_to_block(self, block: ti.template(), i, lost):
        """Add a loss at the onset [J] to those of the contact in place i of the block, for `note_losses`."""
        channel = ti.static(self.channel_of(self.dashpots[0]))
        block["lost" + AXIS[channel]][i] = block["lost" + AXIS[channel]][i] + lost

    @ti.func
    def add_lost(self, k, effect: ti.template(), lost):
        """Add the energy [J] that an effect dissipated at a contact to its channel of grain k."""
        g = self.grains
        if ti.static(self.spec.tracks_dissipation and effect.dissipates):
            channel = ti.static(self.channel_of(effect))
            g.dissipated[k][channel] = g.dissipated[k][channel] + ti.cast(lost, ti.f64)

    @ti.func
    def add_lost_at_onset(self, k, lost):
        """Add the energy [J] that dashpots lost by the impulse of an onset to grain k and their first channel."""
        g = self.grains
        if ti.static(self.spec.tracks_dissipation and len(self.dashpots) > 0):
            channel = ti.static(self.channel_of(self.dashpots[0]))
            g.dissipated[k][channel] = g.dissipated[k][channel] + ti.cast(lost, ti.f64)

    @ti.func
    def history_of(self, effect: ti.template(), s):
        """The effect's own values of list slot s."""
        begin, size = ti.static(self.history_slice(effect))
        return ti.Vector([self.pairs.history[s][begin + c] for c in range(size)], self.real)
