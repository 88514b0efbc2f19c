"""A layer that creeps and fails under an imposed shear stress, on a boundary of constant normal stiffness."""

import os
import signal

import numpy as np
import pytest

from tests.crash.random_kills import differences
from workflows import shear_gouge
from workflows.common import signals

STAGES = [
    {"name": "slide", "velocity": 1.0, "until": {"strain": 0.2}},
    {"name": "creep", "shear_stress": 0.1, "ramp": 2.0, "until": {"time": 20.0}, "sample": {"time": 1.0}},
    {
        **{"name": "fail", "shear_stress": 1.0, "ramp": 10.0, "until": {"time": 100.0, "slip": 0.5}},
        "sample": {"time": 0.5},
    },
    {"name": "again", "velocity": 1.0, "until": {"strain": 0.2}},
]
STIFFNESS = 2e10  # of the spring behind the servo [Pa/m]
PARAMS = shear_gouge.Params(
    layer_thickness=8, length=8, inertial_number=0.01, stages=STAGES, normal_stiffness=STIFFNESS
)


@pytest.fixture(scope="module")
def crept(tmp_path_factory, runtime):
    """(folder, run.nc) of a run through the stages."""
    folder = tmp_path_factory.mktemp("crept") / "run"
    return folder, shear_gouge.run(PARAMS, folder)


def of_stage(run, name):
    return run.isel(time=run.stage.values == name)


def test_a_layer_bears_a_low_stress_and_fails_at_a_high_one(crept):
    _, run = crept
    pressure, size = PARAMS.normal_stress, PARAMS.diameter
    creep, fail = of_stage(run, "creep"), of_stage(run, "fail")
    ends = [float(of_stage(run, name).time[-1]) / PARAMS.inertial_time for name in ("slide", "creep")]
    assert 20.0 <= ends[1] - ends[0] < 21.1  # at the first row after it
    assert creep.imposed_shear_stress.values[0] > 0.1 * pressure  # a ramp from what the layer had borne
    late = creep.isel(time=slice(-5, None))
    assert late.imposed_shear_stress.values == pytest.approx(0.1 * pressure)
    assert late.platen_shear_stress.values.mean() == pytest.approx(0.1 * pressure, rel=0.05)  # it is at rest
    assert abs(late.plate_velocity.values).max() < 0.1 * PARAMS.inertial_number * PARAMS.layer[0] / PARAMS.inertial_time
    assert 0.5 <= fail.stage_slip.values[-1] / size < 1.0  # which ended it before its time
    assert fail.time[-1] - fail.time[0] < 90.0 * PARAMS.inertial_time
    assert fail.imposed_shear_stress.values.max() > 0.5 * pressure
    assert np.all(np.diff(fail.imposed_shear_stress.values[:10]) > 0.0)  # along its ramp
    again = of_stage(run, "again")
    assert np.isnan(again.imposed_shear_stress).all() and np.isnan(of_stage(run, "slide").imposed_shear_stress).all()
    usual = of_stage(run, "slide").instantaneous_plate_velocity.values[-1]
    assert again.instantaneous_plate_velocity.values[-1] == pytest.approx(usual)


def test_the_normal_stress_rises_with_the_thickness(crept):
    _, run = crept
    before = run.isel(time=run.stage_index.values <= 1)
    assert np.all(before.servo_stress == PARAMS.normal_stress)
    sheared = run.isel(time=run.stage_index.values > 1)
    rise = STIFFNESS * (sheared.layer_thickness - before.layer_thickness[-1]).values
    assert np.ptp(rise) > 0.05 * PARAMS.normal_stress
    within = 0.05 * PARAMS.normal_stress  # a row has the mean thickness of its samples, and the stress of the last
    assert sheared.servo_stress.values - PARAMS.normal_stress == pytest.approx(rise, abs=within)
    ratio = sheared.platen_normal_stress.values.mean() / sheared.servo_stress.values.mean()
    assert ratio == pytest.approx(1.0, abs=0.05)


def test_the_energy_is_kept_from_stage_to_stage(crept):
    folder, run = crept
    metrics = shear_gouge.analyse(run, PARAMS)
    assert metrics["energy_residual"].value < 1e-3
    sheared = run.isel(time=run.stage_index.values > 1)
    # The loads did positive work in the failure, and what the platens did went into storage and losses at once.
    changes = np.abs(np.diff(sheared.energy_residual.values))
    assert changes.max() < 1e-3 * float(sheared.work_throughput[-1])
    assert (folder / "run.png").stat().st_size > 10_000


@pytest.mark.validate
def test_a_run_stopped_under_a_stress_goes_on_to_the_same_bits(crept, tmp_path, monkeypatch):
    folder, run = crept
    monkeypatch.setattr(signals, "SAME_REQUEST_S", 0.0)
    previous, rows = signals.install(), []

    def stop_in_creep(report):
        rows.append(report.get("stage"))
        if rows.count("creep") == 7:
            os.kill(os.getpid(), signal.SIGTERM)

    out = tmp_path / folder.name
    try:
        with pytest.raises(signals.Interrupted):
            shear_gouge.run(PARAMS, out, stop_in_creep)
    finally:
        signals.restore(previous)
    shear_gouge.run(PARAMS, out, existing="resume")
    assert differences(out, folder) == []
