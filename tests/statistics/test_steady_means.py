"""Steady means: their standard errors against series whose true error is known."""

import math

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

import taichi_lsm as lsm
from taichi_lsm.core.schema import Variable
from taichi_lsm.io.run_file import RunWriter
from taichi_lsm.statistics import Estimate, combine_replicas, difference, steady_ratio, steady_state


def along_strain(values, name="friction", end=5.0):
    """A series over shear strains 0 to `end`."""
    strain = np.linspace(0, end, len(values))
    coords = {"time": np.arange(len(values)) * 0.1, "shear_strain": ("time", strain)}
    return xr.DataArray(values, dims="time", coords=coords, name=name)


def autoregressive(rng, count, memory, replicas):
    """Replicas (replicas, count) of x_t = memory x_(t-1) + noise, stationary from the first sample on."""
    noise = rng.normal(size=(replicas, count + 300))
    return lfilter([1.0], [1.0, -memory], noise, axis=1)[:, 300:]


def coverage(estimates, truth):
    return np.mean([abs(e.mean - truth) < e.half_width for e in estimates if not e.unknown])


@pytest.mark.parametrize(("memory", "count"), [(0.0, 400), (0.5, 400), (0.9, 1500), (-0.5, 400)])
def test_interval_covers_the_true_mean(memory, count):
    replicas = autoregressive(np.random.default_rng(11), count, memory, 300)
    estimates = [steady_state(along_strain(0.4 + x), from_strain=0.0) for x in replicas]
    assert 0.92 < coverage(estimates, 0.4) < 0.98
    true_error = 1 / (1 - memory) / math.sqrt(count)
    assert np.nanmedian([e.standard_error for e in estimates]) == pytest.approx(true_error, rel=0.15)
    independent = count * (1 - memory) / (1 + memory)
    assert np.nanmedian([e.effective_samples for e in estimates]) == pytest.approx(independent, rel=0.2)


def test_ratio_interval_covers_the_true_ratio():
    """A normal stress that fluctuates and carries the shear stress along does not widen the error."""
    rng = np.random.default_rng(5)
    normal = 5.0 + 0.5 * autoregressive(rng, 1500, 0.95, 200)
    noise = 0.02 * autoregressive(rng, 1500, 0.8, 200)
    estimates = [
        steady_ratio(along_strain(0.3 * n + e, "shear"), along_strain(n, "normal"), 0.0)
        for n, e in zip(normal, noise, strict=True)
    ]
    assert 0.92 < coverage(estimates, 0.3) < 0.98
    true_error = 0.02 / (1 - 0.8) / math.sqrt(1500) / 5.0
    assert np.nanmedian([e.standard_error for e in estimates]) == pytest.approx(true_error, rel=0.15)


def test_ratio_of_means_is_not_the_mean_of_ratios():
    top, bottom = np.tile([1.0, 9.0], 50), np.tile([1.0, 3.0], 50)
    ratio = steady_ratio(along_strain(top), along_strain(bottom), 0.0)
    assert ratio.mean == pytest.approx(2.5)


def test_transient_is_left_out():
    """Strain 1.0 itself is the first one that counts; a time axis would cut elsewhere."""
    strain = np.arange(200) / 40
    values = np.where(strain < 1.0, 100.0, 0.5)
    series = xr.DataArray(values, dims="time", coords={"shear_strain": ("time", strain)})
    assert steady_state(series, from_strain=1).mean == 0.5
    assert steady_state(series, from_strain=0.9).mean > 0.5


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (np.full(100, 0.3), "the series is constant"),
        (np.repeat([0.2, 0.4, 0.2, 0.4], 25), "crosses its mean 3 times, at least 10 are needed: shear further"),
        (np.sin(np.arange(100) / 3.0) + np.arange(100) / 50.0, "effective samples, at least 20 are needed: shear"),
    ],
)
def test_an_error_that_the_series_does_not_show_is_unknown(values, reason):
    """An error of 0 would claim that the mean is known exactly."""
    estimate = steady_state(along_strain(values), 0.0)
    assert estimate.mean == pytest.approx(values.mean())
    assert np.isnan([estimate.standard_error, estimate.half_width, *estimate.interval]).all()
    assert reason in estimate.unknown and reason in repr(estimate)


def test_series_of_a_run_file_is_accepted(tmp_path):
    rows = [
        Variable("shear_strain", ("time",), "f64", "1", "strain"),
        Variable("friction", ("time",), "f64", "1", "friction"),
    ]
    writer = RunWriter(tmp_path / "run.nc", rows, {"title": "a"}, auxiliary=("shear_strain",))
    noise = np.random.default_rng(2).normal(size=200)
    for i in range(200):
        writer.append({"time": i, "shear_strain": i / 50, "friction": 0.3 + 0.01 * noise[i]})
    writer.close("complete")
    with xr.open_dataset(tmp_path / "run.nc") as ds:
        estimate = steady_state(ds.friction, from_strain=1)
        assert estimate.mean == pytest.approx(0.3 + 0.01 * noise[50:].mean())
        assert estimate.standard_error == pytest.approx(0.01 / math.sqrt(150), rel=0.3)
        assert steady_ratio(ds.friction, ds.friction).mean == 1.0


@pytest.mark.parametrize(
    ("series", "message"),
    [
        (along_strain(np.ones(5), end=5), "friction: 4 samples from strain 1 .* reached strain 5"),
        (along_strain(np.ones(100), end=0.5), "friction: 0 samples"),
        (along_strain(np.r_[np.ones(50), np.nan, np.ones(49)]), "friction: 1 of 80 samples are not finite"),
        (along_strain(np.ones(50)).drop_vars("shear_strain"), "friction: has no coordinate shear_strain"),
        (along_strain(np.ones(50)).expand_dims(effect=2), "friction: dimensions"),
        (along_strain(np.ones(50), end=np.nan), "friction: shear_strain is not finite"),
    ],
)
def test_useless_series_is_refused(series, message):
    with pytest.raises(lsm.InputError, match=message):
        steady_state(series)


def test_a_plain_array_is_refused_for_it_has_no_strain():
    with pytest.raises(lsm.InputError, match=r"series: ndarray, must be an xarray\.DataArray"):
        steady_state(np.ones(100))


@pytest.mark.parametrize("strain", [math.nan, math.inf])
def test_strain_that_is_no_number_is_refused(strain):
    with pytest.raises(lsm.InputError, match=r"from_strain: (nan|inf), must be a finite"):
        steady_state(along_strain(np.ones(100)), strain)


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (Estimate(0.31234, 0.0040, 57.3), "0.312 +- 0.004, 95 % interval 0.305 to 0.320 (57 effective samples)"),
        (Estimate(0.31234, 0.0042, 8.0, 4.0), "0.3123 +- 0.0042, 95 % interval 0.3007 to 0.3240 (8 effective samples)"),
        (Estimate(12.34, 5.0, 2.0, 1.0), "12 +- 5, 95 % interval -51 to 76 (2 effective samples)"),
        (combine_replicas([0.30, 0.31, 0.32]), "0.3100 +- 0.0058, 95 % interval 0.2852 to 0.3348 (3 runs)"),
        (combine_replicas([0.3], [0.02]), "0.30 +- 0.02, 95 % interval 0.26 to 0.34 (1 run)"),
        (Estimate(-0.15, 0.05), "-0.15 +- 0.05, 95 % interval -0.25 to -0.05"),
        (Estimate(1.5e-8, 2e-9), "1.5e-08 +- 2e-09, 95 % interval 1.10801e-08 to 1.89199e-08"),
        (Estimate(math.nan, math.nan), "nan +- unknown"),
        (Estimate(0.5, math.nan, unknown="too short"), "0.5 +- unknown (too short)"),
    ],
)
def test_printed_estimate_shows_the_digits_that_its_error_leaves(estimate, text):
    assert repr(estimate) == str(estimate) == text


def test_nan_before_the_steady_state_does_no_harm():
    """Friction is not defined before the layer carries load."""
    values = np.full(100, 0.4)
    values[:5] = np.nan
    assert steady_state(along_strain(values)).mean == 0.4


def test_ratio_refuses_other_times_and_a_vanishing_denominator():
    one = along_strain(np.ones(100))
    with pytest.raises(lsm.InputError, match="not on the same times"):
        steady_ratio(one, one.assign_coords(time=one.time + 1))
    with pytest.raises(lsm.InputError, match="the mean is 0"):
        steady_ratio(one, along_strain(np.zeros(100), "normal_stress"))


T2 = 4.3026527  # Student's t of two degrees of freedom, 97.5 %


def test_scatter_between_runs_counts_where_it_is_larger():
    combined = combine_replicas([0.30, 0.34, 0.32], [1e-6, 1e-6, 1e-6])
    assert combined.mean == pytest.approx(0.32)
    assert combined.standard_error == pytest.approx(0.02 / math.sqrt(3))
    assert combined.effective_samples == 3
    assert combined.half_width == pytest.approx(T2 * 0.02 / math.sqrt(3))


def test_runs_that_agree_by_chance_are_no_better_than_their_own_errors():
    """Three runs 0.0005 apart whose own errors are 0.006 to 0.011."""
    errors, samples = [0.006, 0.008, 0.011], [40, 30, 25]
    combined = combine_replicas([0.2652, 0.2657, 0.2662], errors, samples)
    pooled = math.sqrt(np.mean(np.square(errors)) / 3)
    assert combined.standard_error == pytest.approx(pooled)
    nu = sum(e**2 for e in errors) ** 2 / sum(e**4 / (n / 5) for e, n in zip(errors, samples, strict=True))
    assert combined.degrees_of_freedom == pytest.approx(nu)
    assert 2.0 * pooled < combined.half_width < 2.3 * pooled


def test_the_wider_interval_counts_where_the_scatter_is_slightly_smaller():
    """Student's t of two degrees of freedom outweighs the larger error, which is known better."""
    means = [0.30, 0.34, 0.32]
    combined = combine_replicas(means, [0.021] * 3)
    assert combined.standard_error == pytest.approx(0.021 / math.sqrt(3))
    assert combined.half_width == pytest.approx(T2 * 0.02 / math.sqrt(3))


def test_runs_with_unknown_errors_count_by_their_means():
    assert combine_replicas([0.30, 0.34, 0.32], [math.nan] * 3) == combine_replicas([0.30, 0.34, 0.32])
    mixed = combine_replicas([0.300, 0.302, 0.301], [math.nan, 0.01, 0.01])
    assert mixed.standard_error == pytest.approx(0.01 / math.sqrt(3))


def test_a_single_run_has_its_own_error_or_none():
    assert combine_replicas([0.3], [0.01], [50]) == Estimate(0.3, 0.01, 1.0, 10.0, runs=1)
    alone = combine_replicas([0.3], [math.nan])
    assert math.isnan(alone.half_width) and "one run whose own error is unknown" in alone.unknown
    assert "all runs are equal" in combine_replicas([0.3, 0.3]).unknown
    two = combine_replicas([0.414, 0.4145], [math.nan, math.nan])
    assert math.isnan(two.half_width) and "2 runs whose own errors are unknown" in two.unknown
    assert math.isfinite(combine_replicas([0.414, 0.4145]).half_width)  # of which nothing is said


@pytest.mark.parametrize(
    "arguments",
    [([], []), ([0.3],), ([0.3, 0.4], [0.1]), ([0.3, 0.4], None, [9]), ([0.3, np.nan], [0.1, 0.1]), (["a"], [0.1])],
)
def test_incomplete_replicas_are_refused(arguments):
    with pytest.raises(lsm.InputError, match=r"means|standard_errors|effective_samples"):
        combine_replicas(*arguments)


def test_difference_adds_the_variances():
    result = difference(Estimate(0.45, 0.03, 50), Estimate(0.30, 0.04, 60))
    assert result.mean == pytest.approx(0.15) and result.standard_error == pytest.approx(0.05)
    assert result.half_width == pytest.approx(1.959964 * 0.05)
    few = difference(Estimate(0.45, 0.03, 3, 2.0), Estimate(0.30, 0.03, 3, 2.0))
    assert few.degrees_of_freedom == pytest.approx(4.0)  # Welch: equal errors have those of both
    short = difference(Estimate(0.45, 0.03), Estimate(0.3, math.nan, unknown="too short"))
    assert math.isnan(short.half_width) and short.unknown == "too short"
