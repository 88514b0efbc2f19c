"""Contacts that begin because a bond broke, with no more force and no more energy than the bond held."""

from typing import Any

from ..contact.pair_storage import RESTING, TOUCHING
from ..core.rotation import torque_of
from ..core.runtime import current, ti
from .bond_network import Bonds

HALVINGS = 60  # of the interval that holds a depth: more than the digits of f64


@ti.data_oriented
class FreedContacts:
    """Begins the contacts of grains whose bond broke in the present step.

    Parameters
    ----------
    bonds : Bonds
        The bonds of the simulation.
    forces : ContactForces
        Contacts of the simulation.

    Notes
    -----
    Bonded grains have no contact, and may overlap by more than one step can bring about. Of the overlap D at the break
    only the depth d counts, the rest overlap D - d is kept with the pair: d is the greatest depth <= D with

        F(d) <= max(0, N)  and  U(d) <= W,

    F and U the elastic force and the energy of the contact, N the force of the bond along the normal, W its energy. So
    the normal force goes on as it was, unless a contact softer than its bond would store more at this force than all of
    W. A bond in tension leaves a contact without a force.

    The break dissipates W - U(d) >= 0 whatever the effects, for U(d) is the very number that was compared with W. Of a
    linear contact of stiffness k and a bond of the stiffness k_n it is N^2/2 (1/k_n - 1/k) and what shear, bending and
    torsion held; of Hertz's contact, U = 2/5 N d, it is N (N/(2 k_n) - 2/5 d) and the same.
    """

    def __init__(self, bonds: Bonds, forces: Any) -> None:
        self.bonds, self.forces, self.grains, self.pairs = bonds, forces, forces.grains, forces.pairs
        self.stores = [e for e in forces.contact_effects if hasattr(type(e), "contact_energy")]
        # Of the radii: a depth of zero must not become a contact by rounding.
        self.rounding = 1e-12 if current().precision == "f64" else 1e-5

    def begin(self) -> None:
        """Begin the contacts of broken bonds; between a rebuild of the list and the evaluation of its contacts."""
        if self.bonds.broke[None]:
            self.begin_contacts()
            self.bonds.broke[None] = 0

    @ti.kernel
    def begin_contacts(self):
        """Find the pairs of the bonds that broke in this step and subtract their elastic energy from what was lost."""
        g, bonds, pairs = self.grains, self.bonds, self.pairs
        ti.loop_config(serialize=True)
        for b in range(bonds.count):
            if bonds.freed[b] == 1:
                bonds.freed[b] = 0
                k = g.slot_of[bonds.first_id[b]]
                left = bonds.held(b)
                # Grains of several parts may touch in several places: each leaves less to the next.
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.second_id[s] == bonds.second_id[b]:
                        gain = ti.cast(self.begin_contact(b, k, pairs.second_slot[s], s, left), ti.f64)
                        left -= gain
                        bonds.contact_gain[b] = bonds.contact_gain[b] + gain
                        if ti.static(bonds.spec.tracks_dissipation):
                            g.dissipated[k][bonds.channel] = g.dissipated[k][bonds.channel] - gain

    @ti.func
    def begin_contact(self, b, k, l, s, left):
        """Elastic energy [J], at most `left`, of the new contact in list slot s, which counts as an old one: no onset.

        Its force acts through half of this step, as that of the bond does: the other half is subtracted from the force
        of the bond.
        """
        g, bonds, pairs = self.grains, self.bonds, self.pairs
        d = self.forces.geometry.shortest(k, l)
        overlap, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, d, 0)  # whole: nothing rests as yet
        push = 2.0 * ti.cast(bonds.force[b], self.forces.real).dot(n)  # a bond that breaks stores half of its force
        depth, force, gain = self.depth_left(k, l, s, overlap, n, arm_k, arm_l, push, left)
        rest = ti.max(overlap, 0.0) - depth
        if rest > 0.0:
            if depth == 0.0:
                rest += self.rounding * (g.radius[k] + g.radius[l])
            pairs.rest_overlap[s] = rest
            pairs.status[s] = ti.cast(RESTING, ti.i8)
        if depth > 0.0:
            pairs.status[s] = ti.cast(pairs.status[s] | TOUCHING, ti.i8)
            half = ti.cast(0.5 * force * n, ti.f64)
            bonds.force[b] = bonds.force[b] - half
            bonds.torque_first[b] = bonds.torque_first[b] + torque_of(arm_k, half)
            bonds.torque_second[b] = bonds.torque_second[b] - torque_of(arm_l, half)
        return gain

    @ti.func
    def depth_left(self, k, l, s, overlap, n, arm_k, arm_l, push, left):
        """(depth [m], elastic force [N], energy [J]) with which the contact of slot s begins; see the class.

        By bisection, for force and energy both rise with the depth; what is returned never exceeds its bounds.
        """
        radius = self.forces.correction.reduced_radius(k, l, s)
        low, high = ti.min(overlap, 0.0), overlap
        force, energy = 0.0 * overlap, 0.0 * overlap
        for i in range(HALVINGS):
            # First no depth, or the gap between the grains, which is allowed; then all of the overlap.
            trial = ti.select(i < 2, ti.select(i == 0, low, overlap), 0.5 * (low + high))
            contact = self.forces.contact_of(k, l, s, trial, n, arm_k, arm_l, 0.0)
            stored = 0.0 * overlap
            for effect in ti.static(self.stores):
                if ti.static(effect.history_size(self.grains.dim) > 0):
                    stored += effect.contact_energy(contact, self.forces.history_of(effect, s))
                else:
                    stored += effect.contact_energy(contact, 0)
            pushed = self.forces.correction.elastic_force(contact.depth, radius)
            if i == 0 or (pushed <= push and ti.cast(stored, ti.f64) <= left):
                low, force, energy = trial, pushed, stored
            else:
                high = trial
        return ti.max(low, 0.0), force, energy
