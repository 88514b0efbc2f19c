"""Rate-and-state friction against closed forms: steady state, velocity steps, holds, and what each step must solve."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.helpers.sliders import Sliders

MU_0, A, B, D_C, V_0 = 0.6, 0.01, 0.015, 1e-2, 1e-3
STIFF = 1e8  # [N/m]: the spring of the contact takes 1e-6 of D_c
COUNT = 41
pytestmark = pytest.mark.usefixtures("runtime")
fine = pytest.mark.skipif(scenes.PRECISION == "f32", reason="parts of a slip distance to 1e-6 need f64")


def effect(evolution="ageing", stiffness=STIFF, b=B):
    return lsm.effects.RateAndStateFriction(MU_0, A, b, D_C, V_0, stiffness, evolution)


@pytest.fixture(scope="module")
def sliders(runtime):
    """{evolution: sliders of this friction}, in 2D and 3D."""
    return {
        "ageing": Sliders(effect("ageing"), COUNT, dim=2),
        "slip": Sliders(effect("slip"), COUNT, dim=3),
    }


def steady(v):
    return MU_0 + (A - B) * np.log(v / V_0)


def slide(bench, velocity, distance, steps):
    """Force [N] after this much slip [m] at this velocity [m s-1], one or many."""
    bench.set(load=velocity, dt=distance / steps / np.asarray(velocity))
    bench.slide(steps)
    return bench.force.to_numpy()


@scenes.both_precisions
@pytest.mark.parametrize("evolution", ["ageing", "slip"])
def test_steady_state_over_twenty_decades(sliders, evolution):
    bench = sliders[evolution]
    bench.set(history=0.0)
    v = V_0 * np.logspace(-10, 10, COUNT)
    for _ in range(4):  # the contact comes near in few long steps: those are solved as well
        slide(bench, v, 10 * D_C, 10)
    assert slide(bench, v, 20 * D_C, 400) == pytest.approx(steady(v), abs=scenes.tolerance(1e-9))
    state = bench.history.to_numpy()[:, -1]
    assert state == pytest.approx(np.log(V_0 / v), abs=scenes.tolerance(1e-9))
    # what is lost is the work of friction, over the slip
    bench.set(lost=0.0)
    slide(bench, v, 5 * D_C, 100)
    assert bench.lost.to_numpy() == pytest.approx(steady(v) * 5 * D_C, rel=scenes.tolerance(1e-6, 1e-3))


@fine
@pytest.mark.parametrize("evolution", ["ageing", "slip"])
def test_velocity_step_jumps_by_a_and_decays_over_the_slip_distance(sliders, evolution):
    bench = sliders[evolution]
    ratio = np.logspace(-2, 2, COUNT)
    before = steady(V_0)

    def stepped(slips):
        bench.set(history=0.0)
        slide(bench, np.full(COUNT, V_0), 30 * D_C, 300)
        assert bench.force.to_numpy() == pytest.approx(before, abs=1e-9)
        return [slide(bench, ratio * V_0, slip * D_C, steps) for slip, steps in slips]

    jump = stepped([(2e-6, 200)])[0]
    assert jump - before == pytest.approx(A * np.log(ratio), abs=1e-5)
    slips = np.array([0.1, 0.5, 1.0, 3.0])
    for mu, slip in zip(stepped([(d, 2000) for d in np.diff(slips, prepend=0)]), slips, strict=True):
        if evolution == "ageing":
            expected = steady(ratio * V_0) + B * np.log(1 + (ratio - 1) * np.exp(-slip))
        else:
            expected = steady(ratio * V_0) + B * np.log(ratio) * np.exp(-slip)
        assert mu == pytest.approx(expected, abs=5e-5)
    assert np.ptp(slide(bench, ratio * V_0, 60 * D_C, 600) - steady(ratio * V_0)) < 1e-9


@fine
def test_healing_grows_by_b_per_logarithm_of_the_hold(sliders):
    bench = sliders["ageing"]
    hold = np.logspace(3, 7, COUNT) * D_C / V_0
    bench.set(history=0.0)
    slide(bench, np.full(COUNT, V_0), 30 * D_C, 300)
    at = np.geomspace(1e-11, 1, 600)
    for share in np.diff(at, prepend=0.0):
        bench.set(load=0.0, dt=share * hold)
        bench.slide(1)
    relaxed = bench.force.to_numpy()
    slide(bench, np.full(COUNT, V_0), 1e-2 * D_C, 20_000)
    peak = bench.highest.to_numpy()
    assert np.all(np.diff(relaxed) < 0) and relaxed.max() < MU_0  # contacts creep while they are held
    slope = np.diff(peak) / np.diff(np.log(hold))
    assert slope == pytest.approx(B, rel=0.01)


@fine
@pytest.mark.parametrize("evolution", ["ageing", "slip"])
def test_every_step_solves_the_friction_law_at_any_rate(sliders, evolution):
    """Random springs, states, steps and velocities: rate and state after a step obey both equations."""
    bench, rng = sliders[evolution], np.random.default_rng(4)
    k_t, solved = 100.0, 0
    bench.effect.write_parameters(effect(evolution, k_t))
    sign = -1.0 if bench.dim == 2 else 1.0  # the spring is measured along the normal (0, 1) turned by 90 degrees
    for _ in range(60):
        dt = 10 ** rng.uniform(-8, 3, COUNT) * D_C / V_0
        state = rng.uniform(-20, 20, COUNT)
        spring = 10 ** rng.uniform(-4, 0.3, COUNT) * MU_0 / k_t
        history = np.zeros((COUNT, bench.size))
        history[:, 0], history[:, -1] = sign * spring, state
        velocity = 10 ** rng.uniform(-6, 2, COUNT) * D_C / dt
        bench.set(history=history, dt=dt, load=velocity, lost=0.0)
        bench.slide(1)
        after = bench.history.to_numpy()
        trial = spring + velocity * dt
        slip = trial - sign * after[:, 0]
        assert np.all(slip >= 0) and np.all(bench.force.to_numpy() >= 0)
        known = slip > 1e-9 * trial  # else the slip is lost in the rounding of the spring
        v, x = (slip / dt)[known], (slip / D_C)[known]
        if evolution == "ageing":
            expected = np.logaddexp(state[known] - x, np.log(-np.expm1(-x) * V_0 / v))
        else:
            expected = -np.log(v / V_0) + (state[known] + np.log(v / V_0)) * np.exp(-x)
        assert after[known, -1] == pytest.approx(expected, abs=1e-5)
        mu = A * np.arcsinh(0.5 * v / V_0 * np.exp((MU_0 + B * after[known, -1]) / A))
        assert bench.force.to_numpy()[known] == pytest.approx(mu, abs=1e-6)
        solved += known.sum()
    assert solved > 10 * COUNT
    bench.effect.write_parameters(effect(evolution))


def test_refusals():
    for place, name in enumerate(
        ("reference_coefficient", "direct_effect", "evolution_effect", "slip_distance", "reference_velocity")
    ):
        values = [MU_0, A, B, D_C, V_0]
        values[place] = -1.0
        with pytest.raises(lsm.InputError, match=rf"RateAndStateFriction\.{name} = -1.0: must be >"):
            lsm.effects.RateAndStateFriction(*values, 1.0)
    with pytest.raises(lsm.InputError, match=r"evolution = 'other': must be 'ageing' or 'slip'"):
        lsm.effects.RateAndStateFriction(MU_0, A, B, D_C, V_0, 1.0, "other")
