"""The posterior: what targets tell of the parameters, by weights of points that fill the prior evenly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workflows.calibrate.emulator import Emulators, Predicted
from workflows.calibrate.targets import Target

POINTS = 2**16  # that fill the prior
ZOOMS = 6  # at most, into the box outside of which nothing is likely
LEAST_EFFECTIVE = 2.0**-5  # independent points over all points below which one zooms
NEGLIGIBLE = 18.0  # in logarithms below the greatest likelihood: e^-18 = 1.5e-8


@dataclass(frozen=True)
class Posterior:
    """Points with weights.

    Attributes
    ----------
    shares
        (n, d) points of the unit cube of the prior.
    weights
        (n,) posterior probability of each, which sum up to 1.
    log_likelihood
        (n,) of each.
    predicted
        What the emulators give there.
    box
        (2, d) least and greatest corner of the box that the points fill.
    """

    shares: NDArray
    weights: NDArray
    log_likelihood: NDArray
    predicted: Predicted
    box: NDArray

    @property
    def effective(self) -> float:
        """Number of independent draws that would be as good: 1/sum w^2 (Kish 1965)."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def best(self) -> int:
        """Number of the likeliest point."""
        return int(np.argmax(self.log_likelihood))

    def mean_and_deviation(self, values: NDArray) -> tuple[float, float]:
        """Mean and standard deviation over the posterior of what is (n,) at its points."""
        mean = float(np.sum(self.weights * values))
        return mean, float(np.sqrt(np.sum(self.weights * (values - mean) ** 2)))

    def draws(self, count: int, seed: int) -> NDArray:
        """(count,) numbers of points, drawn by their weights at even spacing: systematic resampling.

        Kitagawa (1996), doi:10.2307/1390750. In random order, for the sequence that fills the prior has periods of its
        own, with which an even spacing would beat.
        """
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(self.weights))
        levels = (np.arange(count) + rng.random()) / count
        found = np.searchsorted(np.cumsum(self.weights[order]), levels).clip(0, len(order) - 1)
        return rng.permutation(order[found])

    def mass_above(self, log_likelihood: float) -> float:
        """Probability of all that is likelier: parameters of this likelihood lie on the border of that joint region.

        The region of the probability 0.95 holds what has a `mass_above` of 0.95 at most.
        """
        return float(self.weights[self.log_likelihood > log_likelihood].sum())


def log_likelihood_of(predicted: Predicted, emulators: Emulators, targets: Sequence[Target]) -> NDArray:
    """(n,) logarithm of the probability of the targets at points, but for a constant.

    With q and C of `misfits_of` it is that of Student's t of m metrics, as the scatter is itself found from few runs:

        p = G((nu + m)/2)/G(nu/2) nu^(-m/2) det(C)^(-1/2) (1 + q/nu)^(-(nu + m)/2),

    which becomes the normal one as nu grows.
    """
    from scipy.special import gammaln

    squares, log_determinant = misfits_of(predicted, emulators, targets)
    nu, count = freedom_of(predicted, emulators, targets), len(targets)
    at = np.minimum(nu, 1e8)  # beyond it is normal, to all digits
    shape = gammaln(0.5 * (at + count)) - gammaln(0.5 * at) - 0.5 * count * np.log(at)
    return shape - 0.5 * log_determinant - 0.5 * (at + count) * np.log1p(squares / at)


def freedom_of(predicted: Predicted, emulators: Emulators, targets: Sequence[Target]) -> NDArray:
    """(n,) degrees of freedom of the errors at points, the least of all metrics; by Satterthwaite (1946).

    A sum of variances is known from nu = (sum s_i^2)^2/(sum s_i^4/nu_i): those of the emulator and of the scatter from
    that of the runs, the error of a target from its own, a model_error is certain.
    """
    runs = np.array([target.runs or np.inf for target in targets])
    learned = predicted.variance + emulators.scatter**2 / runs
    own, apart = variances_of(emulators, targets)
    total = predicted.variance + own + apart
    given = np.array([(target.error or 0.0) ** 4 / target.freedom for target in targets])
    with np.errstate(divide="ignore"):
        return np.min(total**2 / (learned**2 / emulators.freedom + given), axis=1)


def misfits_of(predicted: Predicted, emulators: Emulators, targets: Sequence[Target]) -> tuple[NDArray, NDArray]:
    """(n,) squared distances (y - mu)^T C^-1 (y - mu) of the targets from points, and (n,) log det C.

    Targets y of a mean mu(u) are normal with the covariance

        C = R o (a a^T) + diag(b^2),  a^2 = emulator variance + scatter^2/runs + error^2,  b^2 = model_error^2,

    where R is the correlation between the metrics of a run, and o multiplies element by element. The scatter between
    runs enters for a target that is the mean of so many runs. One that is not, as of a laboratory, has none, and its
    error is independent of those of other metrics: it is in b^2 in place of a^2.
    """
    own, apart = variances_of(emulators, targets)
    together = np.sqrt(predicted.variance + own)
    covariance = emulators.correlation * together[:, :, None] * together[:, None, :]
    covariance += np.diag(apart + 1e-12 * emulators.width**2)
    factor = np.linalg.cholesky(covariance)
    missed = np.array([target.value for target in targets]) - predicted.mean
    scaled = np.linalg.solve(factor, missed[:, :, None])[:, :, 0]
    return np.sum(scaled**2, axis=1), 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)


def variances_of(emulators: Emulators, targets: Sequence[Target]) -> tuple[NDArray, NDArray]:
    """(m,) variances of the targets: those that metrics of one run share, and those that are of each alone."""
    own, apart = np.zeros((2, len(targets)))
    for i, target in enumerate(targets):
        apart[i] = target.model_error**2
        if target.runs is None:
            apart[i] += (target.error or 0.0) ** 2
        else:
            error = emulators.within[i] ** 2 / target.runs if target.error is None else target.error**2
            own[i] = emulators.scatter[i] ** 2 / target.runs + error
    return own, apart


def posterior_of(
    emulators: Emulators, targets: Sequence[Target], dimension: int, seed: int, points: int = POINTS
) -> Posterior:
    """The posterior of parameters in the unit cube, whose prior is even there.

    Importance sampling from a scrambled Sobol sequence (Owen 1998): where too few points carry the weight, the sequence
    fills the least box that holds all that is likely, once more. `points` is a power of two.
    """
    from scipy.stats import qmc

    box = np.array([np.zeros(dimension), np.ones(dimension)])
    sequence = qmc.Sobol(dimension, rng=np.random.default_rng(seed)).random(points)
    posterior = _within(box, sequence, emulators, targets)
    for _ in range(ZOOMS):
        if posterior.effective >= LEAST_EFFECTIVE * points:
            break
        likely = posterior.shares[posterior.log_likelihood > posterior.log_likelihood.max() - NEGLIGIBLE]
        # Between two points lies what no point has seen: the mean distance of so many in this box.
        margin = (box[1] - box[0]) * points ** (-1.0 / dimension)
        box = np.array(
            [np.maximum(likely.min(axis=0) - margin, box[0]), np.minimum(likely.max(axis=0) + margin, box[1])]
        )
        posterior = _within(box, sequence, emulators, targets)
    return posterior


def _within(box: NDArray, sequence: NDArray, emulators: Emulators, targets: Sequence[Target]) -> Posterior:
    """The posterior from points of the unit cube (n, d) that are moved into a box (2, d)."""
    shares = box[0] + (box[1] - box[0]) * sequence
    predicted = emulators.predict(shares)
    likelihood = log_likelihood_of(predicted, emulators, targets)
    weights = np.exp(likelihood - likelihood.max())
    return Posterior(shares, weights / weights.sum(), likelihood, predicted, box)
