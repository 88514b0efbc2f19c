"""Scenes of a few grains, as measurements and tests of the physics need them."""

import numpy as np

import taichi_lsm as lsm


def scene_of(position, effects, *, shapes=None, shape_index=0, diameter=1.0, lengths=None, periodic=None, **more):
    """Scene of grains at `position` (n, dim) [m], in open space unless told otherwise; discs or spheres of 1 m."""
    position = np.asarray(position, float)
    n, dim = position.shape
    return lsm.Scene(
        dim=dim,
        lengths=lengths or (np.inf,) * dim,
        periodic=periodic or (False,) * dim,
        shapes=shapes or [lsm.disc() if dim == 2 else lsm.sphere()],
        shape_index=np.broadcast_to(shape_index, n).copy(),
        position=position,
        diameter=np.broadcast_to(diameter, n).astype(float),
        density=more.pop("density", 1000.0),
        effects=effects,
        **more,
    )
