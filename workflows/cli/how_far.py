"""How far a run has come that goes on or was stopped, by what it has written."""

import json
import math
from pathlib import Path
from typing import Any

import taichi_lsm as lsm
from workflows.cli.progress import clock

UNREADABLE = (OSError, RuntimeError, ValueError, AttributeError, KeyError, IndexError, TypeError)


def last_row(folder: Path) -> tuple[str, float, float] | None:
    """(stage, shear strain, shear strain to reach) of the last row of run.nc in a folder; None if there is none."""
    try:
        with lsm.opened_netcdf(folder / "run.nc") as file:
            return str(file["stage"][-1]), float(file["shear_strain"][-1]), float(file["strain"][...])
    except UNREADABLE:
        return None


def how_far(folder: Path) -> str:
    """The stage and strain of the last row of run.nc in a folder, and how long the rest may take; "" if unknown.

    The rest is expected to take as long per strain as the part that the last checkpoint has counted.
    """
    try:
        with lsm.opened_netcdf(folder / "run.nc") as file:
            strain, goal = file["shear_strain"][:], float(file["strain"][...])
            of_goal = "" if math.isnan(goal) else f" of {goal:.3g}"  # stages say themselves how far they go
            text = f"stage {file['stage'][-1]}, shear strain {float(strain[-1]):.3g}{of_goal} in the last row"
        left = _seconds_left(folder, strain, goal)
    except UNREADABLE:
        return ""
    return text if math.isnan(left) else f"{text}, about {clock(left)} left"


def _seconds_left(folder: Path, strain: Any, goal: float) -> float:
    """Expected wall-clock time of the rest [s]; nan before the first checkpoint with strain."""
    try:
        with lsm.opened_netcdf(folder / "checkpoint.nc") as file:
            state = json.loads(file.run_state)
        counted, seconds = float(strain[state["rows"] - 1]), float(state["seconds"])
    except UNREADABLE:
        return math.nan
    return seconds * (goal - float(strain[-1])) / counted if counted > 0.0 else math.nan
