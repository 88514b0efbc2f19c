"""The schedule of a sheared layer: consolidation under the normal stress, then shear at constant velocity."""

from __future__ import annotations

from workflows.gouge.layer_scene import LARGEST_SPEED
from workflows.gouge.parameters import Params
from workflows.protocol.conditions import Reached, Settled
from workflows.protocol.schedule import Stage

SAMPLES_PER_ROW = 5  # with more, diagnostics would not stay below 3 % of a run: benchmarks/output_cost.py
SETTLE_TIMES = 300.0  # inertial times d sqrt(rho/P) that consolidation may take after the platen has come down
ROW_TIMES = 2.0  # inertial times between two rows of the consolidation
SETTLING_SAMPLES = 4  # in each of them
SHEAR = "shear"  # the stage in which friction is measured


def layer_schedule(params: Params, dt: float, thickness: float) -> list[Stage]:
    """The stages of one run.

    Parameters
    ----------
    params
        Of the run.
    dt
        Time step [s].
    thickness
        Of the layer before it is consolidated [m]: the platen has to come down by as much at most.
    """
    p = params
    falling = thickness / (LARGEST_SPEED * p.diameter)
    consolidate = Stage(
        "consolidate",
        until=Settled(p.normal_stress, (SETTLE_TIMES + falling) * p.inertial_time),
        sample_steps=max(1, -(-int(ROW_TIMES * p.inertial_time / dt) // SETTLING_SAMPLES)),
        samples=SETTLING_SAMPLES,
    )
    steps_per_row = p.inertial_time / (p.inertial_number * p.rows_per_strain * dt)
    shear = Stage(
        SHEAR,
        until=Reached(strain=p.strain),
        sample_steps=max(1, round(steps_per_row / SAMPLES_PER_ROW)),
        samples=SAMPLES_PER_ROW,
        velocity=p.inertial_number / p.inertial_time,
        per_thickness=True,
        snapshot_strain=1.0,
    )
    return [consolidate, shear]
