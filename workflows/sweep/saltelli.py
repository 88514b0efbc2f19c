"""Indices of Sobol: which share of the variance of a metric each parameter gives, alone and with all others.

Of independent parameters x that are even in their ranges, and a metric y = f(x), these are (Sobol 1993; Saltelli et al.
2010, doi:10.1016/j.cpc.2009.09.018)

    first order  S_i  = Var(E(y | x_i))/Var(y),
    total        ST_i = E(Var(y | all x but x_i))/Var(y).

Both come from blocks of d + 2 points: one point a, d points of which each has the parameter i of another point b, and
b. Computed by SALib (Iwanaga, Usher and Herman 2022, doi:10.18174/sesmo.18155).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_lsm.core.errors import InputError
from workflows.common.libraries import library

LEAST_BLOCKS = 4  # from which an error can be found
RESAMPLES = 1000  # of the blocks, for the errors


@dataclass(frozen=True)
class Indices:
    """Indices of one metric.

    Attributes
    ----------
    first, total
        (d,) indices of first order, and total ones.
    first_error, total_error
        (d,) half-widths of their 95 % intervals, by resampling of the blocks.
    blocks, left_out
        Number of blocks that are used, and of those in which a run gave nothing.
    """

    first: NDArray
    first_error: NDArray
    total: NDArray
    total_error: NDArray
    blocks: int
    left_out: int


def saltelli_sample(count: int, dimension: int, seed: int) -> NDArray:
    """(count (dimension + 2), dimension) points of the unit cube: blocks from a scrambled Sobol sequence.

    Raises
    ------
    InputError
        If SALib is not installed.
    """
    sampling = library("SALib.sample.sobol", 'sweep.sample.method = "saltelli"')
    rng = np.random.default_rng(seed)
    return sampling.sample(_problem([f"x{i}" for i in range(dimension)]), count, calc_second_order=False, seed=rng)


def indices_of(values: NDArray, dimension: int, seed: int, name: str = "metric") -> Indices:
    """Indices from the values of a metric.

    Parameters
    ----------
    values
        (blocks (dimension + 2),) at the points of `saltelli_sample`, in their order; nan where a run gave nothing,
        whose block is left out.
    dimension
        Number of parameters.
    seed
        Of the resampling.
    name
        Of the metric, for messages.

    Raises
    ------
    InputError
        If too few blocks are whole, or the metric is the same in all of them.
    """
    blocks = np.asarray(values, dtype=float).reshape(-1, dimension + 2)
    whole = blocks[np.isfinite(blocks).all(axis=1)]
    if len(whole) < LEAST_BLOCKS:
        raise InputError(
            f"{name}: {len(whole)} of {len(blocks)} blocks of {dimension + 2} runs are whole, at least {LEAST_BLOCKS} "
            "are needed; see why runs gave nothing, or raise sweep.sample.count"
        )
    if np.ptp(whole) == 0.0:
        raise InputError(f"{name}: is {whole[0, 0]:g} in all runs, there is no variance to share among parameters")
    analysis = library("SALib.analyze.sobol", "sensitivity")
    problem = _problem([f"x{i}" for i in range(dimension)])
    # SALib takes the seed 0 for none.
    found = analysis.analyze(
        problem, whole.ravel(), calc_second_order=False, num_resamples=RESAMPLES, conf_level=0.95, seed=seed + 1
    )
    first, first_error, total, total_error = (np.asarray(found[key]) for key in ("S1", "S1_conf", "ST", "ST_conf"))
    return Indices(first, first_error, total, total_error, len(whole), len(blocks) - len(whole))


def _problem(names: Sequence[str]) -> dict[str, Any]:
    """What SALib calls a problem: parameters that are even from 0 to 1."""
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}
