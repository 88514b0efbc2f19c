"""Scenes of a few grains, as measurements and tests of the physics need them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import taichi_lsm as lsm


def scene_of(
    position: ArrayLike,
    effects: Sequence[Any],
    *,
    shapes: Sequence[Any] | None = None,
    shape_index: ArrayLike = 0,
    diameter: ArrayLike = 1.0,
    lengths: tuple[float, ...] | None = None,
    periodic: tuple[bool, ...] | None = None,
    **more: Any,
) -> lsm.Scene:
    """Scene of a few grains; by default discs or spheres of 1 m in open space.

    Parameters
    ----------
    position
        Centres (n, dim) [m].
    effects
        Effects of the scene.
    shapes, shape_index
        Table of shapes, and the row of each grain (n,) or one for all.
    diameter
        Equivalent diameters (n,) or one for all [m].
    lengths, periodic
        Of the cell, one per axis; lengths [m].
    more
        Further arguments of `Scene`; the density is 1000 kg/m3 by default.
    """
    position = np.asarray(position, float)
    n, dim = position.shape
    return lsm.Scene(
        dim=dim,
        lengths=lengths or (np.inf,) * dim,
        periodic=periodic or (False,) * dim,
        shapes=list(shapes) if shapes else [lsm.disc() if dim == 2 else lsm.sphere()],
        shape_index=np.broadcast_to(shape_index, n).copy(),
        position=position,
        diameter=np.broadcast_to(diameter, n).astype(float),
        density=more.pop("density", 1000.0),
        effects=list(effects),
        **more,
    )
