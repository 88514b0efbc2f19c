"""The packing, its grains coloured by the normal forces on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.contact_values import normal_force
from workflows.plots.packing import Colours, Scale, draw
from workflows.plots.packing import scale_of as scale_of_values
from workflows.plots.run_files import Moment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("grains", "contacts")
SIZE = (3.5, 3.5)
COLOURS = Colours("sum of the normal forces on a grain [N]")


def scale_of(moment: Moment) -> Scale:
    """Ends of the colours and of the axes."""
    return scale_of_values(moment, normal_force(moment), COLOURS)


def draw_moment(figure: Figure, moment: Moment, scale: Scale) -> None:
    """Draw the packing."""
    draw(figure, moment, normal_force(moment), COLOURS, scale)
