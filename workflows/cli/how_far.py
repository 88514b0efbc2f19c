"""How far a run has come that goes on or was stopped, by what it has written."""

import json
import math
from pathlib import Path
from typing import Any

import taichi_lsm as lsm
from workflows.cli.progress import clock
from workflows.common.discovery import find_workflows
from workflows.common.parameter_files import config_in, experiment_of
from workflows.common.parameters import merge
from workflows.protocol.stage_tables import RESERVED

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

    The rest is expected to take as long per strain, or per time of stages, as the part that the last checkpoint has
    counted. Stages are told with their repetition and the share of the time of all of them.
    """
    try:
        with lsm.opened_netcdf(folder / "run.nc") as file:
            strain, stage, of_goal = file["shear_strain"][:], str(file["stage"][-1]), ""
            if "cycle" in file.variables:  # stages say themselves how far they go
                done, goal, cycle = _shares(file, folder), 1.0, int(file["cycle"][-1])
                stage += f" {cycle}" * (cycle > 0) + f", {100.0 * float(done[-1]):.0f} % of the time of all stages"
            else:
                done, goal = strain, float(file["strain"][...])
                of_goal = "" if math.isnan(goal) else f" of {goal:.3g}"
            text = f"stage {stage}, shear strain {float(strain[-1]):.3g}{of_goal} in the last row"
        left = _seconds_left(folder, done, goal)
    except UNREADABLE:
        return ""
    return text if math.isnan(left) else f"{text}, about {clock(left)} left"


def _shares(file: Any, folder: Path) -> Any:
    """Time since the first stage began in each row of run.nc in a folder, over that which all are expected to take."""
    time, name = file["time"][:], experiment_of(folder)
    sheared = [str(stage) not in RESERVED for stage in file["stage"][:]]
    before = time[max(0, sheared.index(True) - 1)] if any(sheared) else time[-1]
    params = merge(find_workflows()[name].Params, None, config_in(folder), experiment=name)
    return (time - before).clip(0.0) / params.time_of_stages()


def _seconds_left(folder: Path, done: Any, goal: float) -> float:
    """Expected wall-clock time of the rest [s]; nan before the first checkpoint of the shear.

    done: of what is to reach `goal`, in each row.
    """
    try:
        with lsm.opened_netcdf(folder / "checkpoint.nc") as file:
            state = json.loads(file.run_state)
        counted, seconds = float(done[state["rows"] - 1]), float(state["seconds"])
    except UNREADABLE:
        return math.nan
    left = goal - float(done[-1])
    return seconds * (0.0 if left < 0.0 else left) / counted if counted > 0.0 else math.nan
