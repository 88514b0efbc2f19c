"""Friction over the course of the run, with its steady mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.run_files import RunFiles
from workflows.plots.run_panels import draw_friction, draw_stages

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("run",)
SIZE = (3.5, 3.0)


def draw_run(figure: Figure, run: RunFiles) -> None:
    """Draw the friction of a run at one velocity against strain, through stages against its course."""
    sheared = run.rows("friction", "shear_stress", "normal_stress")
    axes = figure.subplots()
    if "cycle" in sheared:
        draw_stages(axes, sheared, run.params, run.course)
    else:
        draw_friction(axes, sheared, run.params)
