"""The fourth-order scheme: its order where forces are smooth, the same bits however steps are launched."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

MASS, DEPTH = 250.0 * np.pi, 0.05
PERIOD = 2.0 * np.pi / np.sqrt(2.0 * scenes.STIFFNESS / MASS)


def oscillating(dt, amplitude=0.02, **more):
    """Two discs that cohesion holds together, with half of DEPTH to oscillate; they never part."""
    effects = [lsm.LinearElastic(scenes.STIFFNESS), lsm.effects.Cohesion(scenes.STIFFNESS * DEPTH, 0.5)]
    return scenes.scene([[0, 0], [1 - DEPTH + amplitude, 0]], effects, dt=dt, integrator=lsm.ForestRuth, **more)


@pytest.fixture(scope="module")
def discs(runtime):
    return scenes.simulate(oscillating(PERIOD / 60))


@pytest.mark.skipif(scenes.PRECISION == "f32", reason="errors of the scheme are below those of f32")
def test_an_oscillation_is_of_fourth_order(discs):
    """A quarter of a period after two of them, where the error of the phase is that of the place."""
    sim, errors, counts = discs, [], (60, 120, 240)
    for count in counts:
        sim.reset(oscillating(PERIOD / count))
        sim.run(9 * count // 4)
        x = sim.state.position.to_numpy()[:, 0]
        errors.append(abs(x[1] - x[0] - 1 + DEPTH))
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.3)


def test_the_bits_do_not_depend_on_launches_or_on_the_list(discs):
    sim, results = discs, []
    for skin, pieces in ((0.5, 1), (1e-3, 1), (1e-3, 40)):
        sim.reset(oscillating(PERIOD / 60, skin=skin, velocity=np.array([[3.0, 1.0], [3.0, 1.0]])))
        sim.rebuilds = 0
        for _ in range(pieces):
            sim.run(120 // pieces)
        results.append((sim.rebuilds, sim.state.position.to_numpy(), lsm.energies(sim).balance))
    assert results[1][0] > results[0][0] + 10
    for _, position, energy in results[1:]:
        assert np.array_equal(position, results[0][1]) and energy == results[0][2]


@pytest.mark.parametrize("steps", [61, 62])
def test_a_checkpoint_goes_on_with_the_right_one_of_three_steps(discs, tmp_path, steps):
    sim = discs
    sim.reset(oscillating(PERIOD / 60))
    sim.run(steps)
    lsm.save_checkpoint(sim, tmp_path / "state.nc")
    sim.run(20)
    reference = sim.state.position.to_numpy()
    sim.reset(oscillating(PERIOD / 60))  # at the first of three
    lsm.restore_checkpoint(sim, tmp_path / "state.nc")
    sim.run(20)
    assert np.array_equal(sim.state.position.to_numpy(), reference)


def test_scenes_with_losses_are_refused():
    with pytest.raises(lsm.InputError, match=r"ForestRuth is for scenes without losses, not .*coulomb_friction"):
        scenes.scene([[0, 0], [1, 0]], scenes.frictional(), integrator=lsm.ForestRuth)
