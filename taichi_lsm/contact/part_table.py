"""Grains of several parts: where the parts of each shape lie, for the search of neighbours."""

import numpy as np

from ..core.fields import allocate, fill_rows, orientation_size, rounded_capacity
from ..core.rotation import rotate
from ..core.runtime import current, ti, when_allocated
from ..core.schema import Variable

SHAPE_ROWS = [
    Variable("first_row", ("shape",), "i32", "1", "first part of the shape"),
    Variable("count", ("shape",), "i32", "1", "number of parts of the shape"),
]
BALL_ROWS = [
    Variable("centre", ("part", "space"), "real", "1", "centre of a ball that holds the part, body frame"),
    Variable("bound", ("part",), "real", "1", "radius of that ball, in units of the grain's scale"),
]


@ti.data_oriented
class PartTable:
    """Bounding balls of the parts of all shapes; parts of one grain never touch each other."""

    def __init__(self, shapes, grains):
        self.grains = grains
        self.dim = grains.dim
        self.real = current().real
        rows = sum(len(s.parts) for s in shapes)
        table = allocate(SHAPE_ROWS, rounded_capacity(len(shapes)), {})
        balls = allocate(
            BALL_ROWS, rounded_capacity(rows), {"space": self.dim, "orientation": orientation_size(self.dim)}
        )
        for name, field in {**vars(table), **vars(balls)}.items():
            setattr(self, name, field)
        when_allocated(lambda: self.fill(shapes))

    def fill(self, shapes):
        """Write the table; the shapes must fit the capacity it was made with."""
        counts = np.array([len(s.parts) for s in shapes])
        bounds = [s.part_bounds() for s in shapes]
        fill_rows(self.first_row, np.cumsum(counts) - counts)
        fill_rows(self.count, counts)
        fill_rows(self.centre, np.concatenate([centre for centre, _ in bounds]))
        fill_rows(self.bound, np.concatenate([radius for _, radius in bounds]))

    @ti.func
    def apart(self, k, l, a, b, d):
        """Distance of the bounding balls of part a of grain k and part b of grain l, d = c_l - c_k [m]."""
        g = self.grains
        i, j = self.first_row[g.shape_index[k]] + a, self.first_row[g.shape_index[l]] + b
        c_i = rotate(ti.cast(g.orientation[k], self.real), self.centre[i]) * g.diameter[k]
        c_j = rotate(ti.cast(g.orientation[l], self.real), self.centre[j]) * g.diameter[l]
        return (d + c_j - c_i).norm() - self.bound[i] * g.diameter[k] - self.bound[j] * g.diameter[l]
