"""The geometry of every listed contact, as the force loop sees it."""

import numpy as np

from taichi_lsm.core.runtime import ti


@ti.data_oriented
class ContactProbe:
    """Depth, normal, arms and features of the pairs (0, 1), (2, 3), ... of a simulation of shaped grains."""

    def __init__(self, sim):
        self.forces, self.pairs, self.dim = sim.forces, sim.pairs, sim.grains.dim
        self.found = ti.Vector.field(5 + 3 * self.dim, ti.f64, sim.pairs.capacity)

    @ti.kernel
    def measure(self):
        g, pairs = self.forces.grains, self.pairs
        for k in range(g.count[None]):
            for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                l = pairs.second_slot[s]
                depth, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, self.forces.geometry.shortest(k, l), 1)
                row = self.found[s]
                row[0], row[1], row[2] = g.id[k], g.id[l], depth
                row[3], row[4] = pairs.feature[s][0], pairs.feature[s][1]
                for axis in ti.static(range(self.dim)):
                    row[5 + axis], row[5 + self.dim + axis] = n[axis], arm_k[axis]
                    row[5 + 2 * self.dim + axis] = arm_l[axis]
                self.found[s] = row

    def rows(self):
        """depth (p,), normal, arm_k, arm_l (p, dim), features (p, 2) of the pairs in this order."""
        self.measure()
        rows = self.found.to_numpy()[: self.pairs.row_start.to_numpy().max()]
        rows = rows[np.argsort(rows[:, 0])]
        assert np.array_equal(rows[:, :2], np.arange(2 * len(rows)).reshape(-1, 2))
        return rows[:, 2], *np.split(rows[:, 5:], 3, axis=1), rows[:, 3:5]
