"""Watches a running simulation and stops it when a limit of its `Guards` is passed.

Nothing is added to a step. A grain that moves by more than half the skin in one step asks for a new neighbour list,
so that its speed is checked there; contacts, numbers and energies are checked once in many steps.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ..contact.error_flags import OVERLAP, WALL
from ..contact.neighbour_search import FAR
from ..contact.pair_storage import ACTING, TOUCHING
from ..core.errors import SimulationError
from ..core.runtime import ti
from ..measure.energy_budget import Energies, energies

CHECK_STEPS = 1000  # between two checks of contacts and speeds
BALANCE_STEPS = 5000  # between two sums of the energies
NO_PLATEN = -2  # no platen that bounds the grains; -1 marks mobile grains


@ti.data_oriented
class Monitor:
    """Checks a simulation against `scene.guards`; raises SimulationError with the step, the grains and the values."""

    def __init__(self, sim, former=None):
        """former: the monitor of `sim` with smaller storage, whose memory goes on."""
        self.sim, self.grains, self.domain, self.search = sim, sim.grains, sim.domain, sim.search
        self.spec = sim.spec
        # Contacts of each grain, counted anew at every check.
        self.contacts = former.contacts if former else ti.field(ti.i32, sim.grains.slot_of.shape[0])
        self.pairs, self.walls = sim.pairs, sim.walls
        self.next_check = self.next_sum = self.check_steps = CHECK_STEPS
        self.bodies = self.first_energies = None
        self.highest = 0.0
        self.bottom, self.top = platens_around(sim.scene)
        if former:
            self.next_check, self.check_steps, self.next_sum = former.next_check, former.check_steps, former.next_sum
            self.bodies, self.highest = former.bodies, former.highest
            self.first_energies = former.first_energies

    def begin(self) -> None:
        """Start again: a run begins. A time step beyond that of a dense packing is checked after every launch."""
        self.next_check, self.check_steps = self.sim.step + CHECK_STEPS, CHECK_STEPS
        self.bodies = None
        self.forget()
        guards, scene = self.sim.scene.guards, self.sim.scene
        if guards.step and scene.dt and not scene.dt <= guards.step * scene.step_bound(scene.bodies()):
            self.check_steps = 1
            self.next_check = self.sim.step
            self._check_grains()

    def forget(self) -> None:
        """The energies have been changed from outside: take their balance anew at the next sum."""
        self.first_energies, self.highest, self.next_sum = None, 0.0, self.sim.step + BALANCE_STEPS

    def memory(self) -> dict[str, Any]:
        """What the guards know of the run so far, in plain numbers: when they check next, and the energies."""
        first = self.first_energies
        return {
            "next_check": self.next_check,
            "check_steps": self.check_steps,
            "next_sum": self.next_sum,
            "highest": self.highest,
            "first_energies": None if first is None else list(first),
        }

    def recall(
        self, next_check: int, check_steps: int, next_sum: int, highest: float, first_energies: list[float] | None
    ) -> None:
        """Go on with the `memory` of the run that the state was restored from."""
        self.next_check, self.check_steps, self.next_sum, self.highest = next_check, check_steps, next_sum, highest
        self.first_energies = None if first_energies is None else Energies(*first_energies)

    @ti.kernel
    def reduce(self, result: ti.types.ndarray()):
        """Fill `result` with the extremes that the guards compare.

        They are: the greatest sum of contacts/m over the two grains of a contact [kg-1] and their ids; the greatest
        speed over half the least width [s-1] and its id; the id of a grain whose state is not a number, or -1; the id
        of a grain that lies wholly beyond the centres of the platens `bottom` and `top`, or -1.
        """
        g, p = self.grains, self.pairs
        n = g.count[None]
        stiffest, first, second = ti.cast(0.0, ti.f64), 0, 0
        fastest, fast, lost, outside = ti.cast(0.0, ti.f64), 0, -1, -1
        lowest, highest = ti.cast(-FAR, ti.f64), ti.cast(FAR, ti.f64)
        ti.loop_config(serialize=True)
        for _ in range(1):
            # Contacts of each grain, with walls and with grains.
            for k in range(n):
                self.contacts[k] = 0
                if ti.static(self.spec.walls > 0):
                    for r in range(g.id[k] * self.walls.count, (g.id[k] + 1) * self.walls.count):
                        self.contacts[k] = self.contacts[k] + ti.cast(self.walls.row_status[r] != 0, ti.i32)
            for s in range(p.row_start[n]):
                if p.status[s] & (TOUCHING | ACTING):
                    self.contacts[p.first_slot[s]] = self.contacts[p.first_slot[s]] + 1
                    self.contacts[p.second_slot[s]] = self.contacts[p.second_slot[s]] + 1
            # The pair that bounds the time step most: of the light grains that have many contacts.
            for s in range(p.row_start[n]):
                if p.status[s] & (TOUCHING | ACTING):
                    k, l = p.first_slot[s], p.second_slot[s]
                    sum_k, sum_l = self.per_mass(k), self.per_mass(l)
                    if sum_k + sum_l > stiffest:
                        stiffest, first, second = sum_k + sum_l, g.id[k], g.id[l]
            for k in range(n):
                if self.per_mass(k) > stiffest:  # on walls alone
                    stiffest, first, second = self.per_mass(k), g.id[k], g.id[k]
                # States that are not numbers, and the fastest mobile grain against the mean flow.
                v, x = g.velocity[k], g.position[k]
                size = ti.abs(x).sum() + ti.abs(v).sum()
                if ti.static(self.spec.oriented):
                    size += ti.abs(g.orientation[k]).sum()
                if not size < FAR:
                    lost = g.id[k]
                if ti.static(self.spec.sheared):
                    v[0] -= self.domain.shear_rate[0] * x[1]
                half_width = self.search.half_width_of(k)
                if g.platen_index[k] < 0 and v.norm() > fastest * half_width:
                    fastest, fast = v.norm() / half_width, g.id[k]
            if ti.static(self.bottom != NO_PLATEN):
                lowest = self.extreme_height(ti.static(self.bottom), -1.0)
            if ti.static(self.top != NO_PLATEN):
                highest = self.extreme_height(ti.static(self.top), 1.0)
            for k in range(n):
                reach = ti.cast(g.radius[k], ti.f64)
                if g.platen_index[k] < 0 and not lowest - reach <= g.position[k][1] <= highest + reach:
                    outside = g.id[k]
            result[0], result[1], result[2] = stiffest, first, second
            result[3], result[4], result[5], result[6] = fastest, fast, lost, outside

    @ti.func
    def extreme_height(self, platen, sign):
        """Height [m] of the highest (sign 1) or the lowest (-1) centre of the grains glued to a platen."""
        g, most = self.grains, ti.cast(-FAR, ti.f64)
        for k in range(g.count[None]):
            if g.platen_index[k] == platen:
                most = ti.max(most, sign * g.position[k][1])
        return sign * most

    @ti.func
    def per_mass(self, k):
        """Contacts of grain k over its mass [kg-1]; 0 for a glued one, which its contacts do not move."""
        g = self.grains
        return ti.select(g.platen_index[k] < 0, self.contacts[k] * ti.cast(g.inverse_mass[k], ti.f64), 0.0)

    def check(self) -> None:
        """Make the checks that are due."""
        step = self.sim.step
        if step >= self.next_check:
            self.next_check = step + self.check_steps
            self._check_grains()
        if step >= self.next_sum:
            self.next_sum = step + BALANCE_STEPS
            self._check_energy()

    def check_all(self) -> None:
        """Check everything now; later checks are those that they would have been without this one."""
        memory = self.memory()
        self._check_grains()
        self._check_energy()
        self.recall(**memory)

    def _check_grains(self):
        sim, guards = self.sim, self.sim.scene.guards
        result = np.zeros(7)
        self.reduce(result)
        stiffest, k, l, fastest, fast, lost, outside = result
        if guards.finite and lost >= 0:
            self._stop(f"grain {lost:.0f}: its position, velocity or orientation is not a number", [lost], {})
        if guards.platen and outside >= 0:
            self._stop(
                f"grain {outside:.0f}: it went beyond the platens; use stiffer grains, less stress, or platens "
                "without gaps as wide as a grain",
                [outside],
                {},
            )
        if guards.displacement and fastest * sim.dt > guards.displacement:
            error = sim.search.jump_error(int(fast), sim.dt, guards.displacement)
            self._stop(str(error), error.grains, error.values)
        if guards.step and stiffest > 0.0:
            self.bodies = self.bodies or sim.scene.bodies()
            coordination = 0.5 * stiffest * self.bodies.least_mass
            stable = sim.scene.step_bound(replace(self.bodies, coordination=coordination))
            if sim.dt > guards.step * stable:
                self._stop(
                    f"the time step {sim.dt:g} s is {sim.dt / stable:.3g} of the stable one for the contacts of grains "
                    f"{k:.0f} and {l:.0f}; use dt <= {guards.step * stable:g} s",
                    [k, l],
                    {"dt": sim.dt, "stable_dt": stable},
                )

    def _check_energy(self):
        sim, limit = self.sim, self.sim.scene.guards.energy
        pushes = any(not hasattr(type(e), "grain_energy") for e in sim.forces.body_effects)
        if not limit or pushes:  # by forces without an energy, whose work is not accounted for
            return
        # What was turned over: the highest energy stored so far, changes of potential, work and dissipation.
        now = energies(sim)
        self.first_energies = first = self.first_energies or now
        self.highest = max(self.highest, now.kinetic + abs(now.elastic))
        turnover = self.highest + abs(now.potential - first.potential) + abs(now.work - first.work)
        turnover += max(0.0, now.dissipated - first.dissipated)
        error = now.balance - first.balance
        untracked = not sim.scene.track_dissipation and any(e.dissipates for e in sim.scene.effects)
        if not (error if untracked else abs(error)) <= limit * turnover:
            self._stop(
                f"the energy balance is lost by {error:g} J, {abs(error) / turnover:.3g} of the {turnover:g} J "
                f"that were exchanged, the limit is {limit:g}; use a smaller time step",
                [],
                {"energy_error": error, "energy_turned_over": turnover},
            )

    def check_error_flags(self, reported: int) -> None:
        """Stop at the error of the code that a launch reported, if it is not 0, unless its guard is off."""
        found = self.sim.error_flags.pop() if reported else None
        if found is None:
            return
        code, k, l = found
        sim, guards = self.sim, self.sim.scene.guards
        x = sim.state.position.to_numpy()
        if code == OVERLAP and guards.overlap:
            apart = sim.domain.displacement_on_host(x[k], x[l])
            self._stop(
                f"grains {k} and {l}: their overlap reached the limit at which the contact is no longer unique, their "
                f"centres are {np.linalg.norm(apart):g} m apart; use stiffer grains or less stress",
                [k, l],
                {"distance": float(np.linalg.norm(apart))},
            )
        if code == WALL and guards.wall:
            self._stop(
                f"grain {k}: its centre went beyond wall {sim.walls.names[l]!r}; use stiffer grains or a smaller step",
                [k],
                {},
            )

    def _stop(self, text, grains, values):
        raise SimulationError(f"step {self.sim.step}: {text}", self.sim.step, grains, values)


def platens_around(scene: Any) -> tuple[int, int]:
    """Platens that bound the mobile grains of a layer from below and from above, NO_PLATEN where there is none.

    A layer repeats along every axis but y, so that no grain can go around its platens. A platen bounds it if all mobile
    grains start on one side of its outermost centre.
    """
    around = [repeats for axis, repeats in enumerate(scene.periodic) if axis != 1]
    if not scene.platens or scene.periodic[1] or not all(around):
        return NO_PLATEN, NO_PLATEN
    height, glued = scene.position[:, 1], scene.platen_index
    mean = [height[glued == p].mean() for p in range(len(scene.platens))]
    low, high = int(np.argmin(mean)), int(np.argmax(mean))
    mobile = height[glued < 0]
    below = low if np.all(mobile >= height[glued == low].min()) else NO_PLATEN
    above = high if np.all(mobile <= height[glued == high].max()) else NO_PLATEN
    return below, above
