"""What a run is expected to take: steps, time and memory, said before it starts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

LONG = 86_400.0  # [s]: what is expected to take more needs --yes
PROCESS_BYTES = 4e8  # of a process with its compiled kernels, before the grains
MUCH = 0.5  # share of the machine's memory, likewise


@dataclass(frozen=True)
class RunCost:
    """Expected cost of a run, within a factor of about two on idle cores.

    Attributes
    ----------
    steps
        Number of steps, of all runs together [1].
    seconds
        Wall-clock time, with compiling [s].
    memory
        Of all processes that run at a time [bytes].
    """

    steps: float
    seconds: float
    memory: float

    def __str__(self) -> str:
        time, memory = f"{duration(self.seconds)} on idle cores", f"{self.memory / 1e9:.1f} GB of memory"
        return f"about {self.steps:.2g} steps, {time}, {memory}"


def of_replicas(costs: Sequence[RunCost], at_a_time: int) -> RunCost:
    """Cost of several runs, `at_a_time` of them at once on a processor core each."""
    free = [0.0] * min(at_a_time, len(costs), os.cpu_count() or 1)  # when each core has ended its runs [s]
    for cost in costs:
        free[free.index(min(free))] += cost.seconds
    largest = sorted((cost.memory for cost in costs), reverse=True)[:at_a_time]
    return RunCost(sum(cost.steps for cost in costs), max(free), sum(largest))


def duration(seconds: float) -> str:
    """A time in the unit that suits it: "40 s", "12 min", "3 h", "2 days"."""
    for unit, size in (("days", 86_400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


def objections(cost: RunCost, memory: float) -> list[str]:
    """Why a run of this cost is not started unasked on a machine of so much `memory` [bytes]; [] if it is."""
    reasons = []
    if cost.seconds > LONG:
        reasons.append(f"--yes: is needed, as the run is expected to take {duration(cost.seconds)}, more than a day")
    if cost.memory > MUCH * memory:
        reasons.append(
            f"--yes: is needed, as the run is expected to use {cost.memory / 1e9:.3g} GB of the machine's "
            f"{memory / 1e9:.3g} GB of memory, more than half"
        )
    return [f"{reason}; make it smaller, take another --preset, or confirm it" for reason in reasons]
