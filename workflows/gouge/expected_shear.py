"""How far a layer is expected to be sheared, and how long that takes, from its parameters alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.protocol.stage_tables import planned

if TYPE_CHECKING:
    from collections.abc import Iterator

    from workflows.gouge.grain_parameters import GrainParams
    from workflows.gouge.layer_parameters import LayerParams


def expected(params: GrainParams) -> tuple[float, float]:
    """(shear strain [1], time [t_i]) of all stages after the consolidation; strain counts in either direction.

    How far a layer is sheared under a shear stress is not known before: such a stage counts with no strain, and with
    all of its time.
    """
    p, strain, time = params, 0.0, 0.0
    for stage in planned(p.shear_tables()):
        rate = abs(stage.velocity or 0.0) * p.inertial_number  # [1/t_i]
        takes = min(duration(p, name, value, rate) for name, value in stage.table.until.given.items())
        strain, time = strain + rate * takes, time + takes
    return strain, time


def short_stages(params: LayerParams) -> Iterator[tuple[str, float, float]]:
    """(name, time of its first row, time of its end) [t_i] of every stage that is to end before its first row."""
    for stage in {stage.table.name: stage for stage in planned(params.shear_tables())}.values():
        rate = abs(stage.velocity or 0.0) * params.inertial_number
        sample = stage.table.sample
        ((name, value),) = sample.given.items() if sample else [("strain", 1.0 / params.rows_per_strain)]
        first = duration(params, name, value, rate)
        ends = (duration(params, name, value, rate) for name, value in stage.table.until.given.items())
        end = min(ends, default=float("inf"))  # none of a stage that is wrong
        if end < first * (1.0 - 1e-6) and end < float("inf"):
            yield stage.table.name, first, end


def duration(params: GrainParams, name: str, value: float, rate: float) -> float:
    """Time [t_i] that a strain [1], a slip [d] or a time [t_i] takes at a shear rate [1/t_i]."""
    if name == "time":
        return value
    if rate == 0.0:
        return float("inf")
    return value / (rate * (params.layer[0] / params.diameter if name == "slip" else 1.0))
