"""The packing, its grains coloured by their angular velocity about the axis across the shear."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflows.plots.packing import Colours, Scale, draw
from workflows.plots.packing import scale_of as scale_of_values
from workflows.plots.run_files import Moment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("grains",)
SIZE = (3.5, 3.5)
COLOURS = Colours("angular velocity about z [rad/ms]", map="PuOr", signed=True)


def scale_of(moment: Moment) -> Scale:
    """Ends of the colours and of the axes."""
    return scale_of_values(moment, 1e-3 * moment.grains.angular_velocity[:, 2], COLOURS)


def draw_moment(figure: Figure, moment: Moment, scale: Scale) -> None:
    """Draw the packing."""
    draw(figure, moment, 1e-3 * moment.grains.angular_velocity[:, 2], COLOURS, scale)
