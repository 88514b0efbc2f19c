"""Stick-slip: events and their energies of a run whose spring and slips are known, and of a small layer."""

import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from workflows import stick_slip
from workflows.common.parameters import ParameterError

PARAMS = stick_slip.Params(load_stiffness_ratio=0.02)
LOAD, ROW = 1e-3, 1e-6  # velocity of the load point [m s-1], time from row to row [s]
PERIOD, FAST = 400, 6  # rows from event to event, and of an event


def saw_tooth(events=8):
    """run.nc of a layer that sticks, and slips in 6 rows by what the load point gained; a fifth is damped away."""
    spring, rng = PARAMS.spring, np.random.default_rng(2)
    rows = events * PERIOD + PERIOD // 2
    velocity = 1e-4 * LOAD * rng.normal(size=rows)
    for k in range(events):
        begin = (k + 1) * PERIOD - FAST
        velocity[begin : begin + FAST] += PERIOD * LOAD / FAST
    slip = np.cumsum(velocity) * ROW
    load = (np.arange(rows) + 1.0) * LOAD * ROW
    stretch = load - slip + 50.0 * PERIOD * LOAD * ROW
    released = -np.diff(0.5 * spring * stretch**2, prepend=0.5 * spring * stretch[0] ** 2)
    work = np.cumsum(released + spring * stretch * LOAD * ROW)
    zero = np.zeros(rows)
    columns = {"displacement": slip, "spring_stretch": stretch, "plate_velocity": velocity, "external_work": work}
    columns |= {"load_point_velocity": zero + LOAD, "elastic_energy": zero, "rotational_energy": zero}
    columns |= {"translational_energy": np.where(velocity > LOAD, 1e-9, 0.0), "energy_residual": 1e-4 * work}
    columns |= {"layer_thickness": 1e-3 + zero, "stage_index": np.full(rows, 3), "cycle": np.zeros(rows, int)}
    data = {name: ("time", values) for name, values in columns.items()}
    data["dissipated_energy"] = (("time", "effect"), np.stack([0.8 * work, 0.2 * work], axis=1))
    coords = {"time": (np.arange(rows) + 1.0) * ROW, "stage": ("time", ["slide"] * rows)}
    return xr.Dataset(data, coords | {"effect_name": ("effect", ["friction", "damping"])})


def test_events_of_a_saw_tooth_have_their_drop_slip_and_energy():
    events = stick_slip.events_of(saw_tooth(), PARAMS)
    assert events.sizes["event"] == 8
    slip = PERIOD * LOAD * ROW
    assert events.slip.values == pytest.approx(np.full(8, slip), rel=1e-2)
    drop = PARAMS.spring * slip * (1.0 - FAST / PERIOD) / PARAMS.area
    assert events.stress_drop.values == pytest.approx(np.full(8, drop), rel=2e-2)
    metrics = stick_slip.analyse(events, PARAMS)
    assert metrics["events"].value == 8
    assert metrics["event_slip"].value == pytest.approx(slip / PARAMS.diameter, rel=1e-2)
    assert metrics["event_recurrence"].value == pytest.approx(PERIOD * ROW / PARAMS.inertial_time, rel=1e-2)
    assert metrics["recurrence_variation"].value < 0.01
    assert metrics["dissipated_by_friction"].value == pytest.approx(0.8)
    assert metrics["event_energy_residual"].holds and metrics["event_energy_residual"].value < 2e-4
    assert metrics["b_value"].value is None or metrics["b_value_se"].note.startswith("unknown")


def test_an_event_whose_energy_is_lost_breaks_the_claim():
    lost = saw_tooth()
    lost["energy_residual"] = 0.01 * lost.external_work
    metric = stick_slip.analyse(stick_slip.events_of(lost, PARAMS), PARAMS)["event_energy_residual"]
    assert not metric.holds and metric.value > 5e-3
    events = stick_slip.events_of(lost, PARAMS)
    events["released_energy"] = -events.released_energy  # of a spring that was loaded meanwhile
    assert not stick_slip.analyse(events, PARAMS)["event_energy_residual"].holds


def test_a_layer_without_a_spring_is_refused():
    with pytest.raises(ParameterError, match="load_stiffness_ratio: one of them must be given"):
        stick_slip.Params()


def test_too_few_rows_for_events_are_refused():
    with pytest.raises(ParameterError, match="about 5 rows would be written, must be >= 100"):
        stick_slip.Params(load_stiffness_ratio=0.02, strain=0.1, row_time=20.0)


def test_a_run_has_its_events_and_the_stretch_of_its_spring(runtime, tmp_path):
    small = {"layer_thickness": 8, "length": 8, "inertial_number": 0.01, "run_in": 0.1, "strain": 0.5, "row_time": 0.4}
    params = stick_slip.Params(load_stiffness_ratio=0.02, **small)
    run = stick_slip.run(params, tmp_path)
    assert {"run.nc", "events.nc", "events.png", "run.png"} <= {path.name for path in tmp_path.iterdir()}
    events = lsm.open_run(tmp_path / "events.nc")
    assert events.run_status == "complete" and "released_energy" in events
    # The spring is stretched by what the load point gained on the platen.
    gained = np.cumsum(np.diff(run.time) * (run.load_point_velocity - run.plate_velocity).values[1:])
    assert run.spring_stretch.values[1:] - run.spring_stretch.values[0] == pytest.approx(
        gained, abs=2e-2 * gained.max()
    )
    slide = run.isel(time=run.stage.values == "slide")
    assert np.median(np.diff(slide.time)) == pytest.approx(params.row_time * params.inertial_time, rel=0.05)
