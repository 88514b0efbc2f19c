"""What the effects of a scene need, and a contact as they see it: composed at compile time."""

from ..core.rotation import spin_velocity
from ..core.runtime import ti
from ..effects import contact_type
from ..effects.base import ON_CONTACTS, PHASES


def in_order(effects):
    """Effects sorted by phase: tangential laws read the complete normal force."""
    return sorted(effects, key=lambda e: PHASES.index(e.phase))


@ti.data_oriented
class Composition:
    """The laws that a scene lists, in the order in which they act.

    laws: of contacts; body_laws, motion_laws: of grains; springs: laws whose onset is corrected; books: laws that
    dissipate, in the order of the energy ledger, of which the first `book_count` act on contacts; needs: inputs that
    some law wants.
    """

    def __init__(self, geometry, effects, bonds=None):
        self.geometry, self.grains, self.pairs = geometry, geometry.grains, geometry.pairs
        self.shaped, self.several, self.reaches = geometry.shaped, geometry.several, geometry.reaches
        self.real, self.dim = geometry.real, geometry.dim
        self.rotates, self.spin_size = self.grains.has("spin"), self.grains.sizes["spin"]
        self.ledger, self.onset = self.grains.has("dissipated"), self.pairs.onset
        self.laws = [e for e in in_order(effects) if e.phase in ON_CONTACTS]
        self.body_laws = [e for e in effects if e.phase == "body"]
        self.motion_laws = [e for e in effects if e.phase == "motion"]
        self.springs = [e for e in self.laws if hasattr(type(e), "onset_impulse")]
        self.needs = {name for law in self.laws for name in law.needs}
        self.couples = any(law.couples for law in self.laws)
        self.contact_type = contact_type(self.dim, self.laws)
        contact_books = [e for e in self.laws if e.dissipates]
        self.books = contact_books + [e for e in self.motion_laws if e.dissipates]
        self.book_count = len(contact_books)
        self.bonds, self.bonded = bonds, bonds is not None
        if self.bonded:
            bonds.book = len(self.books)
            self.books.append(bonds.law)

    def history_slice(self, law):
        """(first, size) of a law's values in the pair's history."""
        first = sum(e.history_size(self.dim) for e in self.laws[: self.laws.index(law)])
        return first, law.history_size(self.dim)

    def book_of(self, law):
        """Column of the energy ledger in which a law books what it dissipates."""
        return self.books.index(law)

    @ti.func
    def contact_of(self, k, l, s, depth, n, arm_k, arm_l, dt):
        """The kinematics of the contact in list slot s as the laws see it."""
        g = self.grains
        v = self.velocity_at(k, l, arm_k, arm_l)
        spin_about_normal = 0.0 * depth
        if ti.static(self.rotates and self.dim == 3):
            spin_about_normal = 0.5 * n.dot(ti.cast(g.spin[k] + g.spin[l], self.real))
        contact = self.seen(v, n, depth, g.inverse_mass[k] + g.inverse_mass[l], spin_about_normal, dt)
        if ti.static("reduced_radius" in self.needs):
            contact.reduced_radius = self.geometry.reduced_radius(k, l, s)
        if ti.static("relative_spin" in self.needs):
            contact.relative_spin = ti.cast(g.spin[l] - g.spin[k], self.real)
        return contact

    @ti.func
    def velocity_at(self, k, l, arm_k, arm_l):
        """Velocity of grain l against grain k at the contact [m s-1]."""
        g = self.grains
        v = self.geometry.relative_velocity(k, l)
        if ti.static(self.rotates):
            omega_k, omega_l = ti.cast(g.spin[k], self.real), ti.cast(g.spin[l], self.real)
            v += spin_velocity(omega_l, arm_l) - spin_velocity(omega_k, arm_k)
        return v

    @ti.func
    def seen(self, v, n, depth, inverse_mass, spin_about_normal, dt):
        """A contact with the velocity v of l against k [m s-1] and the sum of both inverse masses [kg-1]."""
        contact = self.contact_type(0)
        v_n = v.dot(n)
        contact.touching = ti.cast(depth > 0.0, ti.i32)
        contact.depth = ti.max(depth, 0.0)
        if ti.static(self.reaches):
            contact.gap = ti.max(-depth, 0.0)
        contact.normal = n
        contact.approach = -v_n
        contact.slip = v - v_n * n
        contact.spin_about_normal = spin_about_normal
        contact.mass = 1.0 / inverse_mass
        contact.dt = dt
        return contact

    @ti.func
    def history_of(self, law: ti.template(), s):
        """The law's own values of list slot s."""
        first, size = ti.static(self.history_slice(law))
        return ti.Vector([self.pairs.history[s][first + c] for c in range(size)], self.real)
