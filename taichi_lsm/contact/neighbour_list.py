"""The neighbour list: half of all pairs in rows, and its transpose."""

from typing import Any

from ..core.allocation import read, write
from ..core.runtime import ti
from .pair_storage import Pairs


@ti.data_oriented
class NeighbourList:
    """Writes the half list (each pair at its lower id) and its transpose into the storage of the pairs.

    Parameters
    ----------
    search : NeighbourSearch
        Counts and writes the rows.
    pairs : Pairs
        Storage of the pairs.

    Notes
    -----
    The order of the list depends on persistent ids only: neither threads nor slots nor the time of a rebuild can
    change the bits of a sum over contacts. Pairs that stay listed keep what they remember.
    """

    def __init__(self, search: Any, pairs: Pairs) -> None:
        self.search, self.pairs, self.grains = search, pairs, search.grains
        self.serial = search.serial

    @ti.kernel
    def write(self):
        """Write the list for the positions that the search has just counted."""
        g, p = self.grains, self.pairs
        n = g.count[None]
        # Save what the pairs remember and where the rows were; rows begin anew at the running sum of the counts.
        ti.loop_config(serialize=self.serial)
        for k in range(n):
            for s in range(p.row_start[k], p.row_start[k + 1]):
                p.save_slot(s)
        ti.loop_config(serialize=True)
        for k in range(n + 1):
            p.old_start[k] = p.row_start[k]
        ti.loop_config(serialize=True)
        for k in range(n):
            p.row_start[k + 1] = p.row_start[k] + self.search.row_count[k]
        # Write each row, then merge it with the old row of the same grain: both rise in the id of the second grain and
        # in the part, so that one pass finds the old slot of every pair that was listed before.
        ti.loop_config(serialize=self.serial)
        for k in range(n):
            begin = p.row_start[k]
            self.search.count_or_write(k, begin, p, True)
            g.built_position[k] = g.position[k]
            if ti.static(p.spec.sheared):
                self.search.domain.note_built()
            if ti.static(p.spec.multi_part):
                g.built_orientation[k] = g.orientation[k]
            old = g.previous_slot[k]
            o = p.old_start[old]
            end = p.old_start[old + 1]
            for s in range(begin, p.row_start[k + 1]):
                p.first_slot[s] = k
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
        # Forces and torques hold the stash until every row has been restored.
        ti.loop_config(serialize=self.serial)
        for k in range(n):
            for s in range(p.row_start[k], p.row_start[k + 1]):
                p.clear_forces(s)
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.transpose()

    @ti.kernel
    def transpose_only(self):
        """Write the transpose of rows that were loaded from a file."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.transpose()

    @ti.func
    def transpose(self):
        """Write the slots in which each grain is the second one: a counting sort of the slots."""
        g, p = self.grains, self.pairs
        n = g.count[None]
        for k in range(n + 1):
            p.cursor[k] = 0
        for s in range(p.row_start[n]):
            l = p.second_slot[s]
            p.cursor[l] = p.cursor[l] + 1
        # Columns begin at the running sum of the counts; from here on the cursor is the next free place of a column.
        for k in range(n):
            p.column_start[k + 1] = p.column_start[k] + p.cursor[k]
            p.cursor[k] = p.column_start[k]
        # Rows in rising id, so that each column rises in the id of the first grain.
        for i in range(n):
            k = g.slot_of[i]
            for s in range(p.row_start[k], p.row_start[k + 1]):
                l = p.second_slot[s]
                p.column[p.cursor[l]] = s
                p.cursor[l] = p.cursor[l] + 1


def grown(pairs: Pairs, capacity: int) -> Pairs:
    """Storage for more pairs.

    Parameters
    ----------
    pairs
        Storage that has become too small.
    capacity
        Pairs that the new one has room for.

    Returns
    -------
    Pairs
        New storage with the rows of `pairs`, so that a rebuild of the list carries over what the pairs remember.
    """
    larger = Pairs(pairs.spec, pairs.row_start.shape[0] - 1, capacity)
    for name in ["row_start"] + [v.name for v in pairs.variables]:
        write(getattr(larger, name), read(getattr(pairs, name)))
    return larger
