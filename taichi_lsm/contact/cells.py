"""A sparse grid of cells that lists the grains in and around each."""

import numpy as np

from ..runtime import ti

# Cells per axis of the sparse grid: two pointer levels over dense blocks, all powers of two (a struct-for over
# other extents skips cells). On open axes the index wraps round at the extent: far cells then share a bucket,
# which costs candidates but loses none, because every candidate's distance is tested.
LEVELS = {2: (64, 16, 8), 3: (16, 16, 4)}

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
    """Linked lists of grains per cell; only occupied blocks hold memory, so an empty domain costs nothing.

    Occupied cells are numbered, and each knows the lists of its surroundings: a look into the sparse tree costs
    more than testing the grains of a cell, and is done once for all of them.
    """

    def __init__(self, domain, grain_capacity):
        self.domain = domain
        self.dim = domain.dim
        self.extent = int(np.prod(LEVELS[self.dim]))
        self.head, self.top = sparse_heads(self.dim)
        self.next = ti.field(ti.i32, grain_capacity)
        self.number = ti.field(ti.i32, grain_capacity)  # of the cell of each grain
        self.occupied = ti.field(ti.i32, ())
        self.owner = ti.field(ti.i32, grain_capacity)  # a grain in each occupied cell
        self.places = 3**self.dim
        self.around = ti.field(ti.i32, grain_capacity * self.places)  # slot + 1 of the first grain of each list
        self.lists = ti.field(ti.i32, grain_capacity)  # that are not empty
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
        self.occupied[None] = 0
        ti.loop_config(serialize=True)
        for s in range(count[None]):
            k = count[None] - 1 - s  # backwards, so that each cell lists its grains in rising slots
            cell = self.cell_of(position[k])
            first = self.head[cell]
            c = self.occupied[None]
            if first > 0:
                c = self.number[first - 1]
            else:
                self.owner[c] = k
                self.occupied[None] = c + 1
            self.number[k] = c
            self.next[k] = first
            self.head[cell] = k + 1

    @ti.kernel
    def survey(self, position: ti.template()):
        for c in range(self.occupied[None]):
            home = self.cell_of(position[self.owner[c]])
            found = 0
            for offset in range(self.places):
                cell = home
                skip = 0
                code = offset
                for axis in ti.static(range(self.dim)):
                    step = code % 3 - 1
                    code = code // 3
                    # with two cells along a periodic axis the left neighbour is the right one, with one it is home
                    if step != 0 and self.cells[axis] <= 1 or step < 0 and self.cells[axis] == 2:
                        skip = 1
                    cell[axis] = self.wrapped(cell[axis] + step, axis)
                if skip == 0:
                    first = self.head[cell]
                    if first > 0:
                        self.around[c * self.places + found] = first
                        found += 1
            self.lists[c] = found

    def fill(self, position, count):
        """Sort all grains into the cells."""
        self.top.deactivate_all()
        self.insert(position, count)
        self.survey(position)
