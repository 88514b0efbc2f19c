"""Stages of a run of shear-gouge: consolidation under the normal stress, and shear."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.parallel_runs import Progress
from workflows.gouge.layer_scene import LARGEST_SPEED, shear_drive
from workflows.gouge.parameters import Params

SAMPLES_PER_ROW = 5  # with more, diagnostics would not stay below 3 % of a run: benchmarks/output_cost.py
SETTLE_TIMES = 300.0  # inertial times d sqrt(rho/P) that consolidation may take after the platen has come down


def consolidate(
    sim: lsm.Simulation,
    layer: lsm.ShearedLayer,
    recorder: lsm.LayerRecorder,
    params: Params,
    progress: Progress | None = None,
) -> None:
    """Press the layer until the platen carries the normal stress and the thickness no longer changes.

    Raises
    ------
    SimulationError
        If it does not settle within SETTLE_TIMES and the time that the platen needs to come down.
    """
    chunk = max(1, int(2.0 * params.inertial_time / sim.dt))
    quiet, stress = 0, np.nan
    allowed = SETTLE_TIMES + layer.thickness / (LARGEST_SPEED * params.diameter)
    for _ in range(int(allowed / 2.0)):
        before = layer.thickness
        for _ in range(4):
            sim.run(-(-chunk // 4))
            layer.sample()
        stress = recorder.row(1)["platen_normal_stress"]
        still = abs(layer.thickness / before - 1.0) < 2e-4
        loaded = abs(stress / params.normal_stress - 1.0) < 0.02
        quiet = quiet + 1 if still and loaded else 0
        if progress:
            height = {"height": layer.thickness, "height_goal": params.layer[0], "normal_stress": stress}
            progress({"stage": "settling" if loaded else "consolidating", **height})
        if quiet == 3:
            return
    raise lsm.SimulationError(
        f"step {sim.step}: the layer did not settle within {allowed:.0f} inertial times: "
        f"normal stress {stress:g} Pa of {params.normal_stress:g} Pa"
    )


def shear(
    sim: lsm.Simulation,
    layer: lsm.ShearedLayer,
    recorder: lsm.LayerRecorder,
    params: Params,
    report: Progress,
) -> float:
    """Move the top platen at the velocity of the inertial number until the strain is reached.

    Returns
    -------
    float
        Grain steps per second [s-1] after the first row, in which kernels are compiled; nan if there is one row.
    """
    velocity = params.inertial_number / params.inertial_time * layer.thickness
    platens: Any = sim.platens  # the attributes depend on the class of the drive
    platens.set("top", 0, shear_drive(params, velocity, platens.drives[1][1].inertia))
    layer.begin_shear()
    steps_per_row = params.inertial_time / (params.inertial_number * params.rows_per_strain * sim.dt)
    chunk = max(1, round(steps_per_row / SAMPLES_PER_ROW))
    unit, began, first_step = 1, 0.0, -1
    while layer.strain < params.strain:
        for _ in range(SAMPLES_PER_ROW):
            sim.run(chunk)
            layer.sample()
        report(recorder.row(2))
        if first_step < 0:
            began, first_step = time.perf_counter(), sim.step
        if layer.strain >= unit:
            recorder.snapshot()
            unit += 1
    if unit - 1 < params.strain:  # the last snapshot is older than the end
        recorder.snapshot()
    steps = sim.step - first_step
    return steps * len(sim) / (time.perf_counter() - began) if steps else np.nan
