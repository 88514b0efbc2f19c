"""What no guard asks for is not reported: it would end a launch in the midst of a step."""

from dataclasses import replace

import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

OFF = lsm.Guards(overlap=None, energy=None, displacement=None, step=None)


def test_an_error_ends_a_launch_only_if_a_guard_wants_it(runtime):
    """Two discs, one in the centre of the other."""
    scene = scenes.scene([(0.0, 0.0), (0.01, 0.0)], [lsm.LinearElastic(1.0)], dt=1e-3, guards=OFF)
    sim = scenes.simulate(scene)
    sim.run(100)
    assert sim.step == 100 and sim.launches == 1 + sim.rebuilds
    with pytest.raises(lsm.SimulationError, match="step 0: grains 0 and 1: their overlap reached the limit"):
        sim.reset(replace(scene, guards=replace(OFF, overlap=1.0)))
