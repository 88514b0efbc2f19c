"""Healing rates and what steps change in the long run, against synthetic data whose truth is known."""

import math

import numpy as np
import pytest

from taichi_lsm import InputError
from taichi_lsm.statistics import dilatancy_coefficient, healing_rate, steady_rate_dependence

HOLDS = np.geomspace(10.0, 1e4, 10)
BETA, ERRORS = 0.008, np.linspace(0.002, 0.006, 10)


def test_a_line_is_found_exactly():
    found = healing_rate(HOLDS, 0.01 + BETA * np.log(HOLDS), ERRORS)
    assert found.per_e_fold.mean == pytest.approx(BETA) and found.at_unit_time.mean == pytest.approx(0.01)
    assert found.per_decade.mean == pytest.approx(BETA * math.log(10.0))
    assert found.chi_square == pytest.approx(0.0, abs=1e-20) and found.degrees_of_freedom == 8
    covariance = np.linalg.inv(np.array([np.ones(10), np.log(HOLDS)]) / ERRORS**2 @ np.c_[np.ones(10), np.log(HOLDS)])
    assert found.per_e_fold.standard_error == pytest.approx(math.sqrt(covariance[1, 1]))
    assert found.at_unit_time.standard_error == pytest.approx(math.sqrt(covariance[0, 0]))


@pytest.mark.parametrize("known", [True, False])
def test_healing_rates_are_covered(known):
    rng = np.random.default_rng(int(known))
    errors = ERRORS if known else np.full(10, 0.004)
    data = 0.01 + BETA * np.log(HOLDS) + errors * rng.normal(size=(3000, 10))
    found = [healing_rate(HOLDS, y, errors if known else None) for y in data]
    covered = np.mean([abs(f.per_e_fold.mean - BETA) <= f.per_e_fold.half_width for f in found])
    print(f"\nerrors {'known' if known else 'unknown'}: slope covered {covered:.3f}")
    assert covered == pytest.approx(0.95, abs=0.015)
    if known:
        assert np.mean([f.chi_square for f in found]) == pytest.approx(8.0, rel=0.05)


def test_holds_that_tell_nothing_are_refused():
    with pytest.raises(InputError, match="hold_time: 0, must be > 0 s"):
        healing_rate([0.0, 1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="all 5 s"):
        healing_rate([5.0, 5.0, 5.0], [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="errors: 0, must be > 0"):
        healing_rate([1.0, 2.0, 3.0], [1.0, 2.0, 4.0], [0.1, 0.0, 0.1])
    assert "all points lie on the line" in healing_rate([1.0, math.e, math.e**2], [1.0, 2.0, 3.0]).per_e_fold.unknown


def test_dilatancy_of_steps_up_and_down():
    up = np.array([1.0, 0.0, 1.0, 0.0])
    scatter = np.array([0.1, -0.1, -0.1, 0.1]) * 1e-3
    before, after = 0.2 - 1e-3 * up, 0.2 - 1e-3 * (1 - up) + scatter
    found = dilatancy_coefficient(before, after, np.where(up, 1.0, 3.0), np.where(up, 3.0, 1.0))
    assert found.coefficient.mean == pytest.approx(1e-3 / math.log(3.0))
    steps = (1e-3 + np.array([0.1, 0.1, -0.1, -0.1]) * 1e-3) / math.log(3.0)
    assert found.steps == pytest.approx(steps)
    assert found.coefficient.standard_error == pytest.approx(steps.std(ddof=1) / 2.0)
    assert "one cycle" in dilatancy_coefficient(0.2, 0.21, 1.0, 3.0).coefficient.unknown
    with pytest.raises(InputError, match="step 0: "):
        dilatancy_coefficient(0.2, 0.21, 3.0, 3.0)


def test_steady_friction_tells_a_minus_b():
    rng = np.random.default_rng(1)
    slip = np.arange(-1.0, 6.0, 0.05)
    clean = np.where(slip < 0, 0.3, 0.3 - 0.01 * math.log(3.0) + 0.03 * np.exp(-np.maximum(slip, 0.0)))
    held = []
    for _ in range(400):
        friction = clean + 0.01 * rng.normal(size=(12, slip.size)) + 0.01 * rng.normal(size=(12, 1))
        found = steady_rate_dependence(slip, friction, 1.0, 3.0, 5.0)
        held.append(abs(found.mean + 0.01 - 0.03 * math.exp(-5.5) / math.log(3.0)) <= found.half_width)
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)
    with pytest.raises(InputError, match="settled_from: 7 m"):
        steady_rate_dependence(slip, friction, 1.0, 3.0, 7.0)
