"""Fragments: the groups of grains that intact bonds join."""

import numpy as np


def fragments(sim):
    """Fragment (n,) of every grain, numbered from 0: grains that intact bonds join, directly or through others.

    sim: a simulation; in one without bonds every grain is a fragment of its own.
    """
    from scipy.sparse import coo_array  # takes a while to load
    from scipy.sparse.csgraph import connected_components

    count = len(sim)
    if sim.bonds is None:
        return np.arange(count)
    pairs = sim.scene.bonds[sim.bonds.intact.to_numpy() == 1]
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(links, directed=False)[1]
