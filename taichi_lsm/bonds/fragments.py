"""Fragments: the groups of grains that intact bonds join."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import read


def fragments(sim: Any) -> NDArray:
    """Fragment of every grain: grains that intact bonds join, directly or through others, belong together.

    Parameters
    ----------
    sim : Simulation
        A simulation; in one without bonds every grain is a fragment of its own.

    Returns
    -------
    array (n,)
        Number of the fragment of each grain, by persistent id, from 0 on.
    """
    from scipy.sparse import coo_array  # takes a while to load
    from scipy.sparse.csgraph import connected_components

    count = len(sim)
    if sim.bonds is None:
        return np.arange(count)
    pairs = sim.scene.bonds[read(sim.bonds.intact) == 1]
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(links, directed=False)[1]
