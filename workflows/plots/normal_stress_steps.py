"""Figure of steps of the normal stress: friction, normal stress and porosity after them, and where the work went."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from workflows.gouge.step_cycles import DOWN, UP
from workflows.plots.canvas import BLUE, ORANGE, figure_at
from workflows.plots.run_titles import params_of, title_of
from workflows.plots.step_panels import draw_stack, draw_work, mean_diameter

if TYPE_CHECKING:
    import xarray


def plot_normal_stress_steps(
    path: Path, dataset: xarray.Dataset, stacks: Mapping[str, xarray.Dataset], ratio: float
) -> None:
    """Draw steps.png of a run of normal-stress-steps; dataset: run.nc, stacks: its cycles, ratio: of the stresses."""
    size, pressure = mean_diameter(dataset), params_of(dataset).normal_stress
    cycles = stacks[UP].sizes["cycle"]
    with figure_at(path, (11, 8)) as figure:
        (friction, stress), (porosity, work) = figure.subplots(2, 2)
        for stage, colour, words in ((UP, ORANGE, f"P to {ratio:.3g} P"), (DOWN, BLUE, f"{ratio:.3g} P to P")):
            scaled = stacks[stage].assign(stress=stacks[stage].platen_normal_stress / pressure)
            draw_stack(friction, scaled, "platen_friction", size, colour, words)
            draw_stack(stress, scaled, "stress", size, colour, words)
            draw_stack(porosity, scaled, "porosity", size, colour, words)
        friction.set(
            title=f"(a) friction, mean of {cycles} cycles, standard error", ylabel="friction at the platen [1]"
        )
        stress.set(title="(b) normal stress", ylabel="normal stress on the platen / P [1]")
        porosity.set(title="(c) porosity", ylabel="porosity [1]")
        for axes in (friction, stress, porosity):
            axes.legend(loc="best")
        draw_work(work, dataset, (UP, DOWN), (f"{ratio:.3g} P", "P"))
        work.set_title("(d) where the work went", pad=32)
        figure.suptitle(title_of(dataset))
        figure.set_label(f"friction and porosity after steps of the normal stress by {ratio:.3g}, {cycles} cycles")
