"""Going on with a run that was stopped, or making a finished one longer."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import taichi_lsm as lsm
from workflows.common.stopwatch import Stopwatch
from workflows.protocol.moments import Moments
from workflows.protocol.schedule import Position, Stage

# What `RunLoop` saves beside the simulation.
STATE = {"position", "layer", "rows", "snapshots", "moments", "id", "parameters", "rate", "seconds", "cpu_seconds"}


@dataclass(frozen=True)
class Start:
    """Where a run begins.

    Attributes
    ----------
    position
        In the schedule; None: before it.
    keep
        Rows of run.nc, snapshots of grains.nc and moments of contacts.nc that are kept, or None.
    rate
        Grain steps per second of the part that is done [s-1], nan if it is not known.
    """

    position: Position | None = None
    keep: tuple[int, int, int] | None = None
    rate: float = float("nan")


def start_of(
    layer: lsm.ShearedGrains,
    schedule: Sequence[Stage],
    out: str | os.PathLike[str],
    watch: Stopwatch,
    identity: Mapping[str, Any],
) -> tuple[Start, str]:
    """Put a layer as its scene has it into the state of the last checkpoint in `out`.

    Parameters
    ----------
    layer, schedule
        As a new run would begin.
    out
        Folder of the run.
    watch
        Takes the time that the run has taken so far.
    identity
        {name of a parameter: value} of what must be as in the run that wrote the checkpoint.

    Returns
    -------
    (Start, str)
        Where to go on, and what was wrong with the last checkpoint where the one before it was taken, else "".
    """
    files = ["run.nc", "grains.nc"] + ["contacts.nc"] * any(stage.contacts != Moments() for stage in schedule)
    restored = lsm.checkpoints.restore_last(
        layer.sim, out, lambda state, path: _check_same_run(state, path, [Path(out) / name for name in files], identity)
    )
    state = restored.run_state
    layer.restore(state["layer"])
    watch.add(state["seconds"], state["cpu_seconds"])
    position, kept = Position(**state["position"]), state
    if position.ended and not position.begun:
        last = Position(**position.ended["position"])
        if schedule[last.stage].until.open_again(layer, last.memory):  # the stage has become longer
            position, kept = last, position.ended
        elif not schedule[last.stage].contacts.at_end:  # of a run that ended there, and now has more stages
            kept = {**state, "moments": position.ended["moments"]}
    return Start(position, (state["rows"], kept["snapshots"], kept["moments"]), state["rate"]), restored.damage


def _check_same_run(
    state: Mapping[str, Any], checkpoint: Path, files: Sequence[Path], identity: Mapping[str, Any]
) -> None:
    """Refuse a checkpoint of another run than the files beside it, or of one with other parameters."""
    lacking = sorted(STATE - state.keys())
    if lacking:
        raise lsm.InputError(
            f"{checkpoint}: holds no {', '.join(lacking)}, must be a checkpoint of lsm shear-gouge; begin the run anew"
        )
    known = state["parameters"]
    differing = [name for name, value in identity.items() if known.get(name, value) != value]
    if differing:
        was = ", ".join(f"{name} {known[name]} where this run has {identity[name]}" for name in differing)
        raise lsm.InputError(f"{checkpoint}: is of a run with {was}; go on with the parameters of that run")
    for path in files:
        if not path.is_file():
            raise lsm.InputError(f"{path}: is missing, and {checkpoint} cannot go on without it; begin anew")
        with lsm.opened_run(path) as there:
            if there.attrs.get("id") != state["id"]:
                raise lsm.InputError(f"{checkpoint}: is of another run than {path}; restore the files of one run")
