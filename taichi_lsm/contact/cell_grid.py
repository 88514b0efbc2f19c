"""A sparse grid of cells that lists the grains in and around each."""

from typing import Any

import numpy as np

from ..core.allocation import read, write
from ..core.runtime import ti

# Cells per axis of the sparse grid: two pointer levels over dense blocks, all powers of two (a struct-for over
# other extents skips cells). On open axes the index wraps round at the extent: far cells then share a bucket, which
# adds candidates but loses none, because the distance of every candidate is tested.
LEVELS = {2: (64, 16, 8), 3: (16, 16, 4)}

RELEASE = 500  # fills between two releases of the blocks of cells that grains have left

_heads: dict[int, tuple[Any, Any]] = {}
_users: dict[int, "SparseGrid"] = {}  # the grid whose grains the sparse tree of each dimension holds


def sparse_heads(dim: int) -> tuple[Any, Any]:
    """Field of the first grain of each cell and top node of its tree: one sparse grid per dimension and process.

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

    Parameters
    ----------
    domain : Domain
        The cell of the simulation.
    grain_capacity : int
        Number of grains that the lists have room for.

    Notes
    -----
    Occupied cells are numbered. An access to the sparse tree costs more than the tests of the grains of a cell; the
    search therefore goes from cell to cell and reads the surrounding ones once for all grains of the cell.
    """

    def __init__(self, domain: Any, grain_capacity: int) -> None:
        self.domain = domain
        self.dim = domain.dim
        self.fills = 0
        self.extent = int(np.prod(LEVELS[self.dim]))
        self.head, self.top = sparse_heads(self.dim)
        self.next = ti.field(ti.i32, grain_capacity)
        self.number = ti.field(ti.i32, grain_capacity)  # of the cell of each grain
        self.occupied = ti.field(ti.i32, ())
        self.index = ti.field(ti.i32, grain_capacity * self.dim)  # of each occupied cell in the grid
        self.neighbourhood = 3**self.dim  # a cell and those around it
        self.cells = ti.field(ti.i32, self.dim)
        self.inverse_width = ti.field(ti.f64, self.dim)

    def set_width(self, reach: float) -> None:
        """Make cells at least `reach` [m] wide: pairs closer than that are then in adjacent cells."""
        cells, lengths = np.full(self.dim, self.extent), read(self.domain.length)
        inverse = np.full(self.dim, 1.0 / reach)
        for axis in range(self.dim):
            if self.domain.periodic[axis]:
                # A whole number of cells; in a sheared cell they must hold distances stretched by `straightened`.
                least = reach * (self.domain.widening() if axis == 0 else 1.0)
                cells[axis] = min(max(1, int(lengths[axis] / least)), self.extent)
                inverse[axis] = cells[axis] / lengths[axis]
        write(self.cells, cells)
        write(self.inverse_width, inverse)

    @ti.func
    def cell_of(self, x):
        """Index (dim,) of the cell that holds the position x [m]."""
        cell = ti.Vector([0] * self.dim)
        for axis in ti.static(range(self.dim)):
            raw = ti.cast(ti.floor(x[axis] * self.inverse_width[axis]), ti.i32)
            cell[axis] = self.wrapped(raw, axis)
        return cell

    @ti.func
    def wrapped(self, index, axis: ti.template()):
        """Index of a cell along an axis, brought back into the grid."""
        result = index & (self.extent - 1)
        if ti.static(self.domain.periodic[axis]):
            n = self.cells[axis]
            result = index % n
            if result < 0:
                result += n
        return result

    @ti.kernel
    def insert_grains(self, position: ti.template(), count: ti.template()):
        """Empty the cells that were occupied and list all grains at their present positions."""
        ti.loop_config(serialize=True)
        for _ in range(1):  # one serial pass: the order within a cell must not depend on threads
            for c in range(self.occupied[None]):
                self.head[self.index_of(c)] = 0
            self.occupied[None] = 0
            for s in range(count[None]):
                k = count[None] - 1 - s  # backwards, so that each cell lists its grains in rising slots
                # Number the cell when its first grain comes, and put the grain at the front of its list.
                cell = self.cell_of(self.domain.straightened(position[k]))
                first = self.head[cell]
                c = self.occupied[None]
                if first > 0:
                    c = self.number[first - 1]
                else:
                    for axis in ti.static(range(self.dim)):
                        self.index[c * self.dim + axis] = cell[axis]
                    self.occupied[None] = c + 1
                self.number[k] = c
                self.next[k] = first
                self.head[cell] = k + 1

    @ti.func
    def index_of(self, c):
        """Index (dim,) in the grid of the occupied cell number c."""
        return ti.Vector([self.index[c * self.dim + axis] for axis in range(self.dim)])

    @ti.func
    def around(self, c):
        """Slot + 1 of the first grain of every occupied cell in and around cell number c, and how many there are."""
        lists = ti.Vector([0] * self.neighbourhood)
        found = 0
        for offset in range(self.neighbourhood):
            cell = self.index_of(c)
            skip = 0
            code = offset
            for axis in ti.static(range(self.dim)):
                step = code % 3 - 1
                code = code // 3
                # With two cells along a periodic axis both neighbours are the same cell, with one it is c itself.
                if (step != 0 and self.cells[axis] <= 1) or (step < 0 and self.cells[axis] == 2):
                    skip = 1
                cell[axis] = self.wrapped(cell[axis] + step, axis)
            if skip == 0:
                first = self.head[cell]
                if first > 0:
                    lists[found] = first
                    found += 1
        return lists, found

    def fill(self, position: Any, count: Any) -> None:
        """List all grains in their cells; position (n, dim) [m] and count () are Taichi fields."""
        user = _users.setdefault(self.dim, self)
        self.fills += 1
        # Deactivation clears cells that another grid wrote, or that grains left long ago.
        if user is not self or self.fills % RELEASE == 0:
            self.top.deactivate_all()
            self.occupied[None] = 0
            _users[self.dim] = self
        self.insert_grains(position, count)
