"""Grains of more than one part: bounding balls of the parts of each shape, for the neighbour search."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.allocation import when_allocated
from ..core.fields import allocate, fill_rows, rounded_capacity
from ..core.rotation import rotate
from ..core.runtime import current, ti
from ..core.schema import Variable

SHAPE_ROWS = [
    Variable("first_row", ("shape",), "i32", "1", "first part of the shape"),
    Variable("count", ("shape",), "i32", "1", "number of parts of the shape"),
]
BALL_ROWS = [
    Variable("centre", ("part", "space"), "real", "1", "centre of a ball around the part, body frame"),
    Variable("bound", ("part",), "real", "1", "radius of that ball, in units of the grain's scale"),
]


@ti.data_oriented
class PartTable:
    """Bounding balls of the convex parts of all shapes; parts of one grain never touch each other.

    Parameters
    ----------
    shapes : sequence of GrainShape
        Shapes of the scene.
    grains
        State of the grains.
    """

    def __init__(self, shapes: Sequence[Any], grains: Any) -> None:
        self.grains = grains
        self.dim = grains.dim
        self.real = current().real
        rows = sum(len(s.parts) for s in shapes)
        table = allocate(SHAPE_ROWS, rounded_capacity(len(shapes)), {})
        balls = allocate(BALL_ROWS, rounded_capacity(rows), {"space": self.dim})
        for name, field in {**vars(table), **vars(balls)}.items():
            setattr(self, name, field)
        when_allocated(lambda: self.fill(shapes))

    def fill(self, shapes: Sequence[Any]) -> None:
        """Write the table. Raises InputError if the shapes exceed the capacity that it was made with."""
        counts = np.array([len(s.parts) for s in shapes])
        bounds = [s.part_bounds() for s in shapes]
        fill_rows(self.first_row, np.cumsum(counts) - counts)
        fill_rows(self.count, counts)
        fill_rows(self.centre, np.concatenate([centre for centre, _ in bounds]))
        fill_rows(self.bound, np.concatenate([radius for _, radius in bounds]))

    @ti.func
    def gap(self, k, l, a, b, d):
        """Gap [m] between the bounding balls of part a of grain k and part b of grain l, d = c_l - c_k [m].

        |d + c_j - c_i| - r_i - r_j, c the centres of the balls relative to their grains; negative if they overlap.
        """
        g = self.grains
        i, j = self.first_row[g.shape_index[k]] + a, self.first_row[g.shape_index[l]] + b
        # Centres of the balls relative to their grains, world frame.
        c_i = rotate(ti.cast(g.orientation[k], self.real), self.centre[i]) * g.diameter[k]
        c_j = rotate(ti.cast(g.orientation[l], self.real), self.centre[j]) * g.diameter[l]
        return (d + c_j - c_i).norm() - self.bound[i] * g.diameter[k] - self.bound[j] * g.diameter[l]
