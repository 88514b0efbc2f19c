"""A table of all contacts at one instant: who touches whom, where, with what force, energy and loss."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..contact.pair_storage import ACTING, PART_BASE, SLIDING, TOUCHING
from ..core.allocation import read
from ..core.rotation import rotate
from ..core.runtime import ti
from ..core.schema import Variable
from ..effects.base import Effect
from .contact_patches import UNKNOWN, PatchTable

if TYPE_CHECKING:
    from ..scene import Scene
    from ..stepping.contact_forces import ContactForces


def _row(name: str, width: str, dtype: str, units: str, long_name: str) -> Variable:
    return Variable(name, ("contact", width) if width else ("contact",), dtype, units, long_name)


CONTACT_ROWS = (
    _row("first_id", "", "i32", "1", "persistent id of the first grain"),
    _row("second_id", "", "i32", "1", "persistent id of the second grain, or -1 minus the wall's number"),
    _row("first_part", "", "i32", "1", "convex part of the first grain, 0 if it has one"),
    _row("second_part", "", "i32", "1", "convex part of the second grain, 0 if it has one"),
    _row("first_patch", "", "i32", "1", "patch of the first grain's shape, -1 on an edge or if it is unknown"),
    _row("second_patch", "", "i32", "1", "patch of the second grain's shape, -1 on an edge or if it is unknown"),
    _row("sliding", "", "i8", "1", "true if the tangential force is at its frictional limit"),
    _row("bonded", "", "i8", "1", "true for an intact bond, whose grains exert no contact force"),
    _row("point", "space", "f64", "m", "middle of the overlap, beside the first grain's position"),
    _row("arm", "space", "f64", "m", "vector from the first centre to the point"),
    _row("normal", "space", "f64", "1", "unit normal from the first grain to the second"),
    _row("branch", "space", "f64", "m", "vector from the first centre to the second or to the wall"),
    _row("overlap", "", "f64", "m", "depth along the normal, less a rest overlap; negative across a gap"),
    _row("normal_force", "", "f64", "N", "normal force, positive in compression"),
    _row("elastic_normal_force", "", "f64", "N", "part of it from effects that store its work, cohesion too"),
    _row("dissipative_normal_force", "", "f64", "N", "the rest of it, as from dashpots"),
    _row("tangential_force", "space", "f64", "N", "tangential force on the second grain"),
    _row("elastic_energy", "", "f64", "J", "energy that the contact stores, in all its effects"),
    _row("dissipated_power", "", "f64", "W", "energy that all effects dissipated in the last step, over its time"),
)
FLAGS = {
    "sliding": {"flag_values": [0, 1], "flag_meanings": "sticking sliding"},
    "bonded": {"flag_values": [0, 1], "flag_meanings": "contact bond"},
}
# Columns of the integers and of the reals that `write` fills.
INTEGERS = ("first_id", "second_id", "first_part", "second_part", "first_feature", "second_feature", *FLAGS)
FIRST_ID, SECOND_ID, FIRST_PART, SECOND_PART, FIRST_FEATURE, SECOND_FEATURE, SLIDES, IS_BOND = range(len(INTEGERS))
VECTORS = ("point", "arm", "normal", "branch", "force")
SCALARS = ("overlap", "elastic_normal_force", "elastic_energy", "loss")
DEPTH, ELASTIC, ENERGY, LOSS = range(len(SCALARS))


def history_rows(effects: Sequence[Effect], dim: int) -> list[Variable]:
    """Schema rows of what contact effects remember, in the order in which a contact stores it.

    A name that two effects use is preceded by that of its effect in the second one.
    """
    rows: dict[str, Variable] = {}
    for effect in effects:
        for value in effect.history:
            name = f"history_{value.name}"
            name = f"history_{effect.name}_{value.name}" if name in rows else name
            rows[name] = _row(name, "space" if value.size(dim) > 1 else "", "f64", value.units, value.long_name)
    return list(rows.values())


@ti.data_oriented
class ContactTable:
    """Reads the contacts of a simulation without changing its state. Compiled when `rows` is first called.

    Attributes
    ----------
    variables
        Schema rows of what `rows` gives.
    """

    def __init__(self, forces: "ContactForces") -> None:
        self.forces, self.grains, self.pairs, self.dim = forces, forces.grains, forces.pairs, forces.dim
        self.spec, self.bonds, self.walls = forces.spec, forces.bonds, forces.walls
        self.history = history_rows(forces.contact_effects, self.dim)
        self.variables = [*CONTACT_ROWS, *self.history]
        self.stores = [e for e in forces.contact_effects if hasattr(type(e), "contact_energy")]
        # Their normal force is the gradient of the energy that they store: a function of the depth alone.
        self.elastic = [e for e in self.stores if e.phase in ("normal", "cohesion")]
        self.first_scalar = len(VECTORS) * self.dim
        self.first_value = self.first_scalar + len(SCALARS)

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

    def parted_power(self, scene: "Scene", dt: float) -> float:
        """Energy that contacts which ended in the last step dissipated in it, over its time [W]; see `rows`."""
        if not self.spec.keeps_losses:
            return 0.0 if scene.track_contacts else np.nan
        return float(self.grains.column("parted_loss").sum()) / dt

    def rows(self, scene: "Scene", dt: float) -> dict[str, np.ndarray]:
        """Every one of `variables` by name, sorted by first_id, second_id and parts.

        Each pair of grains appears once, under the lower of its two ids. Vectors are (contact, dim), world frame.
        Powers are not a number without `Scene.track_contacts`.

        Parameters
        ----------
        scene
            Of the simulation.
        dt
            Time of the last step [s].
        """
        total, d = self.count(), self.dim
        integers = np.zeros((max(total, 1), len(INTEGERS)), np.int32)  # Taichi takes no empty array
        reals = np.zeros((max(total, 1), self.first_value + self.spec.history))
        self.write(integers, reals)
        order = np.lexsort(integers[:total, [SECOND_PART, FIRST_PART, SECOND_ID, FIRST_ID]].T)
        integers, reals = integers[order], reals[order]
        raw: dict[str, np.ndarray] = dict(zip(INTEGERS, integers.T, strict=True))
        raw |= {name: reals[:, i * d : (i + 1) * d] for i, name in enumerate(VECTORS)}
        raw |= {name: reals[:, self.first_scalar + i] for i, name in enumerate(SCALARS)}
        raw |= self._forces(raw) | self._patches(raw, scene) | self._history(reals)
        raw["dissipated_power"] = raw["loss"] / dt if scene.track_contacts else np.full(total, np.nan)
        return {v.name: raw[v.name] for v in self.variables}

    def _forces(self, raw: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Normal force and its parts, and the tangential force; that of a bond is elastic."""
        normal = np.einsum("ij,ij->i", raw["force"], raw["normal"])
        elastic = np.where(raw["bonded"] == 1, normal, raw["elastic_normal_force"])
        return {
            "normal_force": normal,
            "elastic_normal_force": elastic,
            "dissipative_normal_force": normal - elastic,
            "tangential_force": raw["force"] - normal[:, None] * raw["normal"],
        }

    def _patches(self, raw: dict[str, np.ndarray], scene: "Scene") -> dict[str, np.ndarray]:
        """Patches of both grains; a wall has none."""
        patches = {}
        table = PatchTable(scene.shapes) if self.spec.remembers_features else None
        for side in ("first", "second"):
            feature = raw[f"{side}_feature"]
            patches[f"{side}_patch"] = feature
            if table:
                shape = scene.shape_index[np.maximum(raw[f"{side}_id"], 0)]
                patches[f"{side}_patch"] = table.of(shape, raw[f"{side}_part"], feature)
        return patches

    def _history(self, reals: np.ndarray) -> dict[str, np.ndarray]:
        """What the effects remember, by name."""
        found, begin = {}, self.first_value
        for variable in self.history:
            size = self.dim if len(variable.dims) > 1 else 1
            found[variable.name] = reals[:, begin : begin + size] if size > 1 else reals[:, begin]
            begin += size
        return found

    @ti.kernel
    def write(self, integers: ti.types.ndarray(), reals: ti.types.ndarray()):
        """One row of both arrays for every contact; columns in the order of INTEGERS, and VECTORS, SCALARS, history."""
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
        if ti.static(self.spec.kind != "cones"):  # of spheres 0, their one patch
            integers[row, FIRST_FEATURE], integers[row, SECOND_FEATURE] = features[0], features[1]
        integers[row, SLIDES] = ti.select(pairs.status[s] & SLIDING, 1, 0)
        self.write_vectors(row, g.position[k], arm_k, n, d, pairs.pair_force[s], reals)
        contact = self.forces.contact_of(k, l, s, depth, n, arm_k, arm_l, 0.0)
        if ti.static(self.spec.history > 0):
            history = pairs.history[s]
            self.write_stored(row, contact, history, depth, reals)
        else:
            self.write_stored(row, contact, 0, depth, reals)
        if ti.static(self.spec.keeps_losses):
            reals[row, self.first_scalar + LOSS] = pairs.pair_loss[s]

    @ti.func
    def write_wall(self, row, k, w, integers: ti.template(), reals: ti.template()):
        """The contact of grain k with wall w; its branch vector ends at the contact."""
        g, walls = self.grains, self.walls
        r = g.id[k] * walls.count + w
        contact, depth, arm, feature = walls.contact(self.forces, k, w, 0.0)
        self.write_integers(row, g.id[k], -1 - w, integers)
        if ti.static(self.spec.kind != "cones"):
            integers[row, FIRST_FEATURE] = feature
        integers[row, SLIDES] = ti.select(walls.row_status[r] & SLIDING, 1, 0)
        self.write_vectors(row, g.position[k], arm, contact.normal, arm, walls.row_force[r], reals)
        if ti.static(self.spec.history > 0):
            history = walls.row_history[r]
            self.write_stored(row, contact, history, depth, reals)
        else:
            self.write_stored(row, contact, 0, depth, reals)
        if ti.static(self.spec.keeps_losses):
            reals[row, self.first_scalar + LOSS] = walls.row_loss[r]

    @ti.func
    def write_bond(self, row, b, integers: ti.template(), reals: ti.template()):
        """The intact bond b: its normal lies along the branch vector; overlap and history are not defined."""
        g, bonds = self.grains, self.bonds
        k, l = g.slot_of[bonds.first_id[b]], g.slot_of[bonds.second_id[b]]
        d = bonds.domain.displacement(g.position[k], g.position[l])
        arm_k = rotate(g.orientation[k], bonds.anchor_first[b])
        self.write_integers(row, bonds.first_id[b], bonds.second_id[b], integers)
        integers[row, IS_BOND] = 1
        self.write_vectors(row, g.position[k], arm_k, d / d.norm(), d, bonds.force[b], reals)
        reals[row, self.first_scalar + DEPTH] = ti.math.nan
        reals[row, self.first_scalar + ENERGY] = bonds.energy(b)
        for c in range(self.spec.history):
            reals[row, self.first_value + c] = ti.math.nan

    @ti.func
    def write_integers(self, row, first_id, second_id, integers: ti.template()):
        """Ids of both grains; everything else is zero, and features are unknown, until it is written."""
        for c in ti.static(range(len(INTEGERS))):
            integers[row, c] = 0
        integers[row, FIRST_ID], integers[row, SECOND_ID] = first_id, second_id
        integers[row, FIRST_FEATURE], integers[row, SECOND_FEATURE] = UNKNOWN, UNKNOWN

    @ti.func
    def write_vectors(self, row, centre, arm, normal, branch, force, reals: ti.template()):
        """Point (the first grain's centre plus its arm), arm, normal, branch vector and force, in f64."""
        for axis in ti.static(range(self.dim)):
            reals[row, axis] = centre[axis] + arm[axis]
            reals[row, self.dim + axis] = arm[axis]
            reals[row, 2 * self.dim + axis] = normal[axis]
            reals[row, 3 * self.dim + axis] = branch[axis]
            reals[row, 4 * self.dim + axis] = force[axis]

    @ti.func
    def write_stored(self, row, contact: ti.template(), history: ti.template(), depth, reals: ti.template()):
        """Overlap, energy that the contact stores, elastic part of its normal force, and its history."""
        energy = ti.cast(0.0, ti.f64)
        for effect in ti.static(self.stores):
            if ti.static(effect.history_size(self.dim) > 0):
                energy += effect.contact_energy(contact, self.memory_of(effect, history))
            else:
                energy += effect.contact_energy(contact, 0)
        for effect in ti.static(self.elastic):
            if ti.static(effect.history_size(self.dim) > 0):
                memory = self.memory_of(effect, history)
                effect.on_contact(contact, memory)
            else:
                effect.on_contact(contact, 0)
        reals[row, self.first_scalar + DEPTH] = depth
        reals[row, self.first_scalar + ENERGY] = energy
        reals[row, self.first_scalar + ELASTIC] = contact.normal_force
        for c in ti.static(range(self.spec.history)):
            reals[row, self.first_value + c] = history[c]

    @ti.func
    def memory_of(self, effect: ti.template(), history: ti.template()):
        """The effect's own values of a contact's history."""
        begin, size = ti.static(self.forces.history_slice(effect))
        return ti.Vector([history[begin + c] for c in range(size)])
