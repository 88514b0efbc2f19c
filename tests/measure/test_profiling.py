"""Where the time of a run goes, and the path of a GPU, run on the CPU."""

from dataclasses import replace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.stepping.step_loop_gpu import StepLoopGPU


@pytest.mark.validate  # compiles for long
def test_profile_divides_the_time_of_a_run(reference_packing):
    sim = reference_packing("frictional_discs")
    sim.reset(sim.scene)
    sim.measure.sums()  # compiles
    sim.seconds.clear()
    sim.run(300)
    with sim.clock("diagnostics"):
        sim.measure.sums()
    rows = {name: (share, cost) for name, share, cost in lsm.runtime_profile(sim)}
    whole = [share for name, (share, _) in rows.items() if not name.startswith(" ")]
    assert sum(whole) == pytest.approx(1.0)
    assert rows["steps"][0] > 0.1 and rows["diagnostics"][0] > 0.0
    assert rows["  contacts"][1] > 0.0 and rows["  gather, integrate"][1] > 0.0
    text = lsm.runtime_profile_text(sim)
    assert f"{len(sim)} grains, 300 steps" in text and text.count("\n") == len(rows) + 1


@pytest.mark.validate
def test_profile_leaves_the_motion_as_it_is(reference_packing):
    """Its stages have a step of zero: positions, velocities and springs keep their bits."""
    sim = reference_packing("frictional_discs")
    rest = sim.scene
    velocity = np.random.default_rng(4).standard_normal(rest.position.shape) * 5e-4 / sim.dt
    sim.reset(replace(rest, velocity=velocity))
    while sim.step < 2000 and not sim.state.has_impulse.to_numpy().any():
        sim.run(1)  # to a step in which a contact begins or ends
    assert sim.state.has_impulse.to_numpy().any()
    names = ("position", "velocity", "angular_velocity", "force", "torque", "dissipated")
    before = {name: getattr(sim.state, name).to_numpy() for name in names}
    history = sim.pairs.history.to_numpy()
    lsm.runtime_profile(sim)
    for name, values in before.items():
        assert np.array_equal(getattr(sim.state, name).to_numpy(), values), name
    assert np.array_equal(sim.pairs.history.to_numpy(), history)
    assert sim.integrator.dt[None] == sim.dt


def test_profile_without_a_step_is_refused(reference_packing):
    sim = reference_packing("frictional_discs")
    sim.reset(sim.scene)
    with pytest.raises(lsm.InputError, match="no step"):
        lsm.runtime_profile(sim)


@pytest.mark.parametrize("name", ["frictional_discs", pytest.param("elastic_arcs", marks=pytest.mark.validate)])
def test_a_thread_per_grain_gives_the_same_bits(reference_packing, name):
    """What a GPU runs: a launch for each stage and a thread for each grain."""
    sim = reference_packing(name)
    columns = []
    shared = sim.step_loop
    for loop in (shared, StepLoopGPU(sim.stages)):
        sim.reset(sim.scene)
        sim.step_loop = loop
        try:
            sim.run(400)
            assert sim.step_loop is loop
        finally:
            sim.step_loop = shared
        assert sim.step == 400
        columns.append([sim.state.position.to_numpy(), sim.state.velocity.to_numpy(), sim.state.force.to_numpy()])
    for one, other in zip(*columns):
        assert np.array_equal(one, other)
    assert not np.array_equal(columns[0][0], sim.scene.position)
