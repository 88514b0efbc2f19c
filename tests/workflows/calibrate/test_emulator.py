"""Emulators: the scatter they learn, what they know of the mean, and how the metrics of a run go together."""

import sys

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError, SimulationError
from tests.helpers import analytic_layer as layer
from workflows.calibrate.design import first_design
from workflows.calibrate.emulator import emulators_of
from workflows.calibrate.priors import points_at
from workflows.calibrate.samples import Sample, sample_of, variances_within

RUNS = 64
METRICS = ("friction_mean", "porosity")


@pytest.fixture(scope="module")
def learned():
    """Emulators of runs of the analytic layer, and their points."""
    shares = first_design(RUNS, 2, 1)
    rng = np.random.default_rng(2)
    samples = [layer.one_run(point, rng) for point in points_at(layer.PRIORS, shares)]
    return emulators_of(shares, samples, METRICS, 1)


def test_the_scatter_between_seeds_is_found(learned):
    """Of 64 runs, less some ten for the surface, a deviation is known to 1/sqrt(2 54) = 10 %."""
    np.testing.assert_allclose(learned.scatter, layer.SCATTER, rtol=0.3)


def test_means_are_missed_by_as_much_as_is_said(learned):
    shares = np.random.default_rng(5).random((200, 2))
    predicted = learned.predict(shares)
    true = np.array([layer.means(point) for point in points_at(layer.PRIORS, shares)])
    missed = (predicted.mean - true) / np.sqrt(predicted.variance)
    assert np.all(np.sqrt(predicted.variance) < 0.8 * layer.SCATTER)  # better than one run
    assert np.all((np.sqrt((missed**2).mean(axis=0)) > 0.3) & (np.sqrt((missed**2).mean(axis=0)) < 2.0))


def test_runs_left_out_are_missed_by_one_predicted_deviation(learned):
    """As a check against the direct way: the emulator is fitted, with the same kernel, to all runs but one."""
    assert np.all(np.abs(np.sqrt((learned.residuals**2).mean(axis=0)) - 1.0) < 0.25)
    process = learned.processes[0]
    values, covariance = process.y_train_, process.kernel_(process.X_train_) + np.diag(np.full(RUNS, 1e-10))
    others = np.arange(RUNS) != 7
    solved = np.linalg.solve(covariance[np.ix_(others, others)], covariance[others, 7])
    deviation = np.sqrt(covariance[7, 7] - covariance[7, others] @ solved)
    assert learned.residuals[7, 0] == pytest.approx((values[7] - values[others] @ solved) / deviation, rel=1e-6)


def test_metrics_of_a_run_that_go_together_are_found(learned):
    """A correlation of 64 pairs is known to (1 - r^2)/8 = 0.08, and shrunk somewhat."""
    assert learned.correlation[0, 1] == pytest.approx(layer.CORRELATED, abs=0.25)
    assert np.all(np.diag(learned.correlation) == pytest.approx(1.0))


def test_known_errors_of_runs_are_no_scatter():
    """Runs whose own errors explain all that differs between them."""
    shares, rng = first_design(RUNS, 1, 1), np.random.default_rng(4)
    samples = [
        Sample({}, {"friction_mean": share + rng.normal(0.0, 0.05), "friction_se": 0.05}) for share in shares[:, 0]
    ]
    learned = emulators_of(shares, samples, ("friction_mean",), 1)
    assert learned.scatter[0] < 0.025 and learned.within[0] == pytest.approx(0.05)


def test_unknown_errors_count_as_the_mean_of_the_known_ones():
    samples = [Sample({}, {"a_mean": 1.0, "a_se": 0.1}), Sample({}, {"a_mean": 1.0})]
    assert variances_within(samples, "a_mean") == pytest.approx([0.01, 0.01])
    assert variances_within(samples, "porosity").tolist() == [0.0, 0.0]


def test_a_sample_has_the_numbers_of_a_summary():
    entries = {"friction_mean": {"value": 0.4, "unit": "1"}, "friction_se": {"value": None, "unit": "1"}}
    sample = sample_of({"friction": 0.5}, entries)
    assert sample.has(["friction_mean"]) and not sample.has(["friction_se"])
    assert np.isnan(sample.error("friction_mean"))


def test_too_few_runs_are_told():
    with pytest.raises(SimulationError, match=r"5 runs gave all targets, at least 6 are needed for 2 parameters"):
        emulators_of(np.zeros((5, 2)), [Sample({}, {"a": 1.0})] * 5, ("a",), 1)


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.gaussian_process", None)
    with pytest.raises(InputError, match=r"needs sklearn, which is not installed; pip install 'taichi-lsm\[calibra"):
        emulators_of(np.random.default_rng(1).random((6, 2)), [Sample({}, {"a": 1.0})] * 6, ("a",), 1)
