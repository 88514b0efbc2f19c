"""At which parameters runs are made: first everywhere, then where they tell most of the posterior."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from workflows.calibrate.emulator import Emulators
from workflows.calibrate.posterior import Posterior, variances_of
from workflows.calibrate.targets import Target

CANDIDATES = 400  # for a run: three quarters drawn from the posterior, and a quarter from the prior
OF_THE_PRIOR = 4  # one in so many


def first_size(points: int, dimension: int) -> int:
    """Number of points of the first design: about half of all, and a power of two, for which the sequence is even."""
    wanted = max(points / 2.0, 2.0 * dimension + 2.0)
    return min(points, 2 ** math.ceil(math.log2(wanted)))


def least_points(dimension: int) -> int:
    """Number of points with which a calibration can begin."""
    return 2 * dimension + 2


def first_design(count: int, dimension: int, seed: int) -> NDArray:
    """(count, dimension) points that fill the unit cube evenly: a scrambled Sobol sequence (Sobol 1967, Owen 1998)."""
    from scipy.stats import qmc

    whole = 2 ** math.ceil(math.log2(count))
    return qmc.Sobol(dimension, rng=np.random.default_rng(seed)).random(whole)[:count]


def next_points(
    emulators: Emulators, posterior: Posterior, targets: tuple[Target, ...], count: int, replicas: int, seed: int
) -> NDArray:
    """(count, d) points whose runs take most from what the emulators do not know where the parameters may be.

    One after the other, each the candidate j that lowers the variance v of the emulators, summed over draws i of the
    posterior and in units of the errors of the targets, the most (Cohn 1996, doi:10.1016/0893-6080(95)00137-9):

        sum_i c_ij^2/(c_jj + scatter^2/replicas),  with c the covariance that is left after the points before.

    So points spread out by themselves: next to one that is taken nothing is left to learn.
    """
    rng = np.random.default_rng(seed)
    of_prior = rng.random((CANDIDATES // OF_THE_PRIOR, posterior.shares.shape[1]))
    drawn = np.unique(posterior.draws(CANDIDATES - len(of_prior), seed))
    shares = np.concatenate([posterior.shares[drawn], of_prior])
    own, apart = variances_of(emulators, targets)
    unit = own + apart + emulators.width**2 * 1e-6
    left = [emulators.covariance(i, shares) for i in range(len(targets))]
    noise = emulators.scatter**2 / replicas + emulators.within**2 / replicas
    chosen: list[int] = []
    for _ in range(count):
        gain = np.zeros(len(shares))
        for c, n, u in zip(left, noise, unit, strict=True):
            gain += np.sum(c[: len(drawn)] ** 2, axis=0) / ((np.diag(c) + n) * u)
        gain[chosen] = -1.0  # a second run there would tell of the scatter; a new place tells as much, and more
        best = int(np.argmax(gain))
        chosen.append(best)
        left = [c - np.outer(c[:, best], c[best]) / (c[best, best] + n) for c, n in zip(left, noise, strict=True)]
    return shares[chosen]
