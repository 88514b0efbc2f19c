"""Variables of run.nc of plane walls, and what a row has of them; only of scenes that have walls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .layer_rows import series

if TYPE_CHECKING:
    from ..core.schema import Variable
    from ..simulation import Simulation

OF_WALLS, VECTORS = ("time", "wall"), ("time", "wall", "space")
ROWS = [
    series(
        "wall_normal_force",
        "N",
        "normal force of the grains on the wall, compression positive, mean over all steps since the last row",
        dims=OF_WALLS,
    ),
    series(
        "wall_tangential_force",
        "N",
        "force of the grains on the wall along its plane, mean over all steps since the last row",
        dims=VECTORS,
    ),
    series("wall_position", "m", "point of the wall", dims=VECTORS),
    series("wall_velocity", "m s-1", "velocity of the wall, half a step before its position", dims=VECTORS),
    series("wall_work", "J", "work since the start of what moves the wall, its servo included", dims=OF_WALLS),
]


def wall_variables(sim: Simulation) -> list[Variable]:
    """Schema rows of run.nc of the walls of a simulation, none if it has none."""
    return list(ROWS) if sim.walls else []


def wall_coordinates(sim: Simulation) -> dict[str, list[str]]:
    """Labels of the dimensions wall and space of these rows, {} without walls."""
    return {"wall": list(sim.walls.names), "space": list("xyz"[: sim.scene.dim])} if sim.walls else {}


def wall_sums(sim: Simulation) -> dict[str, npt.NDArray]:
    """What the next row needs to know of the walls now: sum over steps of the force on each [N]; {} without walls."""
    return {"force_sum": sim.walls.snapshot()["force_sum"]} if sim.walls else {}


def wall_row(sim: Simulation, before: Mapping[str, npt.NDArray], step: int) -> dict[str, Any]:
    """What a row of run.nc has of the walls; {} without walls.

    Parameters
    ----------
    sim
        The simulation.
    before
        `wall_sums` at the last row.
    step
        Step of the last row. Where no step has been made since, the force is that of now.
    """
    if not sim.walls:
        return {}
    now, steps = sim.walls.snapshot(), sim.step - step
    force = (now["force_sum"] - before["force_sum"]) / steps if steps > 0 else now["force"]
    inward = np.sum(force * now["normal"], axis=1)
    return {
        "wall_normal_force": -inward,
        "wall_tangential_force": force - inward[:, None] * now["normal"],
        "wall_position": now["point"] + now["displacement"],
        "wall_velocity": now["velocity"],
        "wall_work": now["work"],
    }


class WallSeries:
    """Rows of run.nc of the plane walls of a simulation, for a script that writes the file itself with `RunWriter`.

    Parameters
    ----------
    sim
        A simulation with walls.

    Attributes
    ----------
    variables
        Schema rows, `RunWriter.variables`.
    coordinates
        Labels of their dimensions, `RunWriter.coordinates`.

    Raises
    ------
    InputError
        If there are no walls.
    """

    def __init__(self, sim: Simulation) -> None:
        if not sim.walls:
            raise InputError("WallSeries: the simulation has no plane walls, see Scene.walls")
        self.sim = sim
        self.variables, self.coordinates = wall_variables(sim), wall_coordinates(sim)
        self._step, self._sums = sim.step, wall_sums(sim)

    def row(self) -> dict[str, Any]:
        """Values of `variables` now: forces are means over all steps since the last row, or since this was made."""
        row = wall_row(self.sim, self._sums, self._step)
        self._step, self._sums = self.sim.step, wall_sums(self.sim)
        return row
