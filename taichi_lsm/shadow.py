"""The energy that Verlet's discrete motion really keeps, to second order in the step."""

import numpy as np

from .contact.pairs import TOUCHING
from .runtime import ti


@ti.data_oriented
class ShadowEnergy:
    """Correction of the energy: dt^2 [sum over contacts k d'^2/12 - sum over grains (F.F/m + T.I^-1 T)/24].

    H plus this is the shadow energy of velocity Verlet (backward error analysis). The energy H ripples around it by
    a bounded amount of order dt^2; what the shadow energy does is the true drift. Velocities are synchronised;
    conservative scenes only. Sums go by rising id, one grain after the other.
    """

    def __init__(self, sim):
        self.forces, self.integrator, self.grains, self.pairs = sim.forces, sim.integrator, sim.grains, sim.pairs
        self.term = ti.field(ti.f64, self.grains.slot_of.shape[0])

    @ti.func
    def rate_of_depth(self, k, l, n, arm_k, arm_l):
        """d' [m s-1] of a contact."""
        v_k, omega_k = self.integrator.synchronised(k)
        v_l, omega_l = self.integrator.synchronised(l)
        v = v_l - v_k
        if ti.static(self.forces.rotates):
            v += self.forces.spin_difference(omega_k, omega_l, arm_k, arm_l)
        return -v.dot(n)

    @ti.kernel
    def sum_terms(self):
        g, pairs = self.grains, self.pairs
        for k in range(g.count[None]):
            total = ti.cast(0.0, ti.f64)
            if g.platen[k] < 0:
                force, torque, kick, twist = self.forces.gathered(k)
                total -= force.dot(force) * g.inverse_mass[k] / 24.0
                if ti.static(self.forces.rotates):
                    torque = self.integrator.principal(k, torque)
                    total -= (torque * torque * g.inverse_inertia[k]).sum() / 24.0
            for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                if pairs.status[s] & TOUCHING:
                    l = pairs.partner[s]
                    d = self.forces.shortest(k, l)
                    depth, n, arm_k, arm_l = self.forces.overlap(k, l, s, d, 0)
                    contact = self.forces.contact_of(k, l, depth, n, arm_k, arm_l, 0.0)
                    rate = self.rate_of_depth(k, l, n, arm_k, arm_l)
                    for law in ti.static(self.forces.springs):
                        total += law.tangent_stiffness(contact) * rate * rate / 12.0
            self.term[k] = total

    def correction(self):
        """What to add to the energy [J]."""
        self.sum_terms()
        terms = self.term.to_numpy()[self.grains.slot_of.to_numpy()[: len(self.grains)]]
        return float(np.add.accumulate(terms)[-1]) * float(self.integrator.dt[None]) ** 2
