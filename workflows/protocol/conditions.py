"""When a stage ends. A condition is asked after every row; what it remembers is plain, for checkpoints keep it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import taichi_lsm as lsm

STILL = 2e-4  # greatest relative change of the thickness from row to row of a layer that has settled
LOADED = 0.02  # greatest relative deviation of its normal stress
QUIET_ROWS = 3  # that must fulfil both

Memory = dict[str, Any]  # numbers by name


class Condition(Protocol):
    """The end of a stage."""

    def begin(self, layer: lsm.ShearedGrains) -> Memory:
        """What the condition remembers as the stage begins."""
        ...

    def met(self, layer: lsm.ShearedGrains, row: dict[str, Any], memory: Memory) -> bool:
        """Whether the stage has ended with this row of run.nc; `memory` may be changed."""
        ...

    def open_again(self, layer: lsm.ShearedGrains, memory: Memory) -> bool:
        """Whether a stage that had ended goes on under this condition, which asks for more than the former one."""
        ...


@dataclass(frozen=True)
class Reached:
    """The first of a shear strain [1], a slip [m] and a time [s], counted from the begin of the stage."""

    strain: float = float("inf")
    slip: float = float("inf")
    time: float = float("inf")

    def begin(self, layer: lsm.ShearedGrains) -> Memory:
        """Strain, slip and time at the begin of the stage."""
        return {"strain": layer.strain, "slip": layer.slip, "time": layer.sim.time}

    def met(self, layer: lsm.ShearedGrains, row: dict[str, Any], memory: Memory) -> bool:
        """Whether one of them is reached; slip counts in either direction."""
        return not self.open_again(layer, memory)

    def open_again(self, layer: lsm.ShearedGrains, memory: Memory) -> bool:
        """Whether none of them is reached."""
        return (
            layer.strain - memory["strain"] < self.strain
            and abs(layer.slip - memory["slip"]) < self.slip
            and layer.sim.time - memory["time"] < self.time
        )


@dataclass(frozen=True)
class Settled:
    """The grains carry their normal stress [Pa] and the thickness no longer changes, within a time [s].

    row: name of the normal stress in a row.

    Raises
    ------
    SimulationError
        If the layer has not settled within that time.
    """

    normal_stress: float
    within: float
    row: str = "platen_normal_stress"

    def begin(self, layer: lsm.ShearedGrains) -> Memory:
        """Thickness and time at the begin; number of rows so far in which the layer was at rest."""
        return {"thickness": layer.thickness, "time": layer.sim.time, "quiet": 0}

    def met(self, layer: lsm.ShearedGrains, row: dict[str, Any], memory: Memory) -> bool:
        """Whether the layer was loaded and still in the last rows."""
        stress = row[self.row]
        still = abs(layer.thickness / memory["thickness"] - 1.0) < STILL
        loaded = abs(stress / self.normal_stress - 1.0) < LOADED
        memory["thickness"], memory["quiet"] = layer.thickness, memory["quiet"] + 1 if still and loaded else 0
        if memory["quiet"] < QUIET_ROWS and layer.sim.time - memory["time"] >= self.within:
            raise lsm.SimulationError(
                f"step {layer.sim.step}: the layer did not settle within {self.within:g} s: "
                f"normal stress {stress:g} Pa of {self.normal_stress:g} Pa"
            )
        return memory["quiet"] >= QUIET_ROWS

    def open_again(self, layer: lsm.ShearedGrains, memory: Memory) -> bool:
        """Never: a layer that has settled has settled."""
        return False
