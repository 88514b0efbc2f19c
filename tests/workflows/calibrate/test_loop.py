"""Calibrations of a function in place of runs: coverage, batches, failed runs, and what is said of a result."""

import re
from dataclasses import replace

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError, SimulationError
from tests.helpers import analytic_layer as layer
from workflows.calibrate.design import first_design, first_size
from workflows.calibrate.loop import Problem, calibrate, learned
from workflows.calibrate.posterior import log_likelihood_of, posterior_of
from workflows.calibrate.priors import points_at, shares_of
from workflows.calibrate.samples import Sample
from workflows.calibrate.targets import Target
from workflows.calibrate.verdicts import verdicts

TRUE = {"friction": 0.35, "corner_radius": 0.06}
FRICTION, POROSITY = layer.means(TRUE)
TARGETS = (Target("friction_mean", FRICTION, 0.005), Target("porosity", POROSITY, 0.002))
PROBLEM = Problem(layer.PRIORS, TARGETS, points=24, batch=4, resolution=2**11)


def covered(designs, each):
    """(planted parameters within their joint region of 95 %, all) of targets of single runs, over many designs."""
    inside = 0
    for design in range(designs):
        rng = np.random.default_rng(design)
        points = points_at(layer.PRIORS, first_design(48, 2, design))
        samples = [layer.one_run(point, rng) for point in points]
        emulators = learned(replace(PROBLEM, seed=design), samples).emulators
        for shares in rng.random((each, 1, 2)):
            (planted,) = points_at(layer.PRIORS, shares)
            targets = layer.targets_at(planted, rng)
            posterior = posterior_of(emulators, targets, 2, design, points=2**11)
            (likelihood,) = log_likelihood_of(emulators.predict(shares), emulators, targets)
            inside += posterior.mass_above(likelihood) <= 0.95
    return inside, designs * each


def near(inside, count):
    return abs(inside - 0.95 * count) < 3.0 * np.sqrt(count * 0.95 * 0.05)


def test_planted_parameters_lie_in_their_region_in_95_percent():
    assert near(*covered(2, 40))


@pytest.mark.validate
def test_planted_parameters_lie_in_their_region_in_95_percent_of_many():
    inside, count = covered(25, 40)
    print(f"{inside} of {count}")
    assert near(inside, count)


@pytest.fixture(scope="module")
def found():
    """A calibration in batches, of which a few runs fail, with what it told and the points it asked for."""
    told, asked = [], []
    simulate = layer.simulator(1, fails=lambda point: 0.4 < point["friction"] < 0.45)

    def noted(number, points):
        made = points()
        asked.append(made)
        return simulate(number, lambda: made)

    return calibrate(PROBLEM, noted, told.append), told, asked


def test_the_budget_is_spent_in_batches_and_failed_runs_are_told(found):
    result, told, asked = found
    assert [len(points) for points in asked] == [16, 4, 4] and len(told) == 3
    lost = sum(sample.note == "diverged at step 7" for sample in result.samples)
    assert lost > 0 and f"24 of 24 points, {lost} runs gave nothing" in told[-1]
    assert len(result.emulators.residuals) == 24 - lost


def test_the_planted_parameters_are_found_within_the_errors_told(found):
    _, told, _ = found
    for name, true in TRUE.items():
        mean, error = map(float, re.search(rf"{name} ([\d.]+) \+- ([\d.]+)", told[-1]).groups())
        assert abs(mean - true) < 3.0 * error and error < 0.6 * true


def test_later_runs_are_made_where_the_parameters_may_be(found):
    """Their misfit with the targets is far below that of points of the prior."""
    *_, (first, a, b) = found
    apart = [np.median([abs(layer.means(point)[0] - FRICTION) for point in points]) for points in (first, [*a, *b])]
    assert apart[1] < 0.5 * apart[0]
    shares = shares_of(layer.PRIORS, [*a, *b])
    distances = np.linalg.norm(shares[:, None] - shares[None], axis=-1)[np.triu_indices(len(shares), 1)]
    assert distances.min() > 0.0


def test_a_calibration_repeats_itself(found):
    result, _, asked = found
    again = calibrate(PROBLEM, layer.simulator(1, fails=lambda point: 0.4 < point["friction"] < 0.45))
    assert [sample.point for sample in again.samples] == [point for points in asked for point in points]
    assert np.array_equal(again.posterior.weights, result.posterior.weights)


def said_of(targets, samples):
    result = learned(replace(PROBLEM, targets=targets), samples)
    return list(verdicts(result.emulators, result.posterior, targets, layer.PRIORS))


def test_good_targets_need_no_words(found):
    assert said_of(TARGETS, found[0].samples) == []


def test_a_target_out_of_reach_is_told_with_the_nearest_value(found):
    """The greatest friction is 0.5 tanh(2.25) = 0.489, of angular grains."""
    (line,) = said_of((Target("friction_mean", 0.9, 0.01), TARGETS[1]), found[0].samples)
    value, error, away = map(
        float, re.search(r"give friction_mean = 0.9: the nearest is ([\d.]+) \+- ([\d.]+), ([\d.]+) err", line).groups()
    )
    assert value == pytest.approx(0.489, abs=0.04) and error < 0.03
    assert away == pytest.approx((0.9 - value) / np.hypot(error, 0.01), rel=0.05)


def test_targets_that_exclude_each_other_are_told():
    """The friction of angular grains, and a porosity that only round ones have."""
    a, b = ({"friction": 0.85, "corner_radius": c} for c in (0.021, 0.19))
    targets = Target("friction_mean", layer.means(a)[0], 0.001), Target("porosity", layer.means(b)[1], 0.0005)
    samples = [
        Sample(p, dict(zip(PROBLEM.metrics, layer.means(p), strict=True)))
        for p in points_at(layer.PRIORS, first_design(32, 2, 1))
    ]
    (line,) = said_of(targets, samples)
    assert line.startswith("no parameters within the priors give all targets at once: the best, friction = ")


def test_a_posterior_at_the_border_and_one_as_wide_as_its_prior_are_told():
    """Friction that grows by the first parameter alone, and a target at its end."""
    rng = np.random.default_rng(1)
    points = points_at(layer.PRIORS, first_design(32, 2, 1))
    samples = [Sample(p, {"friction_mean": p["friction"] + rng.normal(0.0, 0.01)}) for p in points]
    targets = (Target("friction_mean", 0.9, 0.01),)
    border, wide = said_of(targets, samples)
    assert border.startswith("friction: the posterior lies against the high end of its prior, 0.9")
    assert wide.startswith("corner_radius is not constrained by the targets: its posterior is as wide as its prior, 0.")


def test_a_metric_that_no_run_has_is_named():
    with pytest.raises(InputError, match=r"targets.porsity: no run gave it, must be.*Did you mean porosity"):
        calibrate(replace(PROBLEM, targets=(Target("porsity", 0.2, 0.01),)), layer.simulator(1))


def test_runs_that_all_fail_end_the_calibration():
    with pytest.raises(SimulationError, match=r"0 runs gave all targets, at least 6 are needed"):
        calibrate(PROBLEM, layer.simulator(1, fails=lambda point: True))


@pytest.mark.parametrize(("points", "dimension", "size"), [(60, 2, 32), (64, 2, 32), (24, 2, 16), (6, 2, 6), (5, 1, 4)])
def test_the_first_design_is_about_half(points, dimension, size):
    assert first_size(points, dimension) == size
