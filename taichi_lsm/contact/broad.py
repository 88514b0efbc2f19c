"""Which grains are near each other: a sparse grid of cells and the neighbour list built from it."""

import numpy as np

from ..errors import SimulationError
from ..runtime import current, ti, when_allocated
from .pairs import PART_BASE, Pairs

# Cells per axis of the sparse grid: two pointer levels over dense blocks, all powers of two (a struct-for over
# other extents skips cells). On open axes the index wraps round at the extent: far cells then share a bucket,
# which costs candidates but loses none, because every candidate's distance is tested.
LEVELS = {2: (64, 16, 8), 3: (16, 16, 4)}
SORT_INTERVAL = 20  # rebuilds between two re-sortings of the grains along the cells


_heads: dict = {}


def sparse_heads(dim):
    """(head, top) of the process's only sparse grid of this dimension: first grain of each cell, and its tree.

    All simulations share it, because each fills it anew before it searches. Taichi cannot give a sparse tree back,
    and keeps its allocators in a table of 1024 nodes: trees declared late would be written beyond its end.
    """
    for each in (2, 3) if not _heads else ():
        axes = ti.ij if each == 2 else ti.ijk
        top, middle, block = LEVELS[each]
        head = ti.field(ti.i32)  # slot + 1, 0 in an empty cell
        tree = ti.root.pointer(axes, top)
        tree.pointer(axes, middle).dense(axes, block).place(head)
        _heads[each] = (head, tree)
    return _heads[dim]


@ti.data_oriented
class SparseGrid:
    """Linked lists of grains per cell; only occupied blocks hold memory, so an empty domain costs nothing."""

    def __init__(self, domain, grain_capacity):
        self.domain = domain
        self.dim = domain.dim
        self.extent = int(np.prod(LEVELS[self.dim]))
        self.head, self.top = sparse_heads(self.dim)
        self.next = ti.field(ti.i32, grain_capacity)
        self.cells = ti.field(ti.i32, self.dim)
        self.inverse_width = ti.field(ti.f64, self.dim)

    def set_width(self, reach):
        """Choose cells at least `reach` [m] wide: pairs closer than that are then in adjacent cells."""
        cells = np.full(self.dim, self.extent)
        inverse = np.full(self.dim, 1.0 / reach)
        for axis in range(self.dim):
            if self.domain.periodic[axis]:
                length = self.domain.length[axis]
                cells[axis] = min(max(1, int(length / reach)), self.extent)
                inverse[axis] = cells[axis] / length
        self.cells.from_numpy(cells.astype(np.int32))
        self.inverse_width.from_numpy(inverse)

    @ti.func
    def cell_of(self, x):
        """Cell index of position x [m]."""
        cell = ti.Vector([0] * self.dim)
        for axis in ti.static(range(self.dim)):
            raw = ti.cast(ti.floor(x[axis] * self.inverse_width[axis]), ti.i32)
            cell[axis] = self.wrapped(raw, axis)
        return cell

    @ti.func
    def wrapped(self, index, axis: ti.template()):
        """Cell index brought back into the grid."""
        result = index & (self.extent - 1)
        if ti.static(self.domain.periodic[axis]):
            n = self.cells[axis]
            result = index % n
            if result < 0:
                result += n
        return result

    @ti.kernel
    def insert(self, position: ti.template(), count: ti.template()):
        ti.loop_config(serialize=True)
        for s in range(count[None]):
            k = count[None] - 1 - s  # backwards, so that each cell lists its grains in rising slots
            cell = self.cell_of(position[k])
            self.next[k] = self.head[cell]
            self.head[cell] = k + 1

    def fill(self, position, count):
        """Sort all grains into the cells."""
        self.top.deactivate_all()
        self.insert(position, count)


@ti.data_oriented
class NeighbourSearch:
    """Finds the pairs nearer than the sum of bounding radii plus the skin [m], with the help of a sparse grid."""

    def __init__(self, grains, domain, skin, parts=None):
        self.grains = grains
        self.domain = domain
        self.parts, self.several = parts, parts is not None
        self.real = current().real
        self.dim = grains.dim
        self.skin = ti.field(ti.f64, ())
        self.grid = SparseGrid(domain, grains.slot_of.shape[0])
        self.row_count = ti.field(ti.i32, grains.slot_of.shape[0] + 1)
        self.trouble = ti.field(ti.i32, 2)  # 1 + id of a grain at a position that is no number; of a crushed platen
        self.searches = 0
        when_allocated(lambda: self.set_skin(skin))

    def set_skin(self, skin):
        """Choose the skin [m] and cells that suit it and the largest grain; the radii must be known."""
        self.skin[None] = skin
        self.grid.set_width(2.0 * float(self.grains.column("radius").max()) + skin)

    @ti.func
    def near(self, k, l):
        """Does the pair belong on the list? Grains glued to platens do not touch each other."""
        g = self.grains
        d = self.domain.displacement(g.position[k], g.position[l])
        reach = ti.cast(g.radius[k] + g.radius[l], ti.f64)
        listed = 0
        if d.dot(d) < (reach + self.skin[None]) ** 2:
            if g.platen[k] < 0 or g.platen[l] < 0:
                listed = 1
            elif g.platen[k] != g.platen[l] and d.dot(d) < reach * reach:
                self.trouble[1] = g.id[k] + 1
        return listed

    @ti.func
    def visit(self, k, s, p: ti.template(), fill: ti.template()):
        """Count the partners of grain k with a higher id, or write them from list slot s of p on, sorted by id."""
        g = self.grains
        found = 0
        home = self.grid.cell_of(g.position[k])
        for offset in range(ti.static(3**self.dim)):
            cell = home
            skip = 0
            code = offset
            for axis in ti.static(range(self.dim)):
                step = code % 3 - 1
                code = code // 3
                # with two cells along a periodic axis the left neighbour is the right one, with one it is home
                if step != 0 and self.grid.cells[axis] <= 1 or step < 0 and self.grid.cells[axis] == 2:
                    skip = 1
                cell[axis] = self.grid.wrapped(cell[axis] + step, axis)
            l = 0
            if skip == 0:
                l = self.grid.head[cell]
            while l > 0:
                if g.id[l - 1] > g.id[k]:
                    if self.near(k, l - 1):
                        if ti.static(self.several):
                            for a in range(self.parts.count[g.shape[k]]):
                                for b in range(self.parts.count[g.shape[l - 1]]):
                                    if self.near_parts(k, l - 1, a, b):
                                        if ti.static(fill):
                                            self.insert(s, found, k, l - 1, a * PART_BASE + b, p)
                                        found += 1
                        else:
                            if ti.static(fill):
                                self.insert(s, found, k, l - 1, 0, p)
                            found += 1
                l = self.grid.next[l - 1]
        return found

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
        while at > s and p.partner_id[at - 1] > g.id[l]:
            p.partner_id[at] = p.partner_id[at - 1]
            p.partner[at] = p.partner[at - 1]
            if ti.static(self.several):
                p.part_code[at] = p.part_code[at - 1]
            at -= 1
        p.partner_id[at] = g.id[l]
        p.partner[at] = l
        if ti.static(self.several):
            p.part_code[at] = code

    @ti.kernel
    def count_partners(self):
        for k in range(self.grains.count[None]):
            if ti.math.isnan(self.grains.position[k].sum()):
                self.trouble[0] = self.grains.id[k] + 1
            self.row_count[k] = self.visit(k, 0, 0, False)

    @ti.kernel
    def total(self) -> ti.i32:
        result = 0
        ti.loop_config(serialize=True)
        for k in range(self.grains.count[None]):
            result += self.row_count[k]
        return result

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

    def count(self):
        """Number of pairs to be listed. Raises SimulationError if a grain is lost or the layer is gone."""
        if self.searches % SORT_INTERVAL == 0:
            self.sort_grains()
        self.searches += 1
        self.grid.fill(self.grains.position, self.grains.count)
        self.trouble.fill(0)
        self.count_partners()
        nowhere, crushed = self.trouble.to_numpy()
        if nowhere:
            raise SimulationError(f"grain {nowhere - 1}: its position is not a number")
        if crushed:
            raise SimulationError(f"grain {crushed - 1} of one platen touches the other platen: no layer is left")
        return self.total()


@ti.data_oriented
class NeighbourList:
    """Writes the half list (each pair at its lower id) and its transpose into the storage of the pairs.

    The order of the list depends on persistent ids only: neither threads nor slots nor the time of a rebuild can
    change the bits of a sum over contacts. Pairs that stay listed keep their memory.
    """

    def __init__(self, search, pairs):
        self.search, self.pairs, self.grains = search, pairs, search.grains

    def write(self):
        """Write the list for the positions that the search has just counted."""
        self.write_rows()
        self.transpose()

    @ti.kernel
    def write_rows(self):
        g, p = self.grains, self.pairs
        n = g.count[None]
        for k in range(n):
            for s in range(p.row_start[k], p.row_start[k + 1]):
                p.keep(s)
        ti.loop_config(serialize=True)
        for k in range(n + 1):
            p.old_start[k] = p.row_start[k]
        ti.loop_config(serialize=True)
        for k in range(n):
            p.row_start[k + 1] = p.row_start[k] + self.search.row_count[k]
        for k in range(n):
            first = p.row_start[k]
            self.search.visit(k, first, p, True)
            g.built_position[k] = g.position[k]
            if ti.static(p.several):
                g.built_orientation[k] = g.orientation[k]
            old = g.previous_slot[k]
            o = p.old_start[old]
            end = p.old_start[old + 1]
            for s in range(first, p.row_start[k + 1]):  # both rows rise in partner id and part: a merge
                order = -1
                while o < end and order < 0:
                    order = p.rank(o, s)
                    if order < 0:
                        o += 1
                match = -1
                if o < end and order == 0:
                    match = o
                p.restore(s, match)
            g.previous_slot[k] = k

    @ti.kernel
    def transpose(self):
        g, p = self.grains, self.pairs
        n = g.count[None]
        ti.loop_config(serialize=True)
        for k in range(n + 1):
            p.cursor[k] = 0
        ti.loop_config(serialize=True)
        for s in range(p.row_start[n]):
            p.cursor[p.partner[s]] += 1
        ti.loop_config(serialize=True)
        for k in range(n):
            p.column_start[k + 1] = p.column_start[k] + p.cursor[k]
            p.cursor[k] = p.column_start[k]
        ti.loop_config(serialize=True)
        for i in range(n):  # rows in rising id, so that each column rises in the id of the first grain
            k = g.slot_of[i]
            for s in range(p.row_start[k], p.row_start[k + 1]):
                l = p.partner[s]
                p.column[p.cursor[l]] = s
                p.cursor[l] += 1


def morton_code(cell):
    """Interleaved bits of non-negative integer cells (n, dim) -> (n,) codes along a Z-shaped curve."""
    dim = cell.shape[1]
    code = np.zeros(len(cell), np.uint64)
    for bit in range(63 // dim):
        for axis in range(dim):
            code |= ((cell[:, axis].astype(np.uint64) >> np.uint64(bit)) & np.uint64(1)) << np.uint64(bit * dim + axis)
    return code


def grown(pairs, dim, grain_capacity, rotates, capacity):
    """Larger storage with the rows of `pairs` copied, so that a rebuild can carry their memory over."""
    kind, history, onset, several = pairs.kind, pairs.history_size, pairs.onset, pairs.several
    larger = Pairs(dim, grain_capacity, capacity, rotates, kind, history, onset, several)
    for name in ["row_start"] + [v.name for v in pairs.variables]:
        raw = getattr(larger, name).to_numpy()
        small = getattr(pairs, name).to_numpy()
        raw[: len(small)] = small
        getattr(larger, name).from_numpy(raw)
    return larger
