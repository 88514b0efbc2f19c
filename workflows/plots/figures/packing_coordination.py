"""The packing, its grains coloured by the number of grains that they touch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.contact_values import coordination
from workflows.plots.packing import Colours, Scale, draw
from workflows.plots.packing import scale_of as scale_of_values
from workflows.plots.run_files import Moment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("grains", "contacts")
SIZE = (3.5, 3.5)
COLOURS = Colours("grains and walls that a grain touches [1]", whole=True)


def scale_of(moment: Moment) -> Scale:
    """Ends of the colours and of the axes."""
    return scale_of_values(moment, coordination(moment), COLOURS)


def draw_moment(figure: Figure, moment: Moment, scale: Scale) -> None:
    """Draw the packing."""
    draw(figure, moment, coordination(moment), COLOURS, scale)
