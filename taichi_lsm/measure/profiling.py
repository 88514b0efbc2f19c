"""Where the time of a run went: what the host did, and the stages of a step timed one by one."""

import time
from typing import TYPE_CHECKING

from ..core.allocation import read, write
from ..core.errors import InputError
from ..core.runtime import ti

if TYPE_CHECKING:
    from ..simulation import Simulation

REPEATS = 20  # of a stage per launch
TURNS = 5  # launches of each stage, in turn; the medians count


@ti.data_oriented
class StageTimer:
    """The stages of a step, each by itself, in one thread, with a time step of zero: the state stays as it is.

    Only the impulses of the last step are forgotten and sums over the platens counted again, so that a run should not
    be continued afterwards.
    """

    def __init__(self, sim: "Simulation") -> None:
        self.forces, self.integrator, self.grains = sim.forces, sim.integrator, sim.grains
        self.stages, self.platens, self.loop, self.spec = sim.stages, sim.platens, sim.step_loop, sim.spec

    @ti.kernel
    def drift(self, repeats: ti.i32):
        """Loads, kicks and drifts of the mobile grains."""
        ti.loop_config(serialize=True)
        for _ in range(repeats):
            for k in range(self.grains.count[None]):
                if self.grains.platen_index[k] < 0:
                    self.stages.drift_mobile(k, 0)

    @ti.kernel
    def contacts(self, repeats: ti.i32):
        """Contacts of all rows."""
        ti.loop_config(serialize=True)
        for t in range(1):
            block = self.forces.block(0)
            for _ in range(repeats):
                self.forces.evaluate_rows(block, 0, self.grains.count[None], 0.0, 0)

    @ti.kernel
    def platen_sums(self, repeats: ti.i32):
        """Sums of the contact forces on the platens."""
        ti.loop_config(serialize=True)
        for _ in range(repeats):
            if ti.static(self.spec.platens > 0):
                self.platens.gather(self.forces, 1.0)

    def seconds(self) -> dict[str, float]:
        """Time of each stage once [s]: {name: seconds}."""
        dt = self.integrator.dt[None]
        self.integrator.dt[None] = 0.0
        # The force of a dashpot, which it remembers, depends on the step, and so does what it dissipates at the onset.
        tables = (
            (self.grains, ("force", "torque", "dissipated")),
            (self.forces.pairs, ("pair_force", "pair_torque", "history")),
        )
        loads = [getattr(table, name) for table, names in tables for name in names if hasattr(table, name)]
        kept = [read(field) for field in loads]
        stages = {
            "contacts": self.contacts,  # first: it clears impulses, which every drift would apply once more
            "gather, integrate": self.drift,
            "platens": self.platen_sums,
            "launch": lambda repeats: [self.loop.empty_launch() for _ in range(repeats)],
        }
        taken = {name: [] for name in stages}
        for turn in range(TURNS + 1):
            for name, stage in stages.items():
                began = time.perf_counter()
                stage(REPEATS)
                if turn > 0:  # the first one compiles
                    taken[name].append((time.perf_counter() - began) / REPEATS)
        self.integrator.dt[None] = dt
        for field, values in zip(loads, kept, strict=True):
            write(field, values)
        return {name: sorted(values)[TURNS // 2] for name, values in taken.items()}


def runtime_profile(sim: "Simulation") -> list[tuple[str, float, float]]:
    """Where the time of a run went.

    Parameters
    ----------
    sim : Simulation
        A simulation that has run. Its state should not be used afterwards: the stages of a step are timed once more,
        one by one and in one thread.

    Returns
    -------
    list of tuple
        Rows (what, share of all seconds [1], time per grain and step [ns]); indented rows are the stages of a step.

    Raises
    ------
    InputError
        If no step was made.
    """
    grain_steps = sim.step * len(sim)
    total = sum(sim.seconds.values())
    if not grain_steps:
        raise InputError("runtime_profile: no step was made, run the simulation first")
    rows = []
    for name, seconds in sim.seconds.items():
        rows.append((name, seconds / total, seconds / grain_steps * 1e9))
        if name == "steps" and hasattr(sim.step_loop, "empty_launch"):
            stages = StageTimer(sim).seconds()
            launches = stages.pop("launch")
            rows += [(f"  {n}", s * sim.step / total, s / len(sim) * 1e9) for n, s in stages.items() if s * 1e9 > 100]
            rows.append(("  launch", launches * sim.launches / total, launches * sim.launches / grain_steps * 1e9))
    return rows


def runtime_profile_text(sim: "Simulation") -> str:
    """`runtime_profile` as a table, with the sizes that explain it: grains, steps, rebuilds, pairs, bytes of a pair."""
    pairs = int(read(sim.pairs.row_start, len(sim) + 1)[len(sim)])
    lines = [
        f"{len(sim)} grains, {sim.step} steps, a new neighbour list every {sim.step / max(1, sim.rebuilds):.0f} steps, "
        f"{pairs / len(sim):.2f} listed pairs per grain of {sim.pairs.bytes_per_pair()} bytes",
        f"{'':24}{'share':>8}{'ns per grain and step':>24}",
    ]
    lines += [f"{name:24}{100 * share:7.1f}%{cost:24.2f}" for name, share, cost in runtime_profile(sim)]
    return "\n".join(lines)
