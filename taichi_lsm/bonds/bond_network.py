"""Bonds between grains: what they store, how they are evaluated, and the fragments that intact ones hold together.

A bond belongs to its grain of lower id, which evaluates it; both grains then gather its force in a fixed order, by the
persistent ids, so that the bits depend neither on threads nor on where the grains lie in memory.
"""

import numpy as np

from ..contact.pair_storage import TOUCHING
from ..core.fields import allocate, orientation_size, rotation_size
from ..core.rotation import inverse, product, rotate, torque_of
from ..core.runtime import ti, when_allocated
from ..core.schema import Variable
from .bond_setup import bond_branches, bond_numbers

BOND_ROWS = (
    Variable("first_id", ("bond",), "i32", "1", "persistent number of the first grain, the lower one", True),
    Variable("second_id", ("bond",), "i32", "1", "persistent number of the second grain", True),
    Variable("intact", ("bond",), "i32", "1", "1 until the bond breaks, then 0", True),
    Variable("force", ("bond", "space"), "f64", "N", "force of the bond on the second grain", True),
    Variable("torque_first", ("bond", "rotation"), "f64", "N m", "torque of the bond on the first grain", True),
    Variable("torque_second", ("bond", "rotation"), "f64", "N m", "torque of the bond on the second grain", True),
    Variable("contact_gain", ("bond",), "f64", "J", "elastic energy of the contact that its breaking set free", True),
    Variable("freed", ("bond",), "i32", "1", "1 if it broke in the present step", True),
    Variable("anchor_first", ("bond", "space"), "f64", "m", "middle of the bond, in the frame of the first grain"),
    Variable("anchor_second", ("bond", "space"), "f64", "m", "middle of the bond, in the frame of the second grain"),
    Variable("rest_orientation", ("bond", "orientation"), "f64", "1", "first grain against the second at the start"),
    Variable("stiffness", ("bond", "four"), "f64", "1", "of tension, shear [N m-1], bending and torsion [N m]"),
    Variable("strength", ("bond", "four"), "f64", "1", "in tension, shear [N], bending and torsion [N m]"),
)


@ti.data_oriented
class Bonds:
    """The bonds of a simulation, sorted by the lower, then the higher id; the fields of BOND_ROWS are attributes.

    Bonds `first_bond[i]` to `first_bond[i + 1]` are led by grain i, the one of lower id; `ends` lists those of every
    grain.
    """

    def __init__(self, spec, scene, effect, grains, domain):
        self.spec = spec
        self.effect, self.grains, self.domain, self.dim = effect, grains, domain, grains.dim
        self.count = len(scene.bonds)
        self.variables = BOND_ROWS
        sizes = {
            "space": self.dim,
            "rotation": rotation_size(self.dim),
            "orientation": orientation_size(self.dim),
            "four": 4,
        }
        for name, field in vars(allocate(BOND_ROWS, self.count, sizes)).items():
            setattr(self, name, field)
        capacity = grains.slot_of.shape[0]
        self.first_bond = ti.field(ti.i32, capacity + 1)
        self.end_start = ti.field(ti.i32, capacity + 1)
        self.ends = ti.field(ti.i32, 2 * self.count)
        self.broke = ti.field(ti.i32, ())  # 1 if a bond broke in the present step
        self.channel = spec.channels - 1  # column of `dissipated`: that of bonds is the last one
        when_allocated(lambda: self.fill(scene))

    def fill(self, scene):
        """Write the reference placement, stiffness and strength of the bonds of `scene`, all of them intact."""
        first, second = scene.bonds.T
        capacity = len(self.first_bond.to_numpy()) - 1
        self.first_id.from_numpy(first)
        self.second_id.from_numpy(second)
        self.first_bond.from_numpy(np.searchsorted(first, np.arange(capacity + 1)).astype(np.int32))
        grain = np.concatenate([first, second])
        order = np.lexsort([np.tile(np.arange(self.count), 2), grain])
        self.ends.from_numpy((order % self.count).astype(np.int32))
        self.end_start.from_numpy(np.searchsorted(grain[order], np.arange(capacity + 1)).astype(np.int32))
        stiffness, strength, _ = bond_numbers(scene)
        self.stiffness.from_numpy(stiffness)
        self.strength.from_numpy(strength)
        self.intact.fill(1)
        for row in (self.force, self.torque_first, self.torque_second, self.contact_gain, self.freed):
            row.fill(0)
        self.broke[None] = 0
        self.anchor_first.from_numpy(bond_branches(scene))
        self._refer()

    @ti.kernel
    def _refer(self):
        """Take the present placement as the one without stress; `anchor_first` holds the branches."""
        g = self.grains
        ti.loop_config(serialize=True)
        for b in range(self.count):
            q_k, q_l = g.orientation[g.slot_of[self.first_id[b]]], g.orientation[g.slot_of[self.second_id[b]]]
            half = 0.5 * self.anchor_first[b]
            self.anchor_first[b] = rotate(inverse(q_k), half)
            self.anchor_second[b] = rotate(inverse(q_l), -half)
            self.rest_orientation[b] = product(inverse(q_l), q_k)

    @ti.func
    def joined(self, i, j):
        """1 if an intact bond joins the grains of ids i < j, else 0."""
        result = 0
        for b in range(self.first_bond[i], self.first_bond[i + 1]):
            if self.second_id[b] == j:
                result = self.intact[b]
        return result

    @ti.func
    def kinematics(self, b):
        """(distance of the ends u [m], turn of second grain against first, axis as each carries it, arms [m])."""
        g = self.grains
        k, l = g.slot_of[self.first_id[b]], g.slot_of[self.second_id[b]]
        arm_k = rotate(g.orientation[k], self.anchor_first[b])
        arm_l = rotate(g.orientation[l], self.anchor_second[b])
        u = self.domain.displacement(g.position[k], g.position[l]) + arm_l - arm_k
        turn = product(g.orientation[l], product(self.rest_orientation[b], inverse(g.orientation[k])))
        length = arm_k.norm()
        return u, turn, arm_k / length, -arm_l / length, arm_k, arm_l

    @ti.func
    def evaluate(self, k):
        """Forces of the bonds that grain k leads; returns 1 if one of them broke.

        A bond that breaks in a step acts through half of it, as the trapezoidal rule wants of a force that ends there:
        so does its energy at this instant leave the budget, and nothing else.
        """
        g, broken = self.grains, 0
        i = g.id[k]
        for b in range(self.first_bond[i], self.first_bond[i + 1]):
            force = 0.0 * self.force[b]
            torque_k, torque_l = 0.0 * self.torque_first[b], 0.0 * self.torque_first[b]
            if self.intact[b] == 1:
                u, turn, e_k, e_l, arm_k, arm_l = self.kinematics(b)
                stiffness = self.stiffness[b]
                force, torque_k, torque_l = self.effect.on_bond(u, turn, e_k, e_l, stiffness)
                torque_k -= torque_of(arm_k, force)
                torque_l += torque_of(arm_l, force)
                if self.effect.bond_use(u, turn, e_k, e_l, stiffness, self.strength[b]) > 1.0:
                    broken = 1
                    self.intact[b], self.freed[b] = 0, 1
                    force, torque_k, torque_l = 0.5 * force, 0.5 * torque_k, 0.5 * torque_l
                    if ti.static(self.spec.tracks_dissipation):
                        held = self.effect.bond_energy(u, turn, e_k, e_l, stiffness)
                        g.dissipated[k][self.channel] = g.dissipated[k][self.channel] + held
            self.force[b], self.torque_first[b], self.torque_second[b] = force, torque_k, torque_l
        if broken == 1:
            self.broke[None] = 1
        return broken

    @ti.func
    def total_load(self, i):
        """(force [N], torque [N m]) of all bonds of the grain of id i, in the order of the bonds."""
        force = ti.Vector([ti.cast(0.0, ti.f64)] * self.dim)
        torque = ti.Vector([ti.cast(0.0, ti.f64)] * ti.static(rotation_size(self.dim)))
        for c in range(self.end_start[i], self.end_start[i + 1]):
            b = self.ends[c]
            if self.first_id[b] == i:
                force -= self.force[b]
                torque += self.torque_first[b]
            else:
                force += self.force[b]
                torque += self.torque_second[b]
        return force, torque

    @ti.func
    def energy(self, b):
        """Elastic energy of bond b [J], 0 if it is broken."""
        result = ti.cast(0.0, ti.f64)
        if self.intact[b] == 1:
            u, turn, e_k, e_l, arm_k, arm_l = self.kinematics(b)
            result = self.effect.bond_energy(u, turn, e_k, e_l, self.stiffness[b])
        return result


@ti.data_oriented
class FreedContacts:
    """Contacts that begin because a bond broke, between grains that overlap by more than one step can bring about."""

    def __init__(self, bonds, forces):
        self.bonds, self.forces, self.grains, self.pairs = bonds, forces, forces.grains, forces.pairs
        self.stores = [e for e in forces.contact_effects if hasattr(type(e), "contact_energy")]

    def begin(self):
        """After a rebuild, before its contacts: take the energy that appears from what the fracture has booked."""
        if self.bonds.broke[None]:
            self.settle()
            self.bonds.broke[None] = 0

    @ti.kernel
    def settle(self):
        g, bonds, pairs = self.grains, self.bonds, self.pairs
        ti.loop_config(serialize=True)
        for b in range(bonds.count):
            if bonds.freed[b] == 1:
                bonds.freed[b] = 0
                k = g.slot_of[bonds.first_id[b]]
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.second_id[s] == bonds.second_id[b]:
                        gain = ti.cast(self.begin_contact(b, k, pairs.second_slot[s], s), ti.f64)
                        bonds.contact_gain[b] = bonds.contact_gain[b] + gain
                        if ti.static(bonds.spec.tracks_dissipation):
                            g.dissipated[k][bonds.channel] = g.dissipated[k][bonds.channel] - gain

    @ti.func
    def begin_contact(self, b, k, l, s):
        """Elastic energy [J] of the new contact in list slot s, which then counts as an old one: it has no onset.

        Its force, too, acts through half of this step; the other half is taken back by that of the bond.
        """
        d = self.forces.geometry.shortest(k, l)
        depth, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, d, 0)
        contact = self.forces.contact_of(k, l, s, depth, n, arm_k, arm_l, 0.0)
        gain = 0.0 * contact.depth
        if contact.touching == 1:
            self.pairs.status[s] = ti.cast(TOUCHING, ti.i8)
            half = ti.cast(0.5 * self.forces.correction.elastic_force(depth) * n, ti.f64)
            self.bonds.force[b] = self.bonds.force[b] - half
            self.bonds.torque_first[b] = self.bonds.torque_first[b] + torque_of(arm_k, half)
            self.bonds.torque_second[b] = self.bonds.torque_second[b] - torque_of(arm_l, half)
            for effect in ti.static(self.stores):
                if ti.static(effect.history_size(self.grains.dim) > 0):
                    gain += effect.contact_energy(contact, self.forces.history_of(effect, s))
                else:
                    gain += effect.contact_energy(contact, 0)
        return gain
