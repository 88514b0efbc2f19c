"""Energy budget over the course of the run, and where the work went in each stage, by effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.plots.run_files import RunFiles
from workflows.plots.run_panels import draw_energy, has_platens
from workflows.plots.step_panels import draw_work

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("run",)
SIZE = (3.5, 4.6)
ROOM = 1.35  # length of the axis over what the curves need, for the legend above them
BUDGET = 3.3  # height of the budget [inches]
LEAST = 1e-12  # of all that was dissipated, below which a stage has no shares


def draw_run(figure: Figure, run: RunFiles) -> None:
    """Draw the budget, and a bar for each stage that dissipated anything."""
    run.rows("dissipated_energy", "external_work", "energy_residual", "work_throughput")
    stages = stages_with_losses(run)
    if not stages:
        axes = figure.subplots()
        draw_energy(axes, run.sheared, run.course, drives_of(run))
        return
    heights = (BUDGET, 0.85 + 0.25 * len(stages))
    figure.set_size_inches(SIZE[0], sum(heights))
    budget, bars = figure.subplots(2, 1, height_ratios=heights)
    draw_energy(budget, run.sheared, run.course, drives_of(run))
    if "cycle" not in run.sheared:  # else draw_energy has made room for the legend
        low, high = budget.get_ylim()
        budget.set_ylim(low, ROOM * high)
    draw_work(bars, run.table, stages, stages, columns=2, least=12.0)


def stages_with_losses(run: RunFiles) -> tuple[str, ...]:
    """Names of the stages since shear began in which energy was dissipated."""
    lost = lsm.statistics.work_by_stage(run.sheared).dissipated_energy.sum("effect")
    return tuple(str(stage) for stage in lost.stage.values[np.abs(lost.values) > LEAST * float(np.abs(lost).max())])


def drives_of(run: RunFiles) -> str:
    """What does the work, in words."""
    return "platens" if has_platens(run.sheared) else "shear and of the normal stress"
