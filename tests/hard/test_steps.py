"""Hard cases of the time step, in their quick form; and each guard switched off, so that its case fails."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers.scenes import PRECISION
from workflows.hard import cases_of
from workflows.hard.steps import CRITICAL, on_floor

CASES = {case.name: case for case in cases_of("steps")}
GUARDS = {  # and the case that shows what each is for
    "step": "step_above_critical",
    "displacement": "crossing_in_one_step",
    "energy": "lost_balance",
    "overlap": "deeper_than_the_limit",
    "wall": "through_a_wall",
    "finite": "not_a_number",
}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    assert CASES[name].run(bench) <= CASES[name].bound_in(PRECISION)


@pytest.mark.parametrize("guard", GUARDS)
def test_without_its_guard_a_case_fails(bench, guard):
    case = CASES[GUARDS[guard]]
    bench.off = {guard: None}
    try:
        assert case.run(bench) > 2.0 * case.bound_in(PRECISION)
    finally:
        bench.off = {}


def test_every_guard_is_switched_off_in_a_test():
    assert set(GUARDS) == set(lsm.Guards.__dataclass_fields__)


def test_a_crowd_without_the_guard_of_the_step_blows_up(bench):
    case = CASES["step_of_a_pair_in_a_crowd"]
    bench.off = {"step": None, "displacement": None, "energy": None, "overlap": None}
    try:
        assert case.run(bench) == np.inf
    finally:
        bench.off = {}


def test_what_is_saved_of_a_run_that_stops(bench, tmp_path):
    """The last good state can be run on, to the same bits; the state at the stop can be looked at."""
    sim = bench.simulate(on_floor(1.0, 0.02 * CRITICAL))
    sim.keep_checkpoints(tmp_path, seconds=0.0)
    sim.run(30)
    good = sim.state.position.to_numpy()
    sim.run(30)
    later = sim.state.position.to_numpy()
    lsm.restore_checkpoint(sim, tmp_path / "checkpoint.nc")
    assert np.array_equal(sim.state.position.to_numpy(), later) and sim.step == 60
    velocity = sim.state.velocity.to_numpy()
    velocity[0] = np.nan
    sim.state.velocity.from_numpy(velocity)
    with pytest.raises(lsm.SimulationError, match="step 60: grain 0") as stopped:
        sim.run(30)
    sim._folder = None
    assert stopped.value.step == 60 and stopped.value.grains == (0,)
    assert [path.name for path in stopped.value.saved] == ["stopped.nc", "checkpoint.nc"]
    lsm.restore_checkpoint(sim, tmp_path / "stopped.nc")
    assert np.isnan(sim.state.velocity.to_numpy()[0]).all()
    lsm.restore_checkpoint(sim, tmp_path / "checkpoint.nc")
    assert np.array_equal(sim.state.position.to_numpy(), later) and not np.array_equal(good, later)
