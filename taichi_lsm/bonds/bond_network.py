"""Bonds between grains: what they store, how they are evaluated, and the fragments that intact ones hold together.

A bond belongs to its grain of lower id, which evaluates it; both grains then gather its force in a fixed order, by the
persistent ids, so that the bits depend neither on threads nor on where the grains lie in memory.
"""

import numpy as np

from ..contact.pair_storage import TOUCHING
from ..core.errors import InputError
from ..core.rotation import rotate, torque_of
from ..core.runtime import ti, when_allocated
from ..core.schema import Variable
from ..stepping.grain_state import allocate, spin_size, turn_size

BOND_ROWS = (
    Variable("first", ("bond",), "i32", "1", "persistent number of the first grain, the lower one", True),
    Variable("second", ("bond",), "i32", "1", "persistent number of the second grain", True),
    Variable("intact", ("bond",), "i32", "1", "1 until the bond breaks, then 0", True),
    Variable("force", ("bond", "space"), "f64", "N", "force of the bond on the second grain", True),
    Variable("torque_first", ("bond", "spin"), "f64", "N m", "torque of the bond on the first grain", True),
    Variable("torque_second", ("bond", "spin"), "f64", "N m", "torque of the bond on the second grain", True),
    Variable("contact_gain", ("bond",), "f64", "J", "elastic energy of the contact that its breaking set free", True),
    Variable("freed", ("bond",), "i32", "1", "1 if it broke in the present step", True),
    Variable("anchor_first", ("bond", "space"), "f64", "m", "middle of the bond, in the frame of the first grain"),
    Variable("anchor_second", ("bond", "space"), "f64", "m", "middle of the bond, in the frame of the second grain"),
    Variable("rest_turn", ("bond", "turn"), "f64", "1", "first grain against the second at the start"),
    Variable("stiffness", ("bond", "four"), "f64", "1", "of tension, shear [N m-1], bending and torsion [N m]"),
    Variable("strength", ("bond", "four"), "f64", "1", "in tension, shear [N], bending and torsion [N m]"),
)


@ti.func
def product(a, b):
    """Turn b followed by turn a: unit complex numbers (2D) or quaternions."""
    if ti.static(a.n == 2):
        return ti.Vector([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
    else:
        u, v = ti.Vector([a[1], a[2], a[3]]), ti.Vector([b[1], b[2], b[3]])
        w = a[0] * v + b[0] * u + u.cross(v)
        return ti.Vector([a[0] * b[0] - u.dot(v), w[0], w[1], w[2]])


@ti.func
def inverse(turn):
    """The turn that undoes another one."""
    result = -turn
    result[0] = turn[0]
    return result


def checked_bonds(pairs, effects, count):
    """Bonds (m, 2) of `count` grains with the lower id first, sorted, or None for none.

    Raises InputError if they make no sense, or if the effects hold a law of bonds and there are none or the reverse.
    """
    if (bond_law(effects) is None) != (pairs is None):
        raise InputError(
            "Scene.bonds: a law of bonds in Scene.effects and bonded grains, must be given both or neither"
        )
    if pairs is None:
        return None
    pairs = np.asarray(pairs)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or len(pairs) == 0 or pairs.dtype.kind not in "iu":
        raise InputError(f"Scene.bonds: {pairs.dtype} array of shape {pairs.shape}, must be integers (m, 2), m > 0")
    if pairs.min() < 0 or pairs.max() >= count:
        raise InputError(f"Scene.bonds: grains {pairs.min()}..{pairs.max()}, must be 0..{count - 1}")
    pairs = np.sort(pairs.astype(np.int32), axis=1)
    same = pairs[:, 0] == pairs[:, 1]
    if same.any():
        raise InputError(f"Scene.bonds: grain {pairs[same][0, 0]} is bonded to itself, a bond needs two grains")
    unique = np.unique(pairs, axis=0)
    if len(unique) < len(pairs):
        raise InputError(f"Scene.bonds: {len(pairs) - len(unique)} bonds are given twice, each may be listed once")
    return unique


def bond_branches(scene):
    """Vectors (m, dim) [m] from the first grain of each bond to the nearest image of the second, at the start."""
    d = scene.position[scene.bonds[:, 1]] - scene.position[scene.bonds[:, 0]]
    for axis, (length, periodic) in enumerate(zip(scene.lengths, scene.periodic, strict=True)):
        if periodic:
            d[:, axis] -= length * np.round(d[:, axis] / length)
    return d


def bond_numbers(scene):
    """(stiffness (m, 4), strength (m, 4), length (m,) [m]) of the bonds of a scene."""
    law = bond_law(scene.effects)
    length = np.linalg.norm(bond_branches(scene), axis=1)
    apart = length > 1e-6 * scene.scale[scene.bonds].max(axis=1)
    if not apart.all():
        raise InputError(f"Scene.bonds: grains {scene.bonds[~apart][0].tolist()} lie on each other, must be apart")
    radius = 0.25 * scene.scale[scene.bonds].sum(axis=1)
    depth = scene.thickness if scene.dim == 2 else None
    return law.bond_stiffness(radius, length, depth), law.bond_strength(radius, depth), length


def bond_law(effects):
    """The law of the bonds, None if there is none."""
    return next((e for e in effects if e.phase == "bond"), None)


def bond_rate(scene):
    """Bound on the square of the angular frequencies of the bonds [s-2].

    The energy of a bond is at most twice the sum of what either grain's motion alone would give; so is omega^2 at most
    twice the greatest sum over the bonds of a grain. Grains on platens do not move by bonds.
    """
    stiffness, _, length = bond_numbers(scene)
    mass, inertia = scene.masses()
    tension, shear, bend, twist = stiffness.T
    rate = np.zeros(len(mass))
    for end in (0, 1):
        k = scene.bonds[:, end]
        m, least = mass[k], inertia[k].min(axis=1)
        turning = shear * (1.0 / m + 0.25 * length**2 / least) + np.maximum(bend, twist) / least
        np.add.at(rate, k, np.maximum(tension / m, turning))
    return 2.0 * float(rate[scene.platen < 0].max(initial=0.0))


@ti.data_oriented
class Bonds:
    """The bonds of a simulation, sorted by the lower and then the higher id: the fields of BOND_ROWS are attributes.

    Their places `lead[i]` to `lead[i + 1]` belong to grain i as the lower one; `ends` lists the bonds of every grain.
    """

    def __init__(self, scene, law, grains, domain):
        self.law, self.grains, self.domain, self.dim = law, grains, domain, grains.dim
        self.count = len(scene.bonds)
        self.variables = BOND_ROWS
        sizes = {"space": self.dim, "spin": spin_size(self.dim), "turn": turn_size(self.dim), "four": 4}
        for name, field in vars(allocate(BOND_ROWS, self.count, sizes)).items():
            setattr(self, name, field)
        capacity = grains.slot_of.shape[0]
        self.lead = ti.field(ti.i32, capacity + 1)
        self.end_start = ti.field(ti.i32, capacity + 1)
        self.ends = ti.field(ti.i32, 2 * self.count)
        self.broke = ti.field(ti.i32, ())  # 1 if a bond broke in the present step
        self.book = 0  # column of the energy ledger
        self.ledger = grains.has("dissipated")
        when_allocated(lambda: self.fill(scene))

    def fill(self, scene):
        """Write the reference placement, stiffness and strength of the bonds of `scene`, all of them intact."""
        first, second = scene.bonds.T
        capacity = len(self.lead.to_numpy()) - 1
        self.first.from_numpy(first)
        self.second.from_numpy(second)
        self.lead.from_numpy(np.searchsorted(first, np.arange(capacity + 1)).astype(np.int32))
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
            turn_k, turn_l = g.orientation[g.slot_of[self.first[b]]], g.orientation[g.slot_of[self.second[b]]]
            half = 0.5 * self.anchor_first[b]
            self.anchor_first[b] = rotate(inverse(turn_k), half)
            self.anchor_second[b] = rotate(inverse(turn_l), -half)
            self.rest_turn[b] = product(inverse(turn_l), turn_k)

    @ti.func
    def joined(self, i, j):
        """1 if an intact bond joins the grains of ids i < j, else 0."""
        result = 0
        for b in range(self.lead[i], self.lead[i + 1]):
            if self.second[b] == j:
                result = self.intact[b]
        return result

    @ti.func
    def placed(self, b):
        """(distance of the ends u [m], turn of second grain against first, axis as each carries it, arms [m])."""
        g = self.grains
        k, l = g.slot_of[self.first[b]], g.slot_of[self.second[b]]
        arm_k = rotate(g.orientation[k], self.anchor_first[b])
        arm_l = rotate(g.orientation[l], self.anchor_second[b])
        u = self.domain.displacement(g.position[k], g.position[l]) + arm_l - arm_k
        turn = product(g.orientation[l], product(self.rest_turn[b], inverse(g.orientation[k])))
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
        for b in range(self.lead[i], self.lead[i + 1]):
            force = 0.0 * self.force[b]
            torque_k, torque_l = 0.0 * self.torque_first[b], 0.0 * self.torque_first[b]
            if self.intact[b] == 1:
                u, turn, e_k, e_l, arm_k, arm_l = self.placed(b)
                stiffness = self.stiffness[b]
                force, torque_k, torque_l = self.law.on_bond(u, turn, e_k, e_l, stiffness)
                torque_k -= torque_of(arm_k, force)
                torque_l += torque_of(arm_l, force)
                if self.law.bond_use(u, turn, e_k, e_l, stiffness, self.strength[b]) > 1.0:
                    broken = 1
                    self.intact[b], self.freed[b] = 0, 1
                    force, torque_k, torque_l = 0.5 * force, 0.5 * torque_k, 0.5 * torque_l
                    if ti.static(self.ledger):
                        held = self.law.bond_energy(u, turn, e_k, e_l, stiffness)
                        g.dissipated[k][self.book] = g.dissipated[k][self.book] + held
            self.force[b], self.torque_first[b], self.torque_second[b] = force, torque_k, torque_l
        if broken == 1:
            self.broke[None] = 1
        return broken

    @ti.func
    def gathered(self, i):
        """(force [N], torque [N m]) of all bonds of the grain of id i, in the order of the bonds."""
        force = ti.Vector([ti.cast(0.0, ti.f64)] * self.dim)
        torque = ti.Vector([ti.cast(0.0, ti.f64)] * ti.static(spin_size(self.dim)))
        for c in range(self.end_start[i], self.end_start[i + 1]):
            b = self.ends[c]
            if self.first[b] == i:
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
            u, turn, e_k, e_l, arm_k, arm_l = self.placed(b)
            result = self.law.bond_energy(u, turn, e_k, e_l, self.stiffness[b])
        return result


@ti.data_oriented
class FreedContacts:
    """Contacts that begin because a bond broke, between grains that overlap by more than one step can bring about."""

    def __init__(self, bonds, forces):
        self.bonds, self.forces, self.grains, self.pairs = bonds, forces, forces.grains, forces.pairs
        self.stores = [e for e in forces.laws if hasattr(type(e), "contact_energy")]

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
                k = g.slot_of[bonds.first[b]]
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.partner_id[s] == bonds.second[b]:
                        gain = ti.cast(self.meet(b, k, pairs.partner[s], s), ti.f64)
                        bonds.contact_gain[b] = bonds.contact_gain[b] + gain
                        if ti.static(bonds.ledger):
                            g.dissipated[k][bonds.book] = g.dissipated[k][bonds.book] - gain

    @ti.func
    def meet(self, b, k, l, s):
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
            for law in ti.static(self.stores):
                if ti.static(law.history_size(self.grains.dim) > 0):
                    gain += law.contact_energy(contact, self.forces.history_of(law, s))
                else:
                    gain += law.contact_energy(contact, 0)
        return gain


def fragments(sim):
    """Fragment (n,) of every grain, numbered from 0: grains that intact bonds join, directly or through others.

    sim: a simulation; in one without bonds every grain is a fragment of its own.
    """
    from scipy.sparse import coo_array  # takes a while to load
    from scipy.sparse.csgraph import connected_components

    count = len(sim)
    if sim.bonds is None:
        return np.arange(count)
    pairs = sim.scene.bonds[sim.bonds.intact.to_numpy() == 1]
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(links, directed=False)[1]
