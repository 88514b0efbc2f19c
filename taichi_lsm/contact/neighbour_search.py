"""Which grains are near each other: the neighbour list, built from a sparse grid of cells."""

import numpy as np

from ..core.errors import SimulationError
from ..core.runtime import current, ti, when_allocated
from .cell_grid import SparseGrid
from .pair_storage import PART_BASE

FAR = 1e300  # [m], beyond which a coordinate is as good as no number
SORT_INTERVAL = 20  # rebuilds between two re-sortings of the grains along the cells
SORT_LEAST = 4000  # grains; fewer lie in the cache in any order
ROOM = 12  # partners that are noted while they are counted; longer rows are searched twice


@ti.data_oriented
class NeighbourSearch:
    """Finds the pairs nearer than the sum of bounding radii plus the skin [m], with the help of a sparse grid."""

    def __init__(self, spec, grains, domain, skin, parts=None, bonds=None):
        self.spec = spec
        self.grains = grains
        self.domain = domain
        self.parts, self.bonds = parts, bonds
        self.real, self.serial = current().real, current().serial
        self.dim = grains.dim
        self.skin = ti.field(ti.f64, ())
        self.grid = SparseGrid(domain, grains.slot_of.shape[0])
        self.row_count = ti.field(ti.i32, grains.slot_of.shape[0] + 1)
        self.found = ti.field(ti.i32, grains.slot_of.shape[0] * ROOM)  # partners of each grain, not sorted
        self.found_count = ti.field(ti.i32, grains.slot_of.shape[0]) if spec.multi_part else self.row_count
        self.trouble = ti.field(ti.i32, 3)  # 1 + id of a grain that is nowhere, of a crushed platen, of one that jumps
        self.fastest = ti.field(ti.f64, ())
        self.searches = 0
        when_allocated(lambda: self.set_skin(skin))

    def set_skin(self, skin):
        """Choose the skin [m] and cells that suit it and the largest grain; the radii must be known."""
        self.skin[None] = skin
        self.grid.set_width(2.0 * float(self.grains.column("radius").max()) + skin)

    @ti.func
    def listed(self, k, l):
        """1 if the pair belongs in the row of grain k, else 0, without a branch that depends on a distance.

        Rows hold partners of higher id. Grains glued to platens do not touch each other, nor do bonded ones.
        """
        g = self.grains
        d = self.domain.displacement(g.position[k], g.position[l])
        reach = ti.cast(g.radius[k] + g.radius[l], ti.f64)
        near = ti.cast(d.dot(d) < (reach + self.skin[None]) ** 2, ti.i32) & ti.cast(g.id[l] > g.id[k], ti.i32)
        if g.platen_index[k] >= 0:
            if near == 1 and g.platen_index[l] >= 0:
                near = 0
                if g.platen_index[k] != g.platen_index[l] and d.dot(d) < reach * reach:
                    self.trouble[1] = g.id[k] + 1
        if ti.static(self.spec.bonds > 0):
            if near == 1:
                near -= self.bonds.joined(g.id[k], g.id[l])
        return near

    @ti.func
    def search(self, k, lists, number):
        """Note the partners of grain k in `found`, as many as there is room for; returns how many there are.

        lists: first grains of the `number` cells in and around its own.
        """
        count = 0
        for i in range(number):
            l = lists[i]
            while l > 0:
                self.found[k * ROOM + ti.min(count, ROOM - 1)] = l - 1
                count += self.listed(k, l - 1)
                l = self.grid.next[l - 1]
        return count

    @ti.func
    def visit(self, k, s, p: ti.template(), fill: ti.template()):
        """Count the pairs in the row of grain k, or write them from list slot s of p on, sorted by id."""
        pairs = 0
        if self.found_count[k] < ROOM:  # the last place is overwritten by grains that are not near
            for i in range(self.found_count[k]):
                pairs += self.add(k, self.found[k * ROOM + i], s, pairs, p, fill)
        else:
            lists, number = self.grid.around(self.grid.number[k])
            for i in range(number):
                l = lists[i]
                while l > 0:
                    if self.listed(k, l - 1):
                        pairs += self.add(k, l - 1, s, pairs, p, fill)
                    l = self.grid.next[l - 1]
        return pairs

    @ti.func
    def add(self, k, l, s, found, p: ti.template(), fill: ti.template()):
        """Number of pairs that grain l adds to the row of grain k, which begins at s and holds `found` pairs."""
        g = self.grains
        more = 1
        if ti.static(self.spec.multi_part):
            more = 0
            for a in range(self.parts.count[g.shape_index[k]]):
                for b in range(self.parts.count[g.shape_index[l]]):
                    if self.near_parts(k, l, a, b):
                        if ti.static(fill):
                            self.insert(s, found + more, k, l, a * PART_BASE + b, p)
                        more += 1
        elif ti.static(fill):
            self.insert(s, found, k, l, 0, p)
        return more

    @ti.func
    def near_parts(self, k, l, a, b):
        """Do part a of grain k and part b of grain l belong on the list?"""
        g = self.grains
        d = ti.cast(self.domain.displacement(g.position[k], g.position[l]), self.real)
        return self.parts.apart(k, l, a, b, d) < ti.cast(self.skin[None], self.real)

    @ti.func
    def insert(self, s, found, k, l, code, p: ti.template()):
        """Put grain l into the row that begins at slot s and holds `found` pairs, in the order of ids and parts."""
        g = self.grains
        at = s + found
        while at > s and p.second_id[at - 1] > g.id[l]:
            p.second_id[at] = p.second_id[at - 1]
            p.second_slot[at] = p.second_slot[at - 1]
            if ti.static(self.spec.multi_part):
                p.part_code[at] = p.part_code[at - 1]
            at -= 1
        p.second_id[at] = g.id[l]
        p.second_slot[at] = l
        if ti.static(self.spec.multi_part):
            p.part_code[at] = code

    @ti.kernel
    def count_partners(self, jump: ti.f64) -> ti.i32:
        """Number of pairs to be listed. jump [s]: a grain that moves by more than its radius in this time is noted."""
        for i in ti.static(range(3)):
            self.trouble[i] = 0
        self.fastest[None] = 0.0
        ti.loop_config(serialize=self.serial)
        for c in range(self.grid.occupied[None]):
            lists, number = self.grid.around(c)
            k = self.grid.head[self.grid.home(c)] - 1
            while k >= 0:
                self.note_trouble(k, jump)
                self.found_count[k] = self.search(k, lists, number)
                if ti.static(self.spec.multi_part):
                    self.row_count[k] = self.visit(k, 0, 0, False)
                k = self.grid.next[k] - 1
        total = 0
        ti.loop_config(serialize=True)
        for k in range(self.grains.count[None]):
            total += self.row_count[k]
        return total

    @ti.func
    def note_trouble(self, k, jump):
        """Note the fastest grain, and one whose position is no number or that moves too far in one step."""
        g = self.grains
        if not ti.abs(g.position[k]).sum() < FAR:
            self.trouble[0] = g.id[k] + 1
        v = g.velocity[k]
        if ti.static(self.spec.sheared):
            v[0] -= self.domain.shear_rate[0] * g.position[k][1]
        speed = v.norm()
        if g.platen_index[k] < 0 and speed * jump > g.radius[k]:
            self.trouble[2] = g.id[k] + 1
        if ti.static(self.spec.multi_part):
            fastest = ti.abs(g.angular_velocity[k][0]) if ti.static(self.dim == 2) else g.angular_velocity[k].norm()
            speed += fastest * g.radius[k]
        ti.atomic_max(self.fastest[None], speed)

    def sort_grains(self):
        """Order the slots along the cells, so that neighbours in space are neighbours in memory."""
        g = self.grains
        x = g.position.to_numpy()[: len(g)]
        inverse = self.grid.inverse_width.to_numpy()
        cell = np.floor(x * inverse).astype(np.int64)
        for axis in range(self.dim):
            if self.domain.periodic[axis]:
                cell[:, axis] %= self.grid.cells[axis]
        cell -= cell.min(axis=0)
        g.reorder(np.argsort(morton_code(cell), kind="stable"))

    def count(self, dt, guards):
        """Number of pairs to be listed. Raises SimulationError if a guard finds a grain that is lost or that jumps in a
        step of dt [s], or if the layer is gone.

        Grains that part must still be listed in the step in which they do so: a skin of less than that is widened.
        """
        if len(self.grains) >= SORT_LEAST and self.searches % SORT_INTERVAL == 0:
            self.sort_grains()
        self.searches += 1
        self.grid.fill(self.grains.position, self.grains.count)
        total = self.count_partners(dt / guards.displacement if guards.displacement else 0.0)
        lost, crushed, jumping = self.trouble.to_numpy() - 1
        if lost >= 0 and guards.finite:
            raise SimulationError(f"grain {lost}: its position is not a number", grains=[lost])
        if crushed >= 0:
            text = f"grain {crushed} of one platen touches the other platen: no layer is left"
            raise SimulationError(text, grains=[crushed])
        if jumping >= 0:
            raise self.jump_error(jumping, dt, guards.displacement)
        parting = 2.0 * (self.fastest[None] + self.domain.flow_over(self.skin[None])) * dt
        if parting > self.skin[None] and np.isfinite(parting):
            self.set_skin(2.0 * parting)
            return self.count(dt, guards)
        return total

    def jump_error(self, k, dt, limit):
        """SimulationError which says that grain k moves by more than `limit` radii in a step of dt [s]."""
        g = self.grains
        v = g.column("velocity")[k] - self.domain.mean_flow(g.column("position"))[k]
        displacement = float(np.linalg.norm(v) * dt / g.column("radius")[k])
        return SimulationError(
            f"grain {k} moves by {displacement:.3g} of its bounding radius in one step, allowed is {limit:g}; "
            f"use dt <= {limit / displacement * dt:g} s, or softer impacts",
            grains=[k],
            values={"displacement": displacement, "limit": limit},
        )


def morton_code(cell):
    """Interleaved bits of non-negative integer cells (n, dim) -> (n,) codes along a Z-shaped curve."""
    dim = cell.shape[1]
    code = np.zeros(len(cell), np.uint64)
    for bit in range(63 // dim):
        for axis in range(dim):
            code |= ((cell[:, axis].astype(np.uint64) >> np.uint64(bit)) & np.uint64(1)) << np.uint64(bit * dim + axis)
    return code
