"""Sums over grains and contacts at one instant: energies, stress, coordination, in a fixed order.

Grains are summed in blocks of consecutive ids, blocks one after the other: the bits do not depend on threads.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..contact.pair_storage import ACTING, SLIDING, TOUCHING
from ..core.errors import InputError
from ..core.runtime import current, ti

if TYPE_CHECKING:
    from ..stepping.contact_forces import ContactForces
    from ..stepping.verlet import VelocityVerlet

BLOCK = 64
ROUNDING = 1e-12  # share of the cell's length by which low + length may round
EVERYWHERE = 1e300  # [m], a slab without bounds; infinity times a gradient of zero would be no number


@ti.data_oriented
class Measure:
    """One pass over the state. `sums()` returns {name: value}, SI, velocities synchronised with positions.

    translational_energy, rotational_energy [J] of mobile grains; energy_<effect> [J] stored and dissipated_<effect> [J]
    lost by each effect; contact_count (contacts with at least one mobile grain); contact_ends (contacts of mobile
    grains, twice for a pair of them); sliding_count; deepest (greatest depth over its overlap limit); bond_count
    (intact ones, in scenes with bonds);
    stress (dim, dim) [Pa], compression positive, over the slab low <= y < high and its periodic images, by branch
    vectors cut at the slab, which is the mean over the planes in it; and the kinetic part, of the fluctuations about
    the mean velocity of the slab's mass and the given profile. It is not a number where no volume is known; its product
    with the volume, stress_volume (dim, dim) [J], always is one.
    In a sheared cell velocities are relative to the mean flow, in translational_energy too, and shear_work [J] is what
    shearing has done: its change is -shear_rate sigma_xy V over the time.
    """

    def __init__(self, forces: "ContactForces", integrator: "VelocityVerlet", thickness: float = 1.0) -> None:
        self.thickness = thickness if forces.dim == 2 else 1.0  # [m], of a slab of 2D grains out of the plane
        self.forces, self.integrator, self.spec = forces, integrator, forces.spec
        self.grains, self.pairs, self.dim = forces.grains, forces.pairs, forces.dim
        self.stores = [e for e in forces.contact_effects if hasattr(type(e), "contact_energy")]
        self.pulls = [e for e in forces.body_effects if hasattr(type(e), "grain_energy")]
        self.names = ["translational_energy", "rotational_energy"]
        self.bonds = forces.bonds
        self.held = [forces.bonds.effect] if self.spec.bonds > 0 else []
        self.names += [f"energy_{e.name}" for e in self.stores + self.held + self.pulls]
        if forces.spec.tracks_dissipation:
            self.names += [f"dissipated_{e.name}" for e in forces.channels]
        self.names += ["shear_work"] if self.spec.sheared else []
        self.names += ["contact_count", "contact_ends", "sliding_count"] + (
            ["bond_count"] if self.spec.bonds > 0 else []
        )
        self.public = tuple(self.names)
        self.names += [f"stress_{a}{b}" for a in "xyz"[: self.dim] for b in "xyz"[: self.dim]]
        self.names += ["slab_mass"] + [f"slab_momentum_{a}" for a in "xyz"[: self.dim]]
        self.at = {name: i for i, name in enumerate(self.names)}
        self.width = len(self.names)
        blocks = -(-self.grains.slot_of.shape[0] // BLOCK)
        self.block_sum = ti.Vector.field(self.width, ti.f64, blocks)
        self.block_deepest = ti.field(ti.f64, blocks)
        self.serial = current().serial

    @ti.func
    def above(self, y, low):
        """Height [m] of y over the slab's lower border; in a cell periodic in y over that of the image below y."""
        height = y - low
        if ti.static(self.forces.domain.periodic[1]):
            length = self.forces.domain.length[1]
            height -= length * ti.floor(height / length)
        return height

    @ti.func
    def in_slab(self, y, low, high):
        """1 if y lies in the slab or one of its periodic images, else 0."""
        height, whole = self.above(y, low), 0
        if ti.static(self.forces.domain.periodic[1]):
            whole = high - low >= self.forces.domain.length[1]
        return whole or (height >= 0.0 and height < high - low)

    @ti.func
    def inside(self, y, reach, low, high):
        """Share of the segment from y to y + reach that lies in the slab or in its periodic images [-]."""
        bottom, top = ti.min(y, y + reach), ti.max(y, y + reach)
        share = ti.cast(self.in_slab(y, low, high), ti.f64)
        if top > bottom:
            share = ti.max(0.0, ti.min(top, high) - ti.max(bottom, low))
            if ti.static(self.forces.domain.periodic[1]):
                # From the image of the slab that begins below the segment to the next, which its upper end may reach.
                length, start, tall = self.forces.domain.length[1], self.above(bottom, low), high - low
                end = start + (top - bottom)
                share = ti.max(0.0, ti.min(end, tall) - start) + ti.max(0.0, ti.min(end - length, tall))
                share = ti.select(tall < length, share, top - bottom)
            share /= top - bottom
        return share

    @ti.func
    def add_grain(self, k, low, high, velocity, gradient, total: ti.template()):
        """Energies, kinetic stress and dissipation of grain k."""
        g = self.grains
        if g.platen_index[k] < 0:
            m = 1.0 / ti.cast(g.inverse_mass[k], ti.f64)
            v, omega = self.integrator.synchronised(k)
            if ti.static(self.spec.sheared):
                v[0] -= self.forces.domain.shear_rate[0] * g.position[k][1]
                total[ti.static(self.at["shear_work"])] += g.shear_work[k]
            total[0] += 0.5 * m * v.dot(v)
            if ti.static(self.spec.rotates):
                omega = self.integrator.principal(k, omega)
                for c in ti.static(range(g.sizes["rotation"])):
                    total[1] += 0.5 * omega[c] * omega[c] / g.inverse_inertia[k][c]
            for effect in ti.static(self.pulls):
                total[ti.static(self.at["energy_" + effect.name])] += effect.grain_energy(
                    g.inverse_mass[k], g.position[k]
                )
            # Kinetic stress: velocities relative to the profile; `sums` takes off what their mean carries.
            if self.in_slab(g.position[k][1], low, high):
                v[0] -= velocity
                if gradient != 0.0:  # the height has no bounds in a slab without any
                    v[0] -= gradient * self.above(g.position[k][1], low)
                total[ti.static(self.at["slab_mass"])] += m
                for a in ti.static(range(self.dim)):
                    total[ti.static(self.at["slab_mass"] + 1 + a)] += m * v[a]
                for a, b in ti.static(ti.ndrange(self.dim, self.dim)):
                    total[ti.static(self.at["stress_xx"] + a * self.dim + b)] += m * v[a] * v[b]
        if ti.static(self.spec.tracks_dissipation):
            for effect in ti.static(self.forces.channels):
                spent = g.dissipated[k][ti.static(self.forces.channel_of(effect))]
                total[ti.static(self.at["dissipated_" + effect.name])] += spent

    @ti.func
    def add_bond(self, b, low, high, total: ti.template()):
        """Energy and stress of bond b, if it is intact."""
        g, bonds = self.grains, self.bonds
        k, l = g.slot_of[bonds.first_id[b]], g.slot_of[bonds.second_id[b]]
        if bonds.intact[b] == 1:
            total[ti.static(self.at["bond_count"])] += 1.0
            total[ti.static(self.at["energy_" + bonds.effect.name])] += bonds.energy(b)
            d = bonds.domain.displacement(g.position[k], g.position[l])
            share = self.inside(g.position[k][1], d[1], low, high)
            for a, c in ti.static(ti.ndrange(self.dim, self.dim)):
                total[ti.static(self.at["stress_xx"] + a * self.dim + c)] += share * bonds.force[b][a] * d[c]

    @ti.func
    def add_contact(self, k, s, low, high, total: ti.template()):
        """Energy, counts and stress of the contact in list slot s; returns its overlap over the overlap limit."""
        g, pairs = self.grains, self.pairs
        l = pairs.second_slot[s]
        d = self.forces.geometry.shortest(k, l)
        depth, n, arm_k, arm_l = self.forces.geometry.overlap(k, l, s, d, 0)
        contact = self.forces.contact_of(k, l, s, depth, n, arm_k, arm_l, 0.0)
        for effect in ti.static(self.stores):
            if ti.static(effect.history_size(self.dim) > 0):
                memory = self.forces.history_of(effect, s)
                total[ti.static(self.at["energy_" + effect.name])] += effect.contact_energy(contact, memory)
            else:
                total[ti.static(self.at["energy_" + effect.name])] += effect.contact_energy(contact, 0)
        touching = ti.cast(contact.touching, ti.f64)
        mobile = ti.cast(g.platen_index[k] < 0, ti.f64) + ti.cast(g.platen_index[l] < 0, ti.f64)
        total[ti.static(self.at["contact_count"])] += touching
        total[ti.static(self.at["contact_ends"])] += touching * mobile
        total[ti.static(self.at["sliding_count"])] += ti.select(pairs.status[s] & SLIDING, 1.0, 0.0)
        # Stress: force times the share of the branch vector that lies in the slab.
        share = self.inside(g.position[k][1], d[1], low, high)
        for a, b in ti.static(ti.ndrange(self.dim, self.dim)):
            total[ti.static(self.at["stress_xx"] + a * self.dim + b)] += share * pairs.pair_force[s][a] * d[b]
        limit = g.radius[k] + g.radius[l]
        if ti.static(self.spec.shaped):
            limit = g.overlap_limit[k] + g.overlap_limit[l]
        if ti.static(self.spec.sheared):  # of the last step only half belongs to the time until now
            moment = 0.5 * self.integrator.dt[None] * pairs.pair_force[s][0] * d[1]
            total[ti.static(self.at["shear_work"])] += self.forces.domain.shear_rate[0] * moment
        return ti.cast(self.forces.geometry.whole_overlap(s, depth) / limit, ti.f64)

    @ti.func
    def add_walls(self, k, low, high, total: ti.template()):
        """Contacts of grain k with the walls; their branch vectors go from its centre to the contact.

        Returns the greatest depth over the bounding radius, beyond which its centre lies behind the wall.
        """
        g, walls = self.grains, self.forces.walls
        deepest = ti.cast(0.0, ti.f64)
        for w in range(walls.count):
            r = g.id[k] * walls.count + w
            if walls.row_status[r] & (TOUCHING | ACTING):
                contact, depth, arm, feature = walls.contact(self.forces, k, w, 0.0)
                for effect in ti.static(self.stores):
                    stored = 0.0 * depth
                    if ti.static(effect.history_size(self.dim) > 0):
                        stored = effect.contact_energy(contact, walls.history_of(self.forces, effect, r))
                    else:
                        stored = effect.contact_energy(contact, 0)
                    total[ti.static(self.at["energy_" + effect.name])] += stored
                total[ti.static(self.at["contact_count"])] += contact.touching
                total[ti.static(self.at["contact_ends"])] += contact.touching
                total[ti.static(self.at["sliding_count"])] += ti.select(walls.row_status[r] & SLIDING, 1.0, 0.0)
                share = self.inside(g.position[k][1], ti.cast(arm[1], ti.f64), low, high)
                for a, b in ti.static(ti.ndrange(self.dim, self.dim)):
                    total[ti.static(self.at["stress_xx"] + a * self.dim + b)] += share * walls.row_force[r][a] * arm[b]
                deepest = ti.max(deepest, depth / g.radius[k])
        return deepest

    @ti.kernel
    def reduce(self, low: ti.f64, high: ti.f64, velocity: ti.f64, gradient: ti.f64, result: ti.types.ndarray()):
        """Fill `result` with the sums in the order of `names`, then the greatest depth over its limit."""
        g, pairs = self.grains, self.pairs
        count = g.count[None]
        blocks = (count + BLOCK - 1) // BLOCK
        ti.loop_config(serialize=self.serial)
        for block in range(blocks):
            total = ti.Vector([ti.cast(0.0, ti.f64)] * self.width)
            deepest = ti.cast(0.0, ti.f64)
            for i in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
                k = g.slot_of[i]
                self.add_grain(k, low, high, velocity, gradient, total)
                if ti.static(self.spec.bonds > 0):
                    for b in range(self.bonds.first_bond[i], self.bonds.first_bond[i + 1]):
                        self.add_bond(b, low, high, total)
                for s in range(pairs.row_start[k], pairs.row_start[k + 1]):
                    if pairs.status[s] & (TOUCHING | ACTING):
                        deepest = ti.max(deepest, self.add_contact(k, s, low, high, total))
                if ti.static(self.spec.walls > 0):
                    deepest = ti.max(deepest, self.add_walls(k, low, high, total))
            self.block_sum[block] = total
            self.block_deepest[block] = deepest
        ti.loop_config(serialize=True)
        for c in range(self.width + 1):
            result[c] = 0.0
        ti.loop_config(serialize=True)
        for block in range(blocks):
            for c in ti.static(range(self.width)):
                result[c] += self.block_sum[block][c]
            result[self.width] = ti.max(result[self.width], self.block_deepest[block])

    def sums(
        self,
        low: float = -EVERYWHERE,
        high: float = EVERYWHERE,
        volume: float | None = None,
        velocity: float = 0.0,
        gradient: float = 0.0,
    ) -> dict[str, Any]:
        """Measure now; see the class docstring.

        Parameters
        ----------
        low, high
            Borders [m] of the slab low <= y < high over which the stress is taken; default: everything.
        volume
            Volume [m3] of the slab. Default: that between its borders in the cell; unknown along an open axis.
        velocity, gradient
            Profile of the mean velocity along x in the slab: velocity + gradient (y - low) [m s-1, s-1].

        Raises
        ------
        InputError
            For a slab without height or higher than a cell that is periodic in y, or a volume that is not positive.

        Notes
        -----
        V sigma = sum over contacts of F (x) branch + sum over grains of m w (x) w - P (x) P/M, with w the velocity
        relative to the profile, P the sum of m w and M that of m: a motion of all grains together is no stress.
        """
        self._check(low, high, volume)
        values = np.zeros(self.width + 1)
        self.reduce(low, high, velocity, gradient, values)
        result = {name: float(values[self.at[name]]) for name in self.public}
        first, after = self.at["stress_xx"], self.at["slab_mass"]
        stress_volume = values[first:after].reshape(self.dim, self.dim)
        mass, momentum = values[after], values[after + 1 : -1]
        if mass > 0.0:
            stress_volume = stress_volume - np.outer(momentum, momentum) / mass
        result["stress_volume"] = stress_volume
        result["stress"] = stress_volume / (self.volume(low, high) if volume is None else volume)
        result["deepest"] = float(values[-1])
        result["elastic_energy"] = sum(result[f"energy_{e.name}"] for e in self.stores + self.held)
        result["potential_energy"] = sum(result[f"energy_{e.name}"] for e in self.pulls)
        return result

    def volume(self, low: float = -EVERYWHERE, high: float = EVERYWHERE) -> float:
        """Volume [m3] of the cell between `low` and `high` [m]; not a number along an open axis."""
        domain = self.forces.domain
        lengths = np.where(domain.periodic, domain.lengths, np.nan)
        if low > -EVERYWHERE and high < EVERYWHERE:
            lengths[1] = high - low
        return float(np.prod(lengths)) * self.thickness

    def _check(self, low: float, high: float, volume: float | None) -> None:
        """Refuse a slab or a volume that gives no stress."""
        if not low < high:
            raise InputError(f"Measure.sums: high {high:g} m, must be > low, {low:g} m")
        if volume is not None and not volume > 0.0:
            raise InputError(f"Measure.sums: volume {volume:g} m3, must be > 0, or none for that of the cell")
        length, everything = float(self.forces.domain.lengths[1]), low == -EVERYWHERE and high == EVERYWHERE
        if self.forces.domain.periodic[1] and not everything and high - low > length * (1.0 + ROUNDING):
            raise InputError(
                f"Measure.sums: high {high:g} m, must be <= {low + length:g} m: the cell is periodic in y with a "
                f"length of {length:g} m, and a higher slab would count grains twice; leave low and high out for all"
            )
