"""A cell without walls as the subject of a run: how it is consolidated, what its shear drives, how it is measured.

Stages: generate (grains that do not touch), consolidate (the servo presses the height of the cell down to the normal
stress, or to the solid fraction), shear (at the rate of the inertial number).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import taichi_lsm as lsm
from workflows.cell.cell_scene import build
from workflows.cell.parameters import CellParams
from workflows.common.reports import Progress
from workflows.gouge.labels import grain_words
from workflows.gouge.layer_drives import NORMAL_STRESS, SHEAR_RATE
from workflows.gouge.layer_scene import LARGEST_SPEED
from workflows.gouge.layer_schedule import CONSOLIDATE, SETTLE_TIMES, settling_contacts, settling_rows
from workflows.gouge.shear_stages import shear_stages
from workflows.gouge.subject import Subject
from workflows.protocol.conditions import Memory, Settled
from workflows.protocol.schedule import Change, Stage

STRESS_ROW = "cell_normal_stress"
SPEED_LIMIT = "speed_limit"
AT_HEIGHT = 1e-9  # relative deviation of a height that is that of the solid fraction


@dataclass(frozen=True)
class Filled:
    """The cell has come down to the least height of its servo, that of its solid fraction, within a time [s].

    Raises
    ------
    SimulationError
        If it has not within that time: the grains bear the normal stress at a greater height.
    """

    within: float

    def begin(self, layer: lsm.ShearedGrains) -> Memory:
        """The time at the begin."""
        return {"time": layer.sim.time}

    def met(self, layer: lsm.ShearedGrains, row: dict[str, Any], memory: Memory) -> bool:
        """Whether the height is reached."""
        height: float = layer.sim.domain.servo.least_height
        reached = layer.thickness <= height * (1.0 + AT_HEIGHT)
        if not reached and layer.sim.time - memory["time"] >= self.within:
            raise lsm.SimulationError(
                f"step {layer.sim.step}: the cell has a height of {layer.thickness:g} m under its normal stress, the "
                f"solid fraction asks for {height:g} m; lower --solid-fraction or --friction"
            )
        return reached

    def open_again(self, layer: lsm.ShearedGrains, memory: Memory) -> bool:
        """Never: the height is held."""
        return False


class CellDrives:
    """What the stages of a cell drive: shear rate [s-1], normal stress [Pa], speed limit of the height [m s-1].

    Parameters
    ----------
    sim
        Of the run.
    """

    def __init__(self, sim: lsm.Simulation) -> None:
        self.cell: Any = sim.domain

    def value(self, name: str, thickness: float | None) -> float:
        """The value now."""
        if name == SHEAR_RATE:
            return float(self.cell.shear_rate[0])
        return self.cell.servo.stress if name == NORMAL_STRESS else self.cell.servo.speed_limit

    def set(self, name: str, value: float, thickness: float | None) -> None:
        """Set a value from now on."""
        if name == SHEAR_RATE:
            self.cell.set_shear_rate(value)
        else:
            given = {"stress" if name == NORMAL_STRESS else SPEED_LIMIT: value}
            self.cell.set_servo(replace(self.cell.servo, **given))


class Cell(Subject):
    """A cell without walls."""

    normal_stress = STRESS_ROW

    def build(self, params: CellParams, progress: Progress | None) -> lsm.Scene:
        """The scene before consolidation."""
        return build(params, progress)

    def measured(self, sim: lsm.Simulation, params: CellParams) -> lsm.ShearedCell:
        """What measures it."""
        return lsm.ShearedCell(sim, params.normal_stress, params.diameter)

    def schedule(self, params: CellParams, dt: float, thickness: float) -> list[Stage]:
        """Consolidation and shear, for a time step [s] and the height [m] before the consolidation."""
        p = params
        within = (SETTLE_TIMES + thickness / (LARGEST_SPEED * p.diameter)) * p.inertial_time
        until: Any = Settled(p.normal_stress, within, STRESS_ROW)
        if p.solid_fraction:
            until = Filled(within)
        spacing, contacts = settling_rows(p, dt), settling_contacts(p)
        consolidate = Stage(CONSOLIDATE, until=until, spacing=spacing, contacts=contacts)
        stages = shear_stages(p, dt)
        if p.solid_fraction:
            stages = [replace(stage, drives={**stage.drives, SPEED_LIMIT: Change(0.0)}) for stage in stages]
        return [consolidate, *stages]

    def drives(self, params: CellParams, sim: lsm.Simulation) -> CellDrives:
        """What its stages drive."""
        return CellDrives(sim)

    def title(self, scene: lsm.Scene) -> str:
        """Title of the files of a run."""
        return f"Shear of a cell of {grain_words(scene)} in {scene.dim}D"

    def summary(self, params: CellParams, sim: lsm.Simulation) -> str:
        """What happened in a run, in a sentence."""
        kept = "volume" if params.solid_fraction else "normal stress"
        return f"Generated {params.start} in a periodic cell, consolidated, sheared homogeneously at constant {kept}."
