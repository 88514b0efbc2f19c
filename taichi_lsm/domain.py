"""The simulated cell: a box, periodic along some axes and open along the others."""

import numpy as np

from .errors import InputError
from .runtime import ti, when_allocated


def check_box(lengths, periodic, largest_diameter, skin):
    """Refuse a periodic axis on which a grain could meet its own image.

    lengths [m], periodic (bool): one per axis; largest_diameter [m]: of the bounding circles; skin [m].
    Raises InputError if a periodic length is below 2 (largest_diameter + skin).
    """
    for axis, (length, repeats) in enumerate(zip(lengths, periodic, strict=True)):
        least = 2.0 * (largest_diameter + skin)
        if repeats and not (np.isfinite(length) and length >= least):
            raise InputError(f"box axis {'xyz'[axis]}: length {length:g} m is periodic and must be >= {least:g} m")


@ti.func
def nearest_integer(a):
    """Nearest integer of an f64 below 2^51 in magnitude, without the library call that `floor` costs."""
    big = ti.cast(6755399441055744.0, ti.f64)  # 1.5 * 2^52: there f64 numbers are integers; exact in f32 as well
    return (a + big) - big


@ti.data_oriented
class Domain:
    """Minimum-image geometry of the cell. Positions are never wrapped: wrapping would change their last bits."""

    def __init__(self, lengths, periodic):
        self.dim = len(lengths)
        self.periodic = tuple(bool(p) for p in periodic)
        self.length = ti.field(ti.f64, self.dim)
        self.inverse_length = ti.field(ti.f64, self.dim)
        when_allocated(lambda: self.set_lengths(lengths))

    def set_lengths(self, lengths):
        """Write the lengths of the cell [m]; those of open axes do not matter."""
        finite = np.where(self.periodic, lengths, 1.0).astype(float)
        for axis, length in enumerate(finite):  # each `from_numpy` would be a kernel to compile
            self.length[axis], self.inverse_length[axis] = length, 1.0 / length

    @ti.func
    def displacement(self, x_k, x_l):
        """Vector from x_k to the nearest image of x_l [m]."""
        d = x_l - x_k
        for axis in ti.static(range(self.dim)):
            if ti.static(self.periodic[axis]):
                d[axis] -= self.length[axis] * nearest_integer(d[axis] * self.inverse_length[axis])
        return d
