"""Thickness of the layer and its porosity over the course of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.comparison_panels import COLOUR
from workflows.plots.run_files import RunFiles
from workflows.plots.run_panels import draw_thickness, has_platens

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("run",)
SIZE = (3.5, 2.6)


def draw_run(figure: Figure, run: RunFiles) -> None:
    """Draw the thickness, and the porosity as a second scale; of a cell its height."""
    what = "layer_thickness" if has_platens(run.sheared) else "cell_height"
    sheared = run.rows(what, "porosity").rename({what: "layer_thickness"})
    axes = figure.subplots()
    draw_thickness(axes, sheared, run.course, COLOUR[run.params.shape])
    if what == "cell_height":
        axes.set(ylabel="height of the cell [mm]", title="height of the cell and porosity")
