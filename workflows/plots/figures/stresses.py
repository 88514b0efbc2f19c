"""Normal and shear stress over the course of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.canvas import BLUE, ORANGE
from workflows.plots.friction_axes import axis_limits, draw_zero
from workflows.plots.run_files import RunFiles
from workflows.plots.run_panels import SPACE, has_platens

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("run",)
SIZE = (3.5, 3.0)


def draw_run(figure: Figure, run: RunFiles) -> None:
    """Draw the stresses in the bulk as lines, those at the top platen dotted."""
    sheared, drawn = run.rows("shear_stress", "normal_stress"), []
    axes = figure.subplots()
    for kind, colour in (("normal", BLUE), ("shear", ORANGE)):
        for where, style in (("", "-"), ("platen_", ":")):
            if where and not has_platens(sheared):
                continue
            stress = sheared[f"{where}{kind}_stress"].values / 1e6
            words = f"{kind} stress" if not has_platens(sheared) else f"{kind}, {'platen' if where else 'bulk'}"
            axes.plot(run.course.values, stress, style, color=colour, lw=1.1, label=words)
            drawn.append(stress)
    run.course.name_axis(axes)
    axes.set(ylabel="stress, compression positive [MPa]", title="stresses")
    axes.set_ylim(axis_limits(*drawn, space=SPACE))
    draw_zero(axes)
    axes.legend(loc="upper left", ncols=2)
