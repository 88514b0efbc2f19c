"""The energy that Verlet's discrete motion really keeps, to second order in the step."""

from typing import TYPE_CHECKING

import numpy as np

from ..contact.pair_storage import TOUCHING
from ..core.allocation import read, write
from ..core.errors import InputError
from ..core.rotation import advanced_orientation, free_rotor
from ..core.runtime import ti

if TYPE_CHECKING:
    from ..simulation import Simulation

FLIGHT = 0.01  # of the step: how far the grains fly to measure the second rate of the elastic energy


@ti.data_oriented
class ShadowEnergy:
    """Correction of the energy: dt^2 [U''/12 - sum over grains (F.F/m + T.I^-1 T)/24].

    H plus this is the shadow energy of velocity Verlet (backward error analysis). U'' is the second derivative of the
    elastic energy along the free flight of the grains: k d'^2 + k d d'' for springs, d'' holds the turning of the
    normal. The energy H oscillates around the shadow energy by a bounded amount of order dt^2; what the shadow energy
    does is the true drift. Velocities are synchronised; conservative scenes only. Sums go by rising id.
    """

    def __init__(self, sim: "Simulation") -> None:
        if sim.walls or sim.spec.sheared:
            raise InputError("ShadowEnergy: knows neither walls nor a sheared cell, but the scene has them")
        self.forces, self.integrator, self.grains, self.pairs = sim.forces, sim.integrator, sim.grains, sim.pairs
        self.spec = sim.spec
        capacity = self.grains.slot_of.shape[0]
        self.term = ti.field(ti.f64, capacity)
        self.start = ti.Vector.field(self.grains.dim, ti.f64, capacity)
        self.start_orientation = ti.Vector.field(self.grains.sizes["orientation"], ti.f64, capacity)

    @ti.kernel
    def kinetic_terms(self):
        """Begin the terms with -(F.F/m + T.I^-1 T)/24 of each grain, and keep where the grains are."""
        g = self.grains
        for k in range(g.count[None]):
            total = ti.cast(0.0, ti.f64)
            if g.platen_index[k] < 0:
                load = self.forces.total_load(k)
                total -= load.force.dot(load.force) * g.inverse_mass[k] / 24.0
                if ti.static(self.spec.rotates):
                    torque = self.integrator.principal(k, load.torque)
                    total -= (torque * torque * g.inverse_inertia[k]).sum() / 24.0
            self.term[k] = total
            self.start[k] = g.position[k]
            if ti.static(self.spec.oriented):
                self.start_orientation[k] = g.orientation[k]

    @ti.kernel
    def fly(self, time: ti.f64):
        """Place the grains where they would be after `time` [s] without forces; 0 brings them back."""
        g = self.grains
        for k in range(g.count[None]):
            g.position[k] = self.start[k]
            if ti.static(self.spec.oriented):
                g.orientation[k] = self.start_orientation[k]
            if time != 0.0:
                v, omega = self.integrator.synchronised(k)
                g.position[k] += v * time
                if ti.static(self.spec.tumbles):
                    inverse = ti.cast(g.inverse_inertia[k], ti.f64)
                    momentum = self.integrator.momentum(k)
                    g.orientation[k] = free_rotor(g.orientation[k], momentum, inverse, time)
                elif ti.static(self.spec.oriented):
                    g.orientation[k] = advanced_orientation(g.orientation[k], omega, time)

    @ti.kernel
    def add_elastic(self, weight: ti.f64):
        """Add the elastic energy of each grain's row, times `weight`, to its term."""
        g, pairs = self.grains, self.pairs
        for k in range(g.count[None]):
            if ti.static(self.spec.bonds > 0):
                for b in range(self.forces.bonds.first_bond[g.id[k]], self.forces.bonds.first_bond[g.id[k] + 1]):
                    self.term[k] += weight * self.forces.bonds.energy(b)
            for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                if pairs.status[s] & TOUCHING:
                    l = pairs.second_slot[s]
                    d = self.forces.geometry.shortest(k, l)
                    depth, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, d, 1)
                    # a contact that begins or ends within the flight counts as if it went on: U'' jumps there
                    contact = self.forces.contact_of(k, l, s, ti.abs(depth), n, arm_k, arm_l, 0.0)
                    for effect in ti.static(self.forces.springs):
                        self.term[k] += weight * effect.contact_energy(contact, 0)

    def correction(self) -> float:
        """What to add to the energy [J]. Leaves the simulation as it was, the features of its contacts included."""
        dt = float(self.integrator.dt[None])
        h = FLIGHT * dt
        memory = {n: read(getattr(self.pairs, n)) for n in ("feature", "normal") if hasattr(self.pairs, n)}
        self.kinetic_terms()
        for time, weight in ((h, 1.0), (-h, 1.0), (0.0, -2.0)):
            self.fly(time)
            self.add_elastic(weight / (12.0 * h * h))
        for name, values in memory.items():
            write(getattr(self.pairs, name), values)
        terms = read(self.term)[self.grains.slots]
        return float(np.add.accumulate(terms)[-1]) * dt**2
