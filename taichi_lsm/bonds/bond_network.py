"""Bonds between grains: what they store, how they are evaluated, and when they break.

A bond belongs to its grain of lower id, which evaluates it; both grains then sum the forces of their bonds in a fixed
order, by persistent ids, so that the bits depend neither on threads nor on where the grains lie in memory.
"""

from typing import Any

import numpy as np

from ..core.allocation import when_allocated, write
from ..core.fields import allocate, orientation_size, rotation_size
from ..core.rotation import inverse, product, rotate, torque_of
from ..core.runtime import ti
from ..core.schema import Variable
from .bond_setup import bond_branches, bond_numbers

BOND_ROWS = (
    Variable("first_id", ("bond",), "i32", "1", "persistent number of the first grain, the lower one", True),
    Variable("second_id", ("bond",), "i32", "1", "persistent number of the second grain", True),
    Variable("intact", ("bond",), "i32", "1", "1 until the bond breaks, then 0", True),
    Variable("force", ("bond", "space"), "f64", "N", "force of the bond on the second grain", True),
    Variable("torque_first", ("bond", "rotation"), "f64", "N m", "torque of the bond on the first grain", True),
    Variable("torque_second", ("bond", "rotation"), "f64", "N m", "torque of the bond on the second grain", True),
    Variable(
        "contact_gain", ("bond",), "f64", "J", "elastic energy of the contact that began when the bond broke", True
    ),
    Variable("freed", ("bond",), "i32", "1", "1 if it broke in the present step", True),
    Variable("anchor_first", ("bond", "space"), "f64", "m", "middle of the bond, in the frame of the first grain"),
    Variable("anchor_second", ("bond", "space"), "f64", "m", "middle of the bond, in the frame of the second grain"),
    Variable(
        "rest_orientation",
        ("bond", "orientation"),
        "f64",
        "1",
        "orientation of the first grain relative to the second at the start",
    ),
    Variable("stiffness", ("bond", "four"), "f64", "1", "of tension, shear [N m-1], bending and torsion [N m]"),
    Variable("strength", ("bond", "four"), "f64", "1", "in tension, shear [N], bending and torsion [N m]"),
)


@ti.data_oriented
class Bonds:
    """The bonds of a simulation, sorted by the lower, then the higher id; the fields of BOND_ROWS are attributes.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    scene : Scene
        Scene with bonds.
    effect : Effect
        The effect that acts in bonds.
    grains
        State of the grains.
    domain : Domain
        The cell.

    Notes
    -----
    Bonds first_bond[i] to first_bond[i + 1] belong to the grain of id i, the one of lower id. The bonds of every grain,
    as first or second, are ends[end_start[i]] to ends[end_start[i + 1]].
    """

    def __init__(self, spec: Any, scene: Any, effect: Any, grains: Any, domain: Any) -> None:
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

    def forget_breaks(self) -> None:
        """No bond broke in the present step: a run starts again."""
        self.freed.fill(0)
        self.broke[None] = 0

    def begin(self) -> None:
        """Take the present placement of the grains, to which `fill` belongs, as the one without loads."""
        for row in (self.force, self.torque_first, self.torque_second, self.contact_gain):
            row.fill(0)
        self.set_reference()

    def fill(self, scene: Any) -> None:
        """Write the bonds of `scene`, all of them intact, with the present placement of the grains as reference.

        Raises InputError if two bonded grains lie on each other.
        """
        first, second = scene.bonds.T
        capacity = self.first_bond.shape[0] - 1
        write(self.first_id, first)
        write(self.second_id, second)
        write(self.first_bond, np.searchsorted(first, np.arange(capacity + 1)))
        # Ends of the bonds by grain, those of one grain in the order of the bonds.
        grain = np.concatenate([first, second])
        order = np.lexsort([np.tile(np.arange(self.count), 2), grain])
        write(self.ends, order % self.count)
        write(self.end_start, np.searchsorted(grain[order], np.arange(capacity + 1)))
        stiffness, strength, _ = bond_numbers(scene)
        write(self.stiffness, stiffness)
        write(self.strength, strength)
        write(self.intact, np.ones(self.count))
        write(self.anchor_first, bond_branches(scene))

    @ti.kernel
    def set_reference(self):
        """Take the present placement as the one without stress; `anchor_first` holds the branch vectors [m].

        The anchor is the middle of the bond, in the body frame of either grain; q_l^-1 q_k is the relative orientation.
        """
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
        """1 if an intact bond joins the grains of the ids i < j, else 0."""
        result = 0
        for b in range(self.first_bond[i], self.first_bond[i + 1]):
            if self.second_id[b] == j:
                result = self.intact[b]
        return result

    @ti.func
    def kinematics(self, b):
        """Kinematics of bond b: u [m], relative rotation, axes e_k and e_l, arms of k and l [m]; world frame.

        u = d + arm_l - arm_k is the vector between both images of the middle of the bond, zero at the start; the
        rotation is that of the second grain relative to the first since the start, q_l (q_l0^-1 q_k0) q_k^-1; e_k and
        e_l are the unit axis of the bond as each grain carries it; the arms run from the centres to the middle.
        """
        g = self.grains
        k, l = g.slot_of[self.first_id[b]], g.slot_of[self.second_id[b]]
        arm_k = rotate(g.orientation[k], self.anchor_first[b])
        arm_l = rotate(g.orientation[l], self.anchor_second[b])
        u = self.domain.displacement(g.position[k], g.position[l]) + arm_l - arm_k
        rotation = product(g.orientation[l], product(self.rest_orientation[b], inverse(g.orientation[k])))
        length = arm_k.norm()
        return u, rotation, arm_k / length, -arm_l / length, arm_k, arm_l

    @ti.func
    def evaluate(self, k):
        """Forces and torques of the bonds that belong to grain k; returns 1 if one of them broke.

        A bond that breaks in a step acts through half of it: the trapezoidal rule then integrates a force that ends at
        this instant, and the energy dissipated is exactly what the bond held.
        """
        g, broken = self.grains, 0
        i = g.id[k]
        for b in range(self.first_bond[i], self.first_bond[i + 1]):
            force = 0.0 * self.force[b]
            torque_k, torque_l = 0.0 * self.torque_first[b], 0.0 * self.torque_first[b]
            if self.intact[b] == 1:
                u, rotation, e_k, e_l, arm_k, arm_l = self.kinematics(b)
                stiffness = self.stiffness[b]
                # Moments at the middle of the bond, moved to the centres of the grains.
                force, torque_k, torque_l = self.effect.on_bond(u, rotation, e_k, e_l, stiffness)
                torque_k -= torque_of(arm_k, force)
                torque_l += torque_of(arm_l, force)
                if self.effect.bond_use(u, rotation, e_k, e_l, stiffness, self.strength[b]) > 1.0:
                    broken = 1
                    self.intact[b], self.freed[b] = 0, 1
                    force, torque_k, torque_l = 0.5 * force, 0.5 * torque_k, 0.5 * torque_l
                    if ti.static(self.spec.tracks_dissipation):
                        held = self.effect.bond_energy(u, rotation, e_k, e_l, stiffness)
                        g.dissipated[k][self.channel] = g.dissipated[k][self.channel] + held
            self.force[b], self.torque_first[b], self.torque_second[b] = force, torque_k, torque_l
        if broken == 1:
            self.broke[None] = 1
        return broken

    @ti.func
    def load_on(self, i):
        """Force [N] and torque [N m] of all bonds on the grain of id i, in the order of the bonds; world frame."""
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
            result = self.held(b)
        return result

    @ti.func
    def held(self, b):
        """Elastic energy [J] that bond b has, or would have if it had not broken, at the present placement."""
        u, rotation, e_k, e_l, arm_k, arm_l = self.kinematics(b)
        return self.effect.bond_energy(u, rotation, e_k, e_l, self.stiffness[b])
