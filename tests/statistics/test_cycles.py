"""Repetitions of a stage side by side: a run whose response to every step is known comes back as it was made."""

import itertools

import numpy as np
import pytest
import xarray as xr

from taichi_lsm import InputError
from taichi_lsm.statistics import stack_cycles

SLOW, FAST, LENGTH, ROWS = 1.0, 3.0, 30.0, 60  # velocities [m s-1], slip of a stage [m], rows of it
DISTANCE = 4.0  # over which friction relaxes [m]


def response(slip, sign):
    """Friction after a step of this sign, slip since it."""
    return 0.3 + sign * 0.02 * np.exp(-slip / DISTANCE)


def run(cycles=5, noise=0.0, spring=None, seed=3):
    """A run-in and cycles of steps up and down; rows are the means of the response since the row before."""
    rng, columns = np.random.default_rng(seed), {"time": [0.0], "displacement": [0.0], "friction": [0.3]}
    index, names, number = [1], ["run-in"], [0]
    plan = [("run-in", SLOW, 0, 0.0)] + [
        s for c in range(cycles) for s in (("up", FAST, c + 1, 1.0), ("down", SLOW, c + 1, -1.0))
    ]
    for place, (name, velocity, cycle, sign) in enumerate(plan, 1):
        edges = np.linspace(0.0, LENGTH, ROWS + 1)
        for a, b in itertools.pairwise(edges):
            mean = 0.3 + sign * 0.02 * DISTANCE * (np.exp(-a / DISTANCE) - np.exp(-b / DISTANCE)) / (b - a)
            columns["time"].append(columns["time"][-1] + (b - a) / velocity)
            columns["displacement"].append(columns["displacement"][-1] + b - a)
            columns["friction"].append(mean + noise * rng.normal())
            index.append(place), names.append(name), number.append(cycle)
    data = {name: ("time", np.array(values)) for name, values in columns.items() if name != "time"}
    data |= {"stage_index": ("time", index), "cycle": ("time", number), "stage": ("time", np.array(names))}
    data |= {} if spring is None else {"spring_stretch": ("time", spring * np.array(columns["time"]))}
    return xr.Dataset(data, {"time": np.array(columns["time"])})


def test_every_cycle_is_the_response_to_its_step():
    stack = stack_cycles(run(), "up", before=5.0)
    slip = stack.slip_since_step.values
    assert list(stack.cycle.values) == [1, 2, 3, 4, 5] and stack.friction.dims == ("cycle", "slip_since_step")
    assert slip[0] < -4.0 and slip[-1] == pytest.approx(LENGTH - 0.5 * LENGTH / ROWS)
    after, before = slip > 0.0, slip < 0.0
    assert stack.friction.values[:, after] == pytest.approx(np.tile(response(slip[after], 1.0), (5, 1)), abs=2e-5)
    # What lies before the first step is the run-in, before the others the end of the stage down.
    assert np.all(stack.friction.values[0, before] == 0.3)
    assert stack.friction.values[1, before] == pytest.approx(response(LENGTH + slip[before], -1.0), abs=2e-5)
    assert stack.time_since_step.values[2, after] == pytest.approx(slip[after] / FAST)


def test_slips_may_be_given_and_those_that_not_all_have_are_left_out():
    stack = stack_cycles(run(), "down", slips=[0.1, 1.0, 2.0, 29.9])
    assert list(stack.slip_since_step.values) == [1.0, 2.0]
    assert stack.friction.values[3] == pytest.approx(response(np.array([1.0, 2.0]), -1.0), abs=1e-4)


def test_nothing_is_interpolated_across_the_step():
    """Between the last row before the step and the first one after it no slip has a value."""
    row = LENGTH / ROWS
    stack = stack_cycles(run(), "up", before=5.0, slips=np.linspace(-2.0, 2.0, 401))
    slip = stack.slip_since_step.values
    assert slip[slip < 0.0].max() <= -0.5 * row + 1e-6 and slip[slip > 0.0].min() >= 0.5 * row - 1e-6
    assert slip.size > 300


def test_the_mean_over_cycles_is_the_figure():
    stack = stack_cycles(run(cycles=40, noise=0.01), "up")
    mean = stack.friction.mean("cycle")
    assert mean.dims == ("slip_since_step",)
    assert float(np.std(mean - response(stack.slip_since_step, 1.0))) == pytest.approx(0.01 / np.sqrt(40), rel=0.3)


def test_the_slip_of_the_load_point_has_the_stretch_of_the_spring():
    pulled = run(spring=0.5)  # the load point gains half a metre per second
    stack = stack_cycles(pulled, "up", of="load_point")
    assert stack.slip_since_step.values[-1] == pytest.approx((1.0 + 0.5 / FAST) * (LENGTH - 0.5 * LENGTH / ROWS))
    with pytest.raises(InputError, match="must be 'platen' without a spring"):
        stack_cycles(run(), "up", of="load_point")


def test_what_gives_no_stack_is_refused():
    with pytest.raises(InputError, match=r"stage: .hold., must be one of run-in, up, down"):
        stack_cycles(run(), "hold")
    with pytest.raises(InputError, match=r"run: has no cycle, must be the run\.nc of a layer"):
        stack_cycles(run().drop_vars("cycle"), "up")
    at_rest = run()
    at_rest["displacement"] = 0.0 * at_rest.displacement
    with pytest.raises(InputError, match="slips: those of stage up do not rise"):
        stack_cycles(at_rest, "up")
    with pytest.raises(InputError, match="1 rows of stage 2 of the schedule, at least 3"):
        stack_cycles(run().isel(time=slice(ROWS + 2)), "up")
