"""What is left of a run that stops with an error."""

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows.hard.steps import CRITICAL, on_floor


@pytest.mark.validate
def test_what_is_saved_of_a_run_that_stops(bench, tmp_path):
    """The last good state can be run on, to the same bits; the state at the stop can be read."""
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
