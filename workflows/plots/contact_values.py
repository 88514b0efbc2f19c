"""What the contacts of one moment say of each grain: how many it has, what they press, the stress that they make."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.plots.run_files import Moment


def coordination(moment: Moment) -> NDArray:
    """Number of grains and walls that each grain of the snapshot touches (grain,); bonds are no contacts."""
    first, second = _ends(moment.touching, touching=True)
    pairs = np.unique(np.stack([first, second], axis=1), axis=0)  # grains of several parts may touch more than once
    return _of_grains(moment, pairs[:, 0], pairs[:, 1], np.ones(len(pairs)), np.ones(len(pairs)))


def normal_force(moment: Moment) -> NDArray:
    """Sum of the magnitudes of the normal forces on each grain of the snapshot [N] (grain,)."""
    force = np.abs(moment.touching.normal_force.values)
    return _of_grains(moment, *_ends(moment.touching), force, force)


def mean_stress(moment: Moment) -> NDArray:
    """Mean normal stress of each grain of the snapshot [Pa], compression positive; nan of glued ones (grain,).

    A third, in 2D half, of the trace of `lsm.statistics.grain_stress`.
    """
    stress = lsm.statistics.grain_stress(moment.all_grains, contacts=moment.touching).stress.values
    return np.trace(stress, axis1=1, axis2=2)[moment.grains.grain] / moment.grains.dim


def _of_grains(moment: Moment, first: NDArray, second: NDArray, of_first: NDArray, of_second: NDArray) -> NDArray:
    """Sums over the contacts of each grain of the snapshot (grain,) of what they give the first and the second one."""
    count = moment.run.snapshots.dataset.sizes["grain"]
    grain = second >= 0  # and no wall
    sums = np.bincount(first, of_first, count) + np.bincount(second[grain], of_second[grain], count)
    return sums[moment.grains.grain]


def _ends(contacts: Any, touching: bool = False) -> tuple[NDArray, NDArray]:
    """Ids of both grains of each contact; touching: of those that are no bonds."""
    which = ~contacts.bonded.values.astype(bool) if touching else slice(None)
    return contacts.first_id.values[which], contacts.second_id.values[which]
