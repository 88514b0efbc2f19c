"""A layer that goes through stages: what its file tells of them, and that it can be stopped in any of them."""

import numpy as np
import pytest

from tests.helpers.processes import run_module
from workflows import shear_gouge

STAGES = [
    {"name": "run-in", "velocity": 1.0, "until": {"strain": 0.2}},
    {"name": "up", "velocity": 3.0, "ramp": 1.0, "until": {"slip": 0.3}, "sample": {"time": 0.5}},
    {
        **{"name": "down", "velocity": 1.0, "until": {"slip": 0.3}, "repeat": 3, "repeat_from": "up"},
        "sample": {"time": 0.5, "growth": 1.2, "most": {"strain": 0.02}},
    },
    {"name": "hold", "velocity": 0.0, "until": {"time": 20.0}, "sample": {"time": 1.0}},
    {
        **{"name": "shaken", "velocity": 1.0, "normal_stress": 1.5, "ramp": 2.0, "until": {"strain": 0.1}},
        "oscillate": {"of": "normal_stress", "amplitude": 0.1, "period": 10.0},
    },
]
PARAMS = shear_gouge.Params(layer_thickness=8, length=8, inertial_number=0.01, stages=STAGES)


@pytest.fixture(scope="module")
def staged(tmp_path_factory, runtime):
    """(folder, run.nc) of a run through the stages."""
    folder = tmp_path_factory.mktemp("staged") / "run"
    return folder, shear_gouge.run(PARAMS, folder)


def of_stage(run, name):
    return run.isel(time=run.stage.values == name)


def test_every_row_tells_its_stage_cycle_and_slip(staged):
    _, run = staged
    sheared = run.isel(time=run.stage_index.values > 1)
    places = dict(zip(sheared.stage_index.values.tolist(), zip(sheared.stage.values, sheared.cycle.values)))
    cycles = [(name, cycle) for cycle in (1, 2, 3) for name in ("up", "down")]
    assert list(places.values()) == [("run-in", 0), *cycles, ("hold", 0), ("shaken", 0)]
    for i in places:
        slip = sheared.stage_slip.values[sheared.stage_index.values == i]
        assert slip[0] >= 0.0 and np.all(np.diff(slip) >= 0.0)
    ends = [of_stage(run, name).stage_slip.values.max() / PARAMS.diameter for name in ("up", "down")]
    assert all(0.3 <= end < 0.4 for end in ends)
    assert of_stage(run, "hold").stage_slip.values[-1] < 0.05 * PARAMS.diameter  # of the platen that comes to rest


def test_velocity_and_stress_are_those_of_the_stages(staged):
    _, run = staged
    usual = of_stage(run, "run-in").load_point_velocity.values[-1]
    assert of_stage(run, "up").load_point_velocity.values[-1] == pytest.approx(3.0 * usual)
    assert of_stage(run, "hold").instantaneous_plate_velocity.values[-1] == 0.0
    shaken = of_stage(run, "shaken")
    late = shaken.platen_normal_stress.values[len(shaken.time) // 3 :]
    assert late.mean() == pytest.approx(1.5 * PARAMS.normal_stress, rel=0.05)
    assert np.ptp(late) > 0.1 * PARAMS.normal_stress


def test_the_energy_is_kept_and_stages_have_metrics(staged):
    folder, run = staged
    metrics = shear_gouge.analyse(run, PARAMS)
    assert metrics["energy_residual"].value < 1e-3 and metrics["cycles"].value == 3
    up = of_stage(run, "up")
    assert up.friction.min() < metrics["friction_up_mean"].value < up.friction.max()
    assert metrics["friction_up_se"].value > 0.0
    assert "a single passage" in metrics["friction_hold_se"].note
    assert (folder / "run.png").stat().st_size > 10_000


@pytest.mark.validate
def test_a_run_stopped_in_any_stage_goes_on_to_the_same_bits(staged, tmp_path):
    folder, run = staged
    steps = np.random.default_rng(5).integers(1, round(float(run.time[-1]) / run.dt), 20)
    for of_process in np.array_split(steps, 10):
        lines = run_module("tests.helpers.stopped_runs", folder, tmp_path, *of_process).splitlines()
        assert [line for line in lines if line.startswith("step ")] == [f"step {n}: differs in []" for n in of_process]
