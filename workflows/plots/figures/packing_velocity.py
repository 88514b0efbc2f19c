"""The packing, its grains coloured by their velocity along the shear."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.packing import Colours, Scale, draw
from workflows.plots.packing import scale_of as scale_of_values
from workflows.plots.run_files import Moment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("grains",)
SIZE = (3.5, 3.5)
COLOURS = Colours("velocity along the shear [m/s]")


def scale_of(moment: Moment) -> Scale:
    """Ends of the colours and of the axes."""
    return scale_of_values(moment, moment.grains.velocity[:, 0], COLOURS)


def draw_moment(figure: Figure, moment: Moment, scale: Scale) -> None:
    """Draw the packing."""
    draw(figure, moment, moment.grains.velocity[:, 0], COLOURS, scale)
