"""Rate and state after a velocity step: closed forms against the ODE, and fits of data without and with noise."""

import math

import numpy as np
import pytest

from taichi_lsm import InputError
from taichi_lsm.statistics import (
    compare_laws,
    fit_velocity_step,
    friction_after_step,
    log_state_after_step,
    spring_slider,
)
from taichi_lsm.statistics.step_stack import behind_spring

A, B, DISTANCE, RATIO = 0.015, 0.02, 0.8, 3.0
SLIP = np.arange(-1.0, 6.0, 0.1) + 0.05
LAWS = ("ageing", "slip")


@pytest.mark.parametrize("law", LAWS)
def test_closed_forms_obey_their_laws(law):
    """d ln(V theta/D_c)/dx of (2) and (3) at constant V, by central differences."""
    x, step = np.linspace(0.1, 3.0, 30), 1e-5
    state = log_state_after_step(x, math.log(RATIO), DISTANCE, law)
    slope = np.subtract(*(log_state_after_step(x + d, math.log(RATIO), DISTANCE, law) for d in (step, -step))) / (
        2 * step
    )
    expected = np.exp(-state) - 1.0 if law == "ageing" else -state
    assert slope == pytest.approx(expected / DISTANCE, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_the_direct_effect_comes_first_and_a_minus_b_stays(law):
    f = friction_after_step([-0.1, 0.0, 40.0], 1.0, RATIO, A, B, DISTANCE, law)
    assert f == pytest.approx([0.0, A * math.log(RATIO), (A - B) * math.log(RATIO)], abs=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_a_stiff_spring_is_an_imposed_velocity(law):
    stiff = spring_slider(SLIP, 1.0, RATIO, A, B, DISTANCE, 1e4, law)
    assert stiff == pytest.approx(friction_after_step(SLIP, 1.0, RATIO, A, B, DISTANCE, law), abs=2e-6)


@pytest.mark.parametrize("law", LAWS)
def test_a_soft_spring_smears_the_step(law):
    """A load point that has just jumped loads the spring at k (1 - 1/r): the slope of friction at the step."""
    soft = spring_slider([0.0, 1e-4, 50.0, 400.0], 1.0, RATIO, A, B, DISTANCE, 0.1, law)
    assert soft[1] == pytest.approx(0.1 * (1.0 - 1.0 / RATIO) * 1e-4, rel=1e-3)
    assert soft[3] == pytest.approx((A - B) * math.log(RATIO), abs=1e-7)


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 100.0])
@pytest.mark.parametrize("law", LAWS)
def test_the_spring_of_the_fit_is_that_of_the_ode(law, stiffness):
    parameters = np.array([[A, B, math.log(DISTANCE)]])
    fast = behind_spring(SLIP, RATIO, parameters, stiffness, law, 0.04)[0]
    exact = spring_slider(SLIP, 1.0, RATIO, A, B, DISTANCE, stiffness, law)
    assert fast == pytest.approx(exact, abs=5e-3 * B)


def stack(law, noise, cycles=10, stiffness=math.inf):
    """(cycle, sample) about a step, white noise."""
    step = (1.0, RATIO, A, B, DISTANCE)
    clean = (
        friction_after_step(SLIP, *step, law) if math.isinf(stiffness) else spring_slider(SLIP, *step, stiffness, law)
    )
    return 0.3 + clean + noise * np.random.default_rng(1).normal(size=(cycles, SLIP.size))


@pytest.mark.parametrize("stiffness", [math.inf, 0.2])
@pytest.mark.parametrize("law", LAWS)
def test_parameters_are_found(law, stiffness):
    friction = stack(law, 1e-5, stiffness=stiffness) + 0.002 * SLIP
    fit = fit_velocity_step(SLIP, friction, 1.0, RATIO, law, stiffness=stiffness, trend=True, resamples=50)
    values = [fit.a.value, fit.b.value, fit.slip_distance.value, fit.rate_dependence.value]
    assert values == pytest.approx([A, B, DISTANCE, A - B], rel=0.02)
    assert fit.law == law and not fit.slip_distance.unknown
    without = fit_velocity_step(SLIP, friction, 1.0, RATIO, law, stiffness=stiffness, resamples=50)
    assert without.a.value > 1.1 * A and without.chi_square > 1e3 * without.degrees_of_freedom


def test_the_right_law_is_told_where_noise_allows():
    both = np.stack([stack("slip", 1e-3), -stack("slip", 1e-3)], axis=1)
    down = 0.3 + friction_after_step(SLIP, RATIO, 1.0, A, B, DISTANCE, "slip")
    both[:, 1] = down + 1e-3 * np.random.default_rng(2).normal(size=(10, SLIP.size))
    told = compare_laws(SLIP, both, [1.0, RATIO], [RATIO, 1.0], resamples=100)
    assert told.better == "slip" and told.share >= 0.95 and told.chi_square_difference > 10.0 and not told.unknown
    assert told.slip.chi_square == pytest.approx(told.slip.degrees_of_freedom, rel=0.4)
    vague = compare_laws(SLIP, stack("slip", 0.02), 1.0, RATIO, resamples=100)
    assert "of the resampled stacks only" in vague.unknown


def test_what_the_data_do_not_tell_is_unknown():
    few = fit_velocity_step(SLIP, stack("slip", 1e-3, cycles=5), 1.0, RATIO, "slip")
    assert math.isnan(few.a.standard_error) and "5 cycles, at least 8" in few.a.unknown
    noise = 0.3 + 0.02 * np.random.default_rng(4).normal(size=(10, SLIP.size))
    lost = fit_velocity_step(SLIP, noise, 1.0, RATIO, "slip")
    assert not lost.a.unknown and (
        "b is not told from 0" in lost.slip_distance.unknown or "beyond" in lost.slip_distance.unknown
    )
    short = SLIP < 0.6  # less slip than D_c/2 after the step
    slow = 0.3 + friction_after_step(SLIP, 1.0, RATIO, A, B, 8.0, "slip")[short]
    slow = slow + 1e-4 * np.random.default_rng(5).normal(size=(10, short.sum()))
    assert "beyond 0.05 to 1.1 m" in fit_velocity_step(SLIP[short], slow, 1.0, RATIO, "slip").slip_distance.unknown


def test_stacks_that_do_not_fit_are_refused():
    good = stack("slip", 1e-3)
    with pytest.raises(InputError, match="law: 'other'"):
        fit_velocity_step(SLIP, good, 1.0, RATIO, "other")
    with pytest.raises(InputError, match="differ in every step"):
        fit_velocity_step(SLIP, good, 1.0, 1.0)
    with pytest.raises(InputError, match="5 samples on each side"):
        fit_velocity_step(SLIP + 10.0, good, 1.0, RATIO)
    with pytest.raises(InputError, match="slip: value 1 "):
        fit_velocity_step(SLIP[::-1], good, 1.0, RATIO)
    good[3, 4] = np.nan
    with pytest.raises(InputError, match="friction: 1 of 700 values are not finite"):
        fit_velocity_step(SLIP, good, 1.0, RATIO)
