"""Search for the pairs of grains that are near each other, with a sparse grid of cells."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import read, when_allocated, write
from ..core.errors import SimulationError
from ..core.runtime import current, ti
from .cell_grid import SparseGrid
from .pair_storage import PART_BASE

FAR = 1e300  # [m]: a coordinate beyond it counts as not a number
SORT_INTERVAL = 20  # rebuilds between two sorts of the grains along the cells
SORT_LEAST = 4000  # grains; fewer fit into the cache in any order
BUFFER = 12  # partners of a grain that are stored while they are counted; longer rows are searched twice
LOST, CRUSHED, JUMPING = 0, 1, 2  # reports of a search, rows of `error_id`


@ti.data_oriented
class NeighbourSearch:
    """Finds the pairs nearer than the sum of their bounding radii plus the skin.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    grains
        State of the grains.
    domain : Domain
        The cell.
    skin : float
        Skin [m]; it includes the reach of the effects.
    parts : PartTable or None
        Parts of the grains if any has more than one.
    bonds : Bonds or None
        Bonds; grains that an intact bond joins do not touch.
    """

    def __init__(self, spec: Any, grains: Any, domain: Any, skin: float, parts: Any = None, bonds: Any = None) -> None:
        self.spec = spec
        self.grains = grains
        self.domain = domain
        self.parts, self.bonds = parts, bonds
        self.real, self.serial = current().real, current().serial
        self.dim = grains.dim
        self.skin = ti.field(ti.f64, ())
        self.width = self.cell_width = 0.0  # the same on the host, and the least width of a cell of the grid [m]
        self.grid = SparseGrid(domain, grains.slot_of.shape[0])
        self.row_count = ti.field(ti.i32, grains.slot_of.shape[0] + 1)
        self.found = ti.field(ti.i32, grains.slot_of.shape[0] * BUFFER)  # partners of each grain, not sorted
        self.found_count = ti.field(ti.i32, grains.slot_of.shape[0]) if spec.multi_part else self.row_count
        # 1 + id, 0 if there is none: of a grain whose position is no number, of one on a platen that touches the other
        # platen, and of one that moves too far in a step.
        self.error_id = ti.field(ti.i32, 3)
        self.fastest = ti.field(ti.f64, ())
        # Half the least width of the grain of each id [m], where it is not the radius.
        self.half_width = ti.field(self.real, grains.slot_of.shape[0]) if spec.shaped else None
        self.searches = 0
        when_allocated(lambda: self.set_skin(skin))

    def set_half_widths(self, values: NDArray) -> None:
        """Set half the least width of every shaped grain, by id (n,) [m]."""
        write(self.half_width, values)

    @ti.func
    def half_width_of(self, k):
        """Half the least width of grain k [m]: what another grain must not jump over in a step."""
        length = self.grains.radius[k]
        if ti.static(self.spec.shaped):
            length = self.half_width[self.grains.id[k]]
        return length

    def set_skin(self, skin: float) -> None:
        """Set the skin [m], and cells as wide as it and the largest grain need; the radii must be known."""
        self.width = float(skin)
        write(self.skin, skin)
        self.cell_width = 2.0 * float(self.grains.column("radius").max()) + skin
        self.grid.set_width(self.cell_width)

    @ti.func
    def listed(self, k, l):
        """1 if the pair belongs in the row of grain k, else 0, without a branch that depends on a distance.

        Rows hold partners of higher id. Grains glued to platens do not touch each other, nor do bonded ones; two glued
        to different platens that overlap are reported.
        """
        g = self.grains
        d = self.domain.displacement(g.position[k], g.position[l])
        reach = ti.cast(g.radius[k] + g.radius[l], ti.f64)
        near = ti.cast(d.dot(d) < (reach + self.skin[None]) ** 2, ti.i32) & ti.cast(g.id[l] > g.id[k], ti.i32)
        # Corrections after the fact, for the few pairs that are near: glued grains, bonded grains.
        if g.platen_index[k] >= 0:
            if near == 1 and g.platen_index[l] >= 0:
                near = 0
                if g.platen_index[k] != g.platen_index[l] and d.dot(d) < reach * reach:
                    self.error_id[CRUSHED] = g.id[k] + 1
        if ti.static(self.spec.bonds > 0):
            if near == 1:
                near -= self.bonds.joined(g.id[k], g.id[l])
        return near

    @ti.func
    def find_partners(self, k, lists, number):
        """Store the partners of grain k in `found`, at most BUFFER of them; returns how many there are.

        lists: slot + 1 of the first grain of each of the `number` occupied cells in and around its own. Every candidate
        is written and the place is kept by counting on, as a branch on the distance would often be mispredicted.
        """
        count = 0
        for i in range(number):
            l = lists[i]
            while l > 0:
                self.found[k * BUFFER + ti.min(count, BUFFER - 1)] = l - 1
                count += self.listed(k, l - 1)
                l = self.grid.next[l - 1]
        return count

    @ti.func
    def count_or_write(self, k, s, p: ti.template(), fill: ti.template()):
        """Count the pairs in the row of grain k or, if `fill`, write them from list slot s of p on, sorted by id."""
        pairs = 0
        if self.found_count[k] < BUFFER:  # the last place is overwritten by grains that are not near
            for i in range(self.found_count[k]):
                pairs += self.add(k, self.found[k * BUFFER + i], s, pairs, p, fill)
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
        """Number of pairs that grain l adds to the row of grain k, which begins at s and holds `found` pairs.

        One, or one for each pair of parts whose bounding balls are near; if `fill`, they are written.
        """
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
        """True if part a of grain k and part b of grain l belong on the list."""
        g = self.grains
        d = ti.cast(self.domain.displacement(g.position[k], g.position[l]), self.real)
        return self.parts.gap(k, l, a, b, d) < ti.cast(self.skin[None], self.real)

    @ti.func
    def insert(self, s, found, k, l, code, p: ti.template()):
        """Put grain l into the row that begins at slot s and holds `found` pairs, in the order of ids and parts."""
        g = self.grains
        # Insertion sort: a row holds few pairs.
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
    def count_partners(self, jump: ti.f64) -> ti.types.vector(5, ti.f64):
        """Count the pairs to be listed, and watch the grains.

        jump [s]: a grain that moves by more than half its width in it is reported. Returns the number of pairs, the ids
        of a lost, a crushed and a jumping grain, -1 if there is none, and the greatest speed [m s-1].
        """
        for i in ti.static(range(3)):
            self.error_id[i] = 0
        self.fastest[None] = 0.0
        # In parallel over the occupied cells: all grains of a cell share the list of its surroundings.
        ti.loop_config(serialize=self.serial)
        for c in range(self.grid.occupied[None]):
            lists, number = self.grid.around(c)
            k = self.grid.head[self.grid.index_of(c)] - 1
            while k >= 0:
                self.check_motion(k, jump)
                self.found_count[k] = self.find_partners(k, lists, number)
                if ti.static(self.spec.multi_part):
                    self.row_count[k] = self.count_or_write(k, 0, 0, False)
                k = self.grid.next[k] - 1
        total = 0
        ti.loop_config(serialize=True)
        for k in range(self.grains.count[None]):
            total += self.row_count[k]
        lost, crushed, jumping = self.error_id[LOST] - 1, self.error_id[CRUSHED] - 1, self.error_id[JUMPING] - 1
        return ti.Vector([total, lost, crushed, jumping, self.fastest[None]], ti.f64)

    @ti.func
    def check_motion(self, k, jump):
        """Report grain k if its position is no number or it moves too far in a step; update the greatest speed."""
        g = self.grains
        if not ti.abs(g.position[k]).sum() < FAR:
            self.error_id[LOST] = g.id[k] + 1
        # Velocities relative to the mean flow, which moves neighbours along with the grain.
        v = g.velocity[k]
        if ti.static(self.spec.sheared):
            v[0] -= self.domain.shear_rate[0] * g.position[k][1]
        speed = v.norm()
        if g.platen_index[k] < 0 and speed * jump > self.half_width_of(k):
            self.error_id[JUMPING] = g.id[k] + 1
        # Greatest speed of a point of the grain: rotation moves parts, and with them their pairs.
        if ti.static(self.spec.multi_part):
            fastest = ti.abs(g.angular_velocity[k][0]) if ti.static(self.dim == 2) else g.angular_velocity[k].norm()
            speed += fastest * g.radius[k]
        ti.atomic_max(self.fastest[None], speed)

    def sort_grains(self) -> None:
        """Order the slots along a Z-shaped curve of the cells: neighbours in space become neighbours in memory."""
        g = self.grains
        x = read(g.position, len(g))
        inverse = read(self.grid.inverse_width)
        cell = np.floor(x * inverse).astype(np.int64)
        for axis in range(self.dim):
            if self.domain.periodic[axis]:
                cell[:, axis] %= self.grid.cells[axis]
        cell -= cell.min(axis=0)
        g.reorder(np.argsort(morton_code(cell), kind="stable"))

    def count(self, dt: float, guards: Any) -> int:
        """Search at the present positions.

        Parameters
        ----------
        dt
            Time step [s].
        guards : Guards
            Checks of a run, which say what is an error.

        Returns
        -------
        int
            Number of pairs to be listed.

        Raises
        ------
        SimulationError
            If a position is not a number, a grain moves too far in one step, the two platens touch, or the height of
            the cell is too low for its grains.

        Notes
        -----
        Two grains that separate must still be listed in the step in which they do so. A skin narrower than twice the
        distance that the two fastest grains could separate in a step is widened, and the search repeated.
        """
        if len(self.grains) >= SORT_LEAST and self.searches % SORT_INTERVAL == 0:
            self.sort_grains()
        self.searches += 1
        if self.spec.cell_servo:
            self.domain.check_height()
            self.grid.set_width(self.cell_width)
        self.grid.fill(self.grains.position, self.grains.count)
        found = self.count_partners(dt / guards.displacement if guards.displacement else 0.0)
        total, lost, crushed, jumping = (int(found[i]) for i in range(4))
        if lost >= 0 and guards.finite:
            raise SimulationError(f"grain {lost}: its position is not a number", grains=[lost])
        if crushed >= 0:
            text = f"grain {crushed} of one platen touches the other platen: no layer is left"
            raise SimulationError(text, grains=[crushed])
        if jumping >= 0:
            raise self.jump_error(jumping, dt, guards.displacement)
        separation = 2.0 * (found[4] + self.domain.flow_over(self.width)) * dt
        if separation > self.width and np.isfinite(separation):
            self.set_skin(2.0 * separation)
            return self.count(dt, guards)
        return total

    def jump_error(self, k: int, dt: float, limit: float) -> SimulationError:
        """Error that says that the grain of id k moves by more than `limit` of half its width in a step of dt."""
        g = self.grains
        v = g.column("velocity")[k] - self.domain.mean_flow(g.column("position"))[k]
        half_width = g.column("radius")[k] if self.half_width is None else read(self.half_width)[k]
        displacement = float(np.linalg.norm(v) * dt / half_width)
        return SimulationError(
            f"grain {k} moves by {displacement:.3g} of half its least width in one step, allowed is {limit:g}; "
            f"use dt <= {limit / displacement * dt:g} s, or softer impacts",
            grains=[k],
            values={"displacement": displacement, "limit": limit},
        )


def morton_code(cell: NDArray) -> NDArray:
    """Codes (n,) of cells along a Z-shaped curve.

    Parameters
    ----------
    cell
        Indices of cells (n, dim), integers >= 0.

    Returns
    -------
    array (n,)
        The interleaved bits of the indices: cells with close codes are close in space.
    """
    dim = cell.shape[1]
    code = np.zeros(len(cell), np.uint64)
    for bit in range(63 // dim):
        for axis in range(dim):
            code |= ((cell[:, axis].astype(np.uint64) >> np.uint64(bit)) & np.uint64(1)) << np.uint64(bit * dim + axis)
    return code
