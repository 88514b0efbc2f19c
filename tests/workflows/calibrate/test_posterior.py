"""Posteriors, beside those that are known in closed form: of means that are linear in the parameters."""

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.stats

from workflows.calibrate.emulator import Emulators, Predicted
from workflows.calibrate.posterior import Posterior, log_likelihood_of, misfits_of, posterior_of
from workflows.calibrate.targets import Target

SLOPES = np.array([[1.0, 0.5], [0.2, 2.0]])


@dataclass(frozen=True)
class Linear(Emulators):
    """Means SLOPES u, known with a variance of their own."""

    variance: float = 0.0

    def predict(self, shares):
        mean = shares @ SLOPES.T
        return Predicted(mean, np.full_like(mean, self.variance))


def linear(variance=0.0, scatter=(0.0, 0.0), correlation=0.0, freedom=np.inf):
    two = np.array([[1.0, correlation], [correlation, 1.0]])
    own = {"scatter": np.array(scatter), "within": np.zeros(2), "correlation": two, "freedom": np.full(2, freedom)}
    return Linear(("a", "b"), (), np.zeros(2), np.ones(2), **own, residuals=np.zeros((9, 2)), variance=variance)


def targets(errors, runs=None, model_error=0.0):
    truth = SLOPES @ [0.5, 0.4]
    return tuple(Target(n, v, e, runs, model_error) for n, v, e in zip("ab", truth, errors, strict=True))


@pytest.mark.parametrize(
    ("emulators", "given", "covariance"),
    [
        (linear(), targets((0.02, 0.05)), np.diag([0.02**2, 0.05**2])),
        (linear(), targets((2e-4, 5e-4)), np.diag([2e-4**2, 5e-4**2])),  # narrower than points of the prior lie
        (linear(variance=0.03**2), targets((0.04, 0.04)), np.diag([0.05**2] * 2)),
        (linear(), targets((0.03, 0.03), model_error=0.04), np.diag([0.05**2] * 2)),
        (
            linear(scatter=(0.03, 0.06), correlation=0.8),
            targets((None, None), runs=1),
            np.array([[0.0009, 0.8 * 0.0018], [0.8 * 0.0018, 0.0036]]),
        ),
        (linear(scatter=(0.06, 0.06)), targets((None, None), runs=4), np.diag([0.03**2] * 2)),
    ],
    ids=["errors", "narrow", "of the emulator", "of the model", "of one run", "of four runs"],
)
def test_mean_and_covariance_are_those_of_the_closed_form(emulators, given, covariance):
    """With y = S u + e the posterior of an even prior is normal about S^-1 y, with S^-1 C S^-T."""
    posterior = posterior_of(emulators, given, 2, 1, points=2**14)
    inverse = np.linalg.inv(SLOPES)
    exact = inverse @ covariance @ inverse.T
    mean = posterior.weights @ posterior.shares
    apart = posterior.shares - mean
    found = (posterior.weights[:, None] * apart).T @ apart
    np.testing.assert_allclose(mean, [0.5, 0.4], atol=0.03 * np.sqrt(exact.max()))
    np.testing.assert_allclose(found, exact, atol=0.03 * exact.max())


def test_independent_errors_of_a_laboratory_have_no_correlation():
    (squares, _), (apart, _) = (
        misfits_of(Predicted(np.zeros((1, 2)), np.zeros((1, 2))), linear(correlation=c), targets((0.1, 0.1)))
        for c in (0.0, 0.9)
    )
    assert squares == pytest.approx(apart)


def test_the_region_of_95_percent_holds_95_percent_of_planted_parameters():
    """Parameters of the prior, targets with errors: an exact model has an exact coverage."""
    emulators, rng, count = linear(), np.random.default_rng(8), 200
    inside = 0
    for planted in 0.2 + 0.6 * rng.random((count, 2)):
        measured = SLOPES @ planted + 0.05 * rng.standard_normal(2)
        given = tuple(Target(name, value, 0.05) for name, value in zip("ab", measured, strict=True))
        posterior = posterior_of(emulators, given, 2, 1, points=2**10)
        (likelihood,) = log_likelihood_of(emulators.predict(planted[None]), emulators, given)
        inside += posterior.mass_above(likelihood) <= 0.95
    assert abs(inside - 0.95 * count) < 3.0 * np.sqrt(count * 0.95 * 0.05)


def test_a_scatter_found_from_few_runs_has_the_tails_of_student():
    """One target of one run: t = (y - mu)/s with as many degrees of freedom as the scatter has."""
    emulators = linear(scatter=(0.1, 0.1), freedom=5.0)
    given = (Target("a", 0.0, None, runs=1), Target("b", 0.0, None, model_error=1e9, runs=1))
    at = np.array([[0.1, 0.0], [0.3, 0.0], [0.6, 0.0]])
    found = log_likelihood_of(Predicted(at, np.zeros((3, 2))), emulators, given)
    exact = scipy.stats.multivariate_t.logpdf(10.0 * at, shape=np.eye(2), df=5)
    assert np.diff(found) == pytest.approx(np.diff(exact), rel=1e-6)


def test_the_mean_of_draws_is_that_of_the_weights():
    """Within three errors of as many independent draws, though the sequence that fills the prior has periods."""
    middle, deviation = 0.4, 0.05
    shares = scipy.stats.qmc.Sobol(1, rng=np.random.default_rng(1)).random(2**14)
    weights = np.exp(-0.5 * ((shares[:, 0] - middle) / deviation) ** 2)
    none = Predicted(np.zeros((2**14, 1)), np.zeros((2**14, 1)))
    posterior = Posterior(shares, weights / weights.sum(), np.log(weights), none, np.array([[0.0], [1.0]]))
    drawn = [shares[posterior.draws(1024, seed), 0].mean() for seed in range(5)]
    np.testing.assert_allclose(drawn, middle, atol=3.0 * deviation / np.sqrt(1024))


def test_draws_are_as_frequent_as_their_weights():
    posterior = posterior_of(linear(), targets((0.05, 0.05)), 2, 1, points=2**12)
    drawn = posterior.draws(4096, 3)
    assert len(drawn) == 4096
    counts = np.bincount(drawn, minlength=2**12)
    assert np.all(np.abs(counts - 4096 * posterior.weights) <= 1.0)  # what systematic resampling promises
    assert posterior.effective == pytest.approx(1.0 / np.sum((counts / 4096) ** 2), rel=0.1)
