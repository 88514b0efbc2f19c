"""Going on with a run that was stopped, or making a finished one longer."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import taichi_lsm as lsm
from workflows.common.stopwatch import Stopwatch
from workflows.protocol.schedule import Position, Stage


@dataclass(frozen=True)
class Start:
    """Where a run begins: its position in the schedule, and the (rows, snapshots) that its files keep or None."""

    position: Position | None = None
    keep: tuple[int, int] | None = None


def start_of(
    layer: lsm.ShearedLayer, schedule: Sequence[Stage], out: str | os.PathLike[str], watch: Stopwatch
) -> tuple[Start, str]:
    """Put a layer as its scene has it into the state of the last checkpoint in `out`.

    Returns
    -------
    (Start, str)
        Where to go on, and what was wrong with the last checkpoint where the one before it was taken, else "".
    """
    restored = lsm.checkpoints.restore_last(layer.sim, out)
    state = restored.run_state
    layer.restore(state["layer"])
    watch.add(state["seconds"], state["cpu_seconds"])
    position, snapshots = Position(**state["position"]), state["snapshots"]
    if position.stage == len(schedule) and position.ended:
        last = Position(**position.ended["position"])
        if schedule[-1].until.open_again(layer, last.memory):
            position, snapshots = last, position.ended["snapshots"]
    return Start(position, (state["rows"], snapshots)), restored.damage
