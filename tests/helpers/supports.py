"""Support functions h(n), the greatest n . x over a grain, straight from the definitions of its shape."""

import numpy as np


def unit(angle):
    """Unit vectors (..., 2) at these angles [rad]."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def support_of_arcs(shape, angle):
    """h(n) of a disc or an arc chain in its body frame at these angles of n, from the arc whose cone holds n."""
    if shape.patch_count == 1:
        return np.full(angle.shape, shape.radius[0])
    first = np.arctan2(shape.seam[:, 1], shape.seam[:, 0]) % (2 * np.pi)
    order = np.argsort(first)
    arc = order[np.searchsorted(first[order], angle % (2 * np.pi), side="right") - 1]
    return np.sum(shape.centre[arc] * unit(angle), axis=-1) + shape.radius[arc]
