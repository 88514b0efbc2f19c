"""Velocity steps: the law that a layer obeys comes out of its run.nc, and a run has its files and goes on."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from workflows import normal_stress_steps, velocity_steps
from workflows.gouge.step_cycles import DOWN, UP, mean_over_cycles

SMALL = {"layer_thickness": 8, "length": 8, "inertial_number": 5e-3, "run_in": 0.1, "cycles": 2, "step_slip": 1.0}
PARAMS = velocity_steps.Params(cycles=12, step_slip=3.0)
A, B, DISTANCE = 0.02, 0.03, 0.4 * PARAMS.diameter
VELOCITY = 1e-3
ROWS = 80


def synthetic(noise=0.002, seed=4):
    """run.nc of a layer that obeys the slip law, with noise, and whose porosity is 1e-3 ln V."""
    rng, length = np.random.default_rng(seed), PARAMS.step_slip * PARAMS.diameter
    plan = [("run-in", VELOCITY, 0)]
    for cycle in range(1, PARAMS.cycles + 1):
        plan += [(UP, 3.0 * VELOCITY, cycle), (DOWN, VELOCITY, cycle)]
    columns = {name: [0.0] for name in ("time", "displacement", "friction", "porosity")}
    columns |= {"load_point_velocity": [0.0], "stage": ["consolidate"], "stage_index": [1], "cycle": [0]}
    before = VELOCITY
    for place, (name, velocity, cycle) in enumerate(plan, 2):
        edges = np.linspace(0.0, length, ROWS + 1)
        middle = 0.5 * (edges[1:] + edges[:-1])
        change = np.zeros(ROWS)
        if velocity != before:
            change = lsm.statistics.friction_after_step(middle, before, velocity, A, B, DISTANCE, "slip")
        level = 0.3 + (A - B) * np.log(before / VELOCITY)
        steps = zip(itertools.pairwise(edges), level + change + noise * rng.normal(size=ROWS), strict=True)
        for (first, last), friction in steps:
            columns["time"].append(columns["time"][-1] + (last - first) / velocity)
            columns["displacement"].append(columns["displacement"][-1] + last - first)
            columns["friction"].append(friction)
            columns["porosity"].append(0.2 + 1e-3 * np.log(velocity))
            columns["load_point_velocity"].append(velocity)
            columns["stage"].append(name), columns["stage_index"].append(place), columns["cycle"].append(cycle)
        before = velocity
    run = xr.Dataset({name: ("time", np.array(values)) for name, values in columns.items()}).set_coords(
        ["time", "stage"]
    )
    return run.assign(platen_shear_stress=run.friction * 5e6, platen_normal_stress=5e6 + 0.0 * run.friction)


def test_the_law_of_a_layer_comes_out_of_its_steps():
    response = velocity_steps.response_of(synthetic(), PARAMS)
    assert response.velocities == pytest.approx({UP: 3.0 * VELOCITY, DOWN: VELOCITY})
    metrics = velocity_steps.analyse(response, PARAMS)
    for name, truth in (("direct_effect", A), ("evolution_effect", B), ("slip_distance", DISTANCE)):
        for suffix in ("", "_slip"):
            low, high = metrics[name + suffix].interval
            assert low - 0.1 * truth < truth < high + 0.1 * truth, name
            assert metrics[name + suffix].value == pytest.approx(truth, rel=0.15)
    assert metrics["law_share"].value > 0.9 and "slip law fits better" in metrics["law_share"].note
    for name in ("rate_dependence", "rate_dependence_steady"):
        assert metrics[name].value == pytest.approx(A - B, abs=4.0 * metrics[f"{name}_se"].value + 3e-4)
    assert metrics["dilatancy_coefficient"].value == pytest.approx(1e-3)
    assert metrics["slip_distance_diameters"].value == pytest.approx(0.4, rel=0.15)
    relaxation = DISTANCE / (3.0 * VELOCITY) / PARAMS.inertial_time
    assert metrics["relaxation_time"].value == pytest.approx(relaxation, rel=0.15)


def test_the_error_of_steady_changes_knows_that_cycles_follow_one_another():
    """Neighbours share an end: of independent cycles the intervals would hold the truth in 84 %."""
    rng, held, plain, trials = np.random.default_rng(3), 0, 0, 300
    for _ in range(trials):
        ends = rng.normal(size=31)
        changes = ends[1:] + ends[:-1]
        held += abs(mean_over_cycles(changes).mean) < mean_over_cycles(changes).half_width
        plain += abs(changes.mean()) < lsm.statistics.combine_replicas(changes).half_width
    assert held / trials > 0.9 > 0.87 > plain / trials
    alternating = np.tile([1.0, -1.0], 6) + 0.1 * rng.normal(size=12)  # which is not told to be better known
    assert mean_over_cycles(alternating).standard_error == lsm.statistics.combine_replicas(alternating).standard_error
    assert "equal" in mean_over_cycles(np.ones(4)).unknown


def test_a_layer_that_does_not_change_has_no_law():
    still = synthetic()
    still["platen_shear_stress"] = (
        0.3 * still.platen_normal_stress * (1.0 + 1e-4 * np.sin(7.0 * still.time / still.time[1]))
    )
    metrics = velocity_steps.analyse(velocity_steps.response_of(still, PARAMS), PARAMS)
    assert abs(metrics["direct_effect"].value) < 1e-3 and abs(metrics["rate_dependence_steady"].value) < 1e-4
    assert metrics["slip_distance"].interval is None and "unknown" in metrics["slip_distance_se"].note


def test_a_platen_that_oscillates_on_its_spring_is_told():
    """Of whose inertia the fit knows nothing: its period is 2 pi sqrt(M/K), M a twentieth of the layer's mass."""
    soft, stiff = (PARAMS.model_copy(update={"load_stiffness_ratio": ratio}) for ratio in (0.1, 1e4))
    mass = 0.05 * 0.8 * soft.density * soft.area * soft.layer[0]
    thin = soft.model_copy(update={"layer_thickness": 8.0})  # the row of discs of whose platen has more mass
    row = np.pi / 4.0 * thin.density * thin.area * thin.diameter
    for params, moved in ((soft, mass), (thin, row)):
        period = 2.0 * np.pi * np.sqrt(moved / params.spring) / params.inertial_time
        assert params.spring_period == pytest.approx(period)
    assert PARAMS.spring_period is None and soft.spring_period == pytest.approx(316.2 * stiff.spring_period, rel=1e-3)
    response = velocity_steps.response_of(synthetic(), PARAMS)
    response = replace(response, velocities={stage: 1e3 * v for stage, v in response.velocities.items()})  # 6 t_i
    for params, told in ((soft, True), (stiff, False), (PARAMS, False)):
        metrics = velocity_steps.analyse(response, params)
        for name in ("direct_effect", "evolution_effect", "slip_distance", "direct_effect_ageing"):
            assert ("oscillates on its spring" in metrics[name].note) == told, (name, told)
        assert "oscillates" not in (metrics["rate_dependence_steady"].note or "")


@pytest.fixture(scope="module")
def stepped(runtime, tmp_path_factory):
    """(folder, run.nc) of a small run."""
    folder = tmp_path_factory.mktemp("stepped") / "run"
    return folder, velocity_steps.run(velocity_steps.Params(keep_checkpoint=True, **SMALL), folder)


def test_a_run_has_its_stacks_pictures_and_metrics(stepped):
    folder, run = stepped
    names = {path.name for path in folder.iterdir()}
    assert {"run.nc", "grains.nc", "cycles.nc", "run.png", "steps.png", "summary.json", "config.toml"} <= names
    up = xr.open_dataset(folder / "cycles.nc", group="up")
    assert up.friction.dims == ("cycle", "slip_since_step") and list(up.cycle.values) == [1, 2]
    assert up.slip_since_step.attrs["units"] == "m" and up.platen_friction.attrs["units"] == "1"
    inside = up.slip_since_step.values > 0.0
    fast = run.load_point_velocity.values[run.stage.values == UP][-1]
    late = up.plate_velocity.values[:, inside][:, -5:]
    assert late == pytest.approx(np.full(late.shape, fast), rel=1e-6)
    assert fast / run.load_point_velocity.values[run.stage.values == DOWN][-1] == pytest.approx(3.0)
    summary = lsm.open_run(folder / "run.nc").attrs
    assert summary["run_status"] == "complete"


@pytest.mark.validate
def test_a_run_goes_on_with_more_cycles_to_the_bits_of_a_longer_one(stepped, tmp_path):
    folder, _ = stepped
    more = velocity_steps.Params(keep_checkpoint=True, **SMALL | {"cycles": 3})
    longer = velocity_steps.run(more, folder, existing="resume")
    whole = velocity_steps.run(more, tmp_path / "whole")
    for name in ("time", "friction", "displacement", "energy_residual", "cycle", "stage_slip"):
        assert np.array_equal(longer[name].values, whole[name].values, equal_nan=True), name
    with pytest.raises(lsm.InputError, match=r"--cycles 2: must be >= 3, that of the run"):
        velocity_steps.run(velocity_steps.Params(**SMALL), folder, existing="resume")


@pytest.mark.validate
def test_the_normal_stress_of_a_layer_is_stepped(runtime, tmp_path):
    params = normal_stress_steps.Params(stress_ratio=1.5, ramp=1.0, **SMALL)
    run = normal_stress_steps.run(params, tmp_path)
    stress = {s: run.platen_normal_stress.values[run.stage.values == s][-5:].mean() for s in (UP, DOWN)}
    assert stress[UP] / stress[DOWN] == pytest.approx(1.5, rel=0.1)
    assert {"cycles.nc", "steps.png"} <= {path.name for path in tmp_path.iterdir()}


def test_steps_too_short_to_be_seen_are_refused_before_the_run():
    with pytest.raises(lsm.InputError, match=r"step_slip = 0\.1: must be >= .*so that a stage takes 8 inertial times"):
        velocity_steps.Params(step_slip=0.1)
    normal_stress_steps.Params(step_slip=0.25)  # at one velocity


def test_changes_with_the_normal_stress_are_told_per_ln_of_it():
    params = normal_stress_steps.Params(cycles=12, step_slip=3.0, stress_ratio=2.0)
    run = synthetic(noise=0.0)
    stacks = normal_stress_steps.stacks_of(run, params)
    metrics = normal_stress_steps.analyse(stacks, params)
    assert metrics["porosity_change"].value == pytest.approx(1e-3 * np.log(3.0) / np.log(2.0))
    assert metrics["friction_change"].value == pytest.approx((A - B) * np.log(3.0) / np.log(2.0), rel=0.05)
    # Soon after a step up friction departs by nearly all of the direct effect.
    assert 0.7 * A * np.log(3.0) < metrics["transient_up"].value < A * np.log(3.0)
    assert metrics["transient_slip_up"].value < 0.1
