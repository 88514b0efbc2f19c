"""A table of all contacts at one instant: who touches whom, where, and with what force."""

from typing import TYPE_CHECKING

import numpy as np

from ..contact.pair_storage import ACTING, PART_BASE, SLIDING, TOUCHING
from ..core.allocation import read
from ..core.rotation import rotate
from ..core.runtime import ti
from ..core.schema import Variable

if TYPE_CHECKING:
    from ..stepping.contact_forces import ContactForces

CONTACT_ROWS = (
    Variable("first_id", ("contact",), "i32", "1", "persistent id of the first grain"),
    Variable("second_id", ("contact",), "i32", "1", "persistent id of the second grain, or -1 minus the wall's number"),
    Variable("first_part", ("contact",), "i32", "1", "convex part of the first grain, 0 if it has one"),
    Variable("second_part", ("contact",), "i32", "1", "convex part of the second grain, 0 if it has one"),
    Variable("sliding", ("contact",), "i32", "1", "true if the tangential force is at its frictional limit"),
    Variable("bonded", ("contact",), "i32", "1", "true for an intact bond, whose grains exert no contact force"),
    Variable("point", ("contact", "space"), "f64", "m", "middle of the overlap, beside the first grain's position"),
    Variable("normal", ("contact", "space"), "f64", "1", "unit normal from the first grain to the second"),
    Variable("branch", ("contact", "space"), "f64", "m", "vector from the first centre to the second or to the wall"),
    Variable("force", ("contact", "space"), "f64", "N", "force on the second grain"),
    Variable("overlap", ("contact",), "f64", "m", "depth of overlap along the normal, negative across a gap"),
)
INTEGERS = [v.name for v in CONTACT_ROWS if v.dtype == "i32"]
REALS = [v.name for v in CONTACT_ROWS if v.dtype == "f64"]
FIRST_ID, SECOND_ID, FIRST_PART, SECOND_PART, SLIDES, IS_BOND = (  # columns of the integers that `write` fills
    INTEGERS.index(name) for name in ("first_id", "second_id", "first_part", "second_part", "sliding", "bonded")
)


@ti.data_oriented
class ContactTable:
    """Reads the contacts of a simulation without changing its state. Compiled when `rows` is first called."""

    def __init__(self, forces: "ContactForces") -> None:
        self.forces, self.grains, self.pairs, self.dim = forces, forces.grains, forces.pairs, forces.dim
        self.spec, self.bonds, self.walls = forces.spec, forces.bonds, forces.walls

    def count(self) -> int:
        """Number of rows: contacts of grains with grains and with walls, and intact bonds."""
        n, acting = len(self.grains), TOUCHING | ACTING
        listed = int(read(self.pairs.row_start, n + 1)[n])
        total = np.count_nonzero(read(self.pairs.status, listed) & acting)
        if self.spec.walls > 0:
            total += np.count_nonzero(read(self.walls.row_status, n * self.walls.count) & acting)
        if self.spec.bonds > 0:
            total += np.count_nonzero(read(self.bonds.intact))
        return int(total)

    def rows(self) -> dict[str, np.ndarray]:
        """Every variable of `CONTACT_ROWS` by name, sorted by first_id, second_id and parts.

        Each pair of grains appears once, under the lower of its two ids. Vectors are (contact, dim), world frame.
        """
        total = self.count()
        integers = np.zeros((max(total, 1), len(INTEGERS)), np.int32)  # Taichi takes no empty array
        reals = np.zeros((max(total, 1), 4 * self.dim + 1))
        self.write(integers, reals)
        columns: dict[str, np.ndarray] = dict(zip(INTEGERS, integers[:total].T, strict=True))
        columns |= {name: reals[:total, i * self.dim : (i + 1) * self.dim] for i, name in enumerate(REALS[:4])}
        columns["overlap"] = reals[:total, -1]
        order = np.lexsort([columns[name] for name in ("second_part", "first_part", "second_id", "first_id")])
        return {name: values[order] for name, values in columns.items()}

    @ti.kernel
    def write(self, integers: ti.types.ndarray(), reals: ti.types.ndarray()):
        """One row of both arrays for every contact; columns in the order of INTEGERS and REALS."""
        g, pairs = self.grains, self.pairs
        ti.loop_config(serialize=True)
        for _ in range(1):
            row = 0
            for k in range(g.count[None]):
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.status[s] & (TOUCHING | ACTING):
                        self.write_pair(row, k, s, integers, reals)
                        row += 1
                if ti.static(self.spec.walls > 0):
                    for w in range(self.walls.count):
                        if self.walls.row_status[g.id[k] * self.walls.count + w] & (TOUCHING | ACTING):
                            self.write_wall(row, k, w, integers, reals)
                            row += 1
            if ti.static(self.spec.bonds > 0):
                for b in range(self.bonds.count):
                    if self.bonds.intact[b] == 1:
                        self.write_bond(row, b, integers, reals)
                        row += 1

    @ti.func
    def write_pair(self, row, k, s, integers: ti.template(), reals: ti.template()):
        """The contact of list slot s in the row of grain k."""
        g, pairs = self.grains, self.pairs
        l = pairs.second_slot[s]
        d = self.forces.geometry.shortest(k, l)
        features, last_normal = self.forces.geometry.remembered(s)
        depth, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, d, 0)
        if ti.static(self.spec.remembers_features):  # a second search from its own result would change the last bits
            pairs.feature[s] = features
        if ti.static(self.spec.remembers_normal):
            pairs.normal[s] = last_normal
        code = pairs.code(s)
        self.write_integers(row, g.id[k], g.id[l], integers)
        integers[row, FIRST_PART], integers[row, SECOND_PART] = code // PART_BASE, code % PART_BASE
        integers[row, SLIDES] = ti.select(pairs.status[s] & SLIDING, 1, 0)
        self.write_reals(row, g.position[k], arm_k, n, d, pairs.pair_force[s], depth, reals)

    @ti.func
    def write_wall(self, row, k, w, integers: ti.template(), reals: ti.template()):
        """The contact of grain k with wall w; its branch vector ends at the contact."""
        g, walls = self.grains, self.walls
        r = g.id[k] * walls.count + w
        contact, depth, arm, feature = walls.contact(self.forces, k, w, 0.0)
        self.write_integers(row, g.id[k], -1 - w, integers)
        integers[row, SLIDES] = ti.select(walls.row_status[r] & SLIDING, 1, 0)
        self.write_reals(row, g.position[k], arm, contact.normal, arm, walls.row_force[r], depth, reals)

    @ti.func
    def write_bond(self, row, b, integers: ti.template(), reals: ti.template()):
        """The intact bond b: its normal lies along the branch vector, its overlap is not defined."""
        g, bonds = self.grains, self.bonds
        k, l = g.slot_of[bonds.first_id[b]], g.slot_of[bonds.second_id[b]]
        d = bonds.domain.displacement(g.position[k], g.position[l])
        arm_k = rotate(g.orientation[k], bonds.anchor_first[b])
        self.write_integers(row, bonds.first_id[b], bonds.second_id[b], integers)
        integers[row, IS_BOND] = 1
        self.write_reals(row, g.position[k], arm_k, d / d.norm(), d, bonds.force[b], ti.math.nan, reals)

    @ti.func
    def write_integers(self, row, first_id, second_id, integers: ti.template()):
        """Ids of both grains; everything else is zero until it is written."""
        for c in ti.static(range(len(INTEGERS))):
            integers[row, c] = 0
        integers[row, FIRST_ID], integers[row, SECOND_ID] = first_id, second_id

    @ti.func
    def write_reals(self, row, centre, arm, normal, branch, force, depth, reals: ti.template()):
        """Point (the first grain's centre plus its arm), normal, branch vector, force and overlap, in f64."""
        for axis in ti.static(range(self.dim)):
            reals[row, axis] = centre[axis] + arm[axis]
            reals[row, self.dim + axis] = normal[axis]
            reals[row, 2 * self.dim + axis] = branch[axis]
            reals[row, 3 * self.dim + axis] = force[axis]
        reals[row, 4 * self.dim] = depth
