"""Grains under gravity only."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes


@pytest.mark.validate
def test_free_fall_is_exact(runtime):
    """Without contact forces: the parabola, which velocity Verlet meets to rounding."""
    rng = np.random.default_rng(0)
    position, velocity = rng.uniform(-50, 50, (20, 3)), rng.standard_normal((20, 3))
    g = np.array([1.0, -9.81, 0.3])
    sim = scenes.simulate(scenes.scene(position, [lsm.Gravity(tuple(g))], velocity=velocity, dt=1e-3))
    start, _ = scenes.energy(sim)
    sim.run(2000)
    expected = position + velocity * sim.time + 0.5 * g * sim.time**2
    assert np.abs(sim.state.position.to_numpy() - expected).max() < 1e-9
    assert scenes.energy(sim)[0] == pytest.approx(start, rel=1e-11)
