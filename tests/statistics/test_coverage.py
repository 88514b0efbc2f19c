"""Intervals of 95 % cover the truth as often as they say: of few runs, of differences, and of short series."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

from taichi_lsm.statistics import combine_replicas, difference, steady_state

TRIALS = 4000  # the share that is covered is known to 0.0035
SAMPLES = 30  # independent samples within each run
FREEDOM = SAMPLES / 5  # of the error within each run


def replicas(rng, count, ratio, skewness=0.0):
    """(means, errors) of runs that scatter by `ratio` times their own error of 1 beside that error."""
    between = rng.normal(size=(TRIALS, count))
    if skewness:  # a gamma distribution of mean 0 and variance 1
        shape = 4.0 / skewness**2
        between = (rng.gamma(shape, size=(TRIALS, count)) - shape) / np.sqrt(shape)
    means = ratio * between + rng.normal(size=(TRIALS, count))
    return means, np.sqrt(rng.chisquare(FREEDOM, size=(TRIALS, count)) / FREEDOM)


def estimates_of(means, errors):
    samples = np.full(means.shape[1], SAMPLES)
    return [combine_replicas(m, e, samples) for m, e in zip(means, errors, strict=True)]


def covered(estimates, truth=0.0):
    """Share of the intervals that hold the truth."""
    return np.mean([abs(e.mean - truth) <= e.half_width for e in estimates])


@pytest.mark.parametrize("skewness", [0.0, 0.5])
@pytest.mark.parametrize("count", [2, 3, 4, 8])
def test_few_runs_that_differ_are_covered_in_95_per_cent(count, skewness):
    """Between-seed scatter of three and of ten times the error within runs."""
    rng = np.random.default_rng(count)
    for ratio in (3.0, 10.0):
        assert covered(estimates_of(*replicas(rng, count, ratio, skewness))) == pytest.approx(0.95, abs=0.02), ratio


@pytest.mark.parametrize(("count", "most"), [(2, 0.998), (3, 0.992), (4, 0.987), (8, 0.982)])
def test_few_runs_that_do_not_differ_are_covered_in_more(count, most):
    """The wider of two intervals of 95 % covers more than each of them does, the more so the fewer the runs."""
    rng = np.random.default_rng(count)
    for ratio in (0.0, 1.0):
        assert 0.95 < covered(estimates_of(*replicas(rng, count, ratio))) < most, ratio


@pytest.mark.parametrize(("ratio", "least"), [(1.0, 0.95), (3.0, 0.91), (10.0, 0.87)])
def test_exponential_scatter_between_runs_costs_coverage(ratio, least):
    """Student's interval of means as skewed as these covers less; docs/conventions.md states how much."""
    found = [covered(estimates_of(*replicas(np.random.default_rng(n), n, ratio, 2.0))) for n in (2, 3, 4, 8)]
    assert least < min(found) and max(found) < 0.99


@pytest.mark.parametrize("count", [2, 3, 8])
def test_differences_of_few_runs_are_covered(count):
    rng = np.random.default_rng(7)
    pairs = [estimates_of(*replicas(rng, count, ratio)) for ratio in (1.0, 4.0)]
    apart = [difference(a, b) for a, b in zip(*pairs, strict=True)]
    assert covered(apart) == pytest.approx(0.95, abs=0.02)


def autoregressive(rng, memory, shape):
    noise = rng.normal(size=(shape[0], shape[1] + 600))
    return np.sqrt(1.0 - memory**2) * lfilter([1.0], [1.0, -memory], noise, axis=1)[:, 600:]


def telegraph(rng, memory, shape):
    """-1 and 1 at random; the correlation falls by `memory` from row to row."""
    switches = np.cumsum(rng.random(shape) < (1.0 - memory) / 2.0, axis=1)
    return rng.choice([-1.0, 1.0], size=(shape[0], 1)) * np.where(switches % 2, -1.0, 1.0)


def skewed(rng, memory, shape):
    return np.exp(0.5 * autoregressive(rng, memory, shape)) - np.exp(0.125)


def series(kind, independent, rows=100, count=400):
    """(count, rows) of series that hold so many independent samples each."""
    memory = (rows / independent - 1.0) / (rows / independent + 1.0)
    return kind(np.random.default_rng(independent), memory, (count, rows))


def steady(values):
    strain = ("time", np.linspace(0.0, 1.0, len(values)))
    return steady_state(xr.DataArray(values, dims="time", coords={"shear_strain": strain}), 0.0)


@pytest.mark.parametrize("kind", [autoregressive, telegraph, skewed])
def test_series_of_twenty_independent_samples_are_covered(kind):
    found = [steady(values) for independent in (20, 30, 60) for values in series(kind, independent)]
    known = [estimate for estimate in found if not estimate.unknown]
    assert len(known) > 0.7 * len(found)
    assert covered(known) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("kind", [autoregressive, telegraph, skewed])
def test_shorter_series_are_mostly_unknown_and_seldom_wrong(kind):
    for independent, most in ((4, 0.1), (10, 0.3)):
        found = [steady(values) for values in series(kind, independent)]
        known = [estimate for estimate in found if not estimate.unknown]
        assert len(known) < most * len(found), independent
        assert sum(abs(e.mean) > e.half_width for e in known) < 0.08 * len(found), independent
