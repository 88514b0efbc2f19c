"""Friction that weakens with velocity: steady slip, and the growth of what it makes unstable."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers.scenes import PRECISION, tolerance
from tests.helpers.sliders import Sliders

MU_S, MU_D, V_C, STIFF = 0.7, 0.2, 0.5, 1e5
COUNT = 31
pytestmark = pytest.mark.usefixtures("runtime")


def coefficient(v):
    return MU_D + (MU_S - MU_D) / (1 + v / V_C)


@pytest.mark.parametrize("dim", [2, 3])
def test_steady_slip_has_the_friction_of_its_velocity(dim):
    bench = Sliders(lsm.effects.VelocityWeakeningFriction(MU_S, MU_D, V_C, STIFF), COUNT, dim=dim)
    v = V_C * np.logspace(-4, 4, COUNT)
    bench.set(history=0.0, load=v, dt=1e-5 / v)
    bench.slide(50)
    bench.set(lost=0.0)
    bench.slide(200)
    force = bench.force.to_numpy()
    assert force == pytest.approx(coefficient(v), rel=tolerance(1e-12, 1e-5))
    assert bench.lowest.to_numpy() == pytest.approx(force, rel=tolerance(1e-12, 1e-5))
    assert bench.lost.to_numpy() == pytest.approx(force * 200e-5, rel=tolerance(1e-10, 1e-3))
    # one that is pushed less hard than its static limit stays
    bench.set(history=0.0, load=1e-8, dt=1.0)
    bench.slide(int(0.9 * MU_S / STIFF / 1e-8))
    assert np.all(bench.lost.to_numpy() == pytest.approx(force * 200e-5, rel=tolerance(1e-10, 1e-3)))


@pytest.mark.skipif(PRECISION == "f32", reason="growth from 1e-3 of the velocity needs f64")
def test_a_block_leaves_its_velocity_as_the_slope_of_friction_says():
    """A block that slides at V under just the force mu(V) runs away as exp(-mu'(V) t/m): inertia bounds the change."""
    mass = 2.0
    bench = Sliders(lsm.effects.VelocityWeakeningFriction(MU_S, MU_D, V_C, STIFF), 1, mass=mass)
    v, dt, soft = 1.0, 1e-4, 1e-9
    bench.set(history=0.0, load=v, dt=dt)
    bench.slide(1000)
    slope = (MU_S - MU_D) / V_C / (1 + v / V_C) ** 2
    start = 1e-3
    bench.set(velocity=v + start, stretch=coefficient(v) / soft, stiffness=soft, load=v)
    away = []
    for _ in range(2):
        bench.pull(40_000)
        away.append(bench.velocity.to_numpy()[0] - v)
    growth = np.log(away[1] / away[0]) / 4.0
    assert growth == pytest.approx(slope / mass, rel=0.01)
    assert away[0] == pytest.approx(start * np.exp(4.0 * slope / mass), rel=0.02)


def test_refusals():
    for values, name in (
        ((-0.1, 0.0, 1.0, 1.0), "static_coefficient"),
        ((0.3, 0.4, 1.0, 1.0), "dynamic_coefficient"),
        ((0.3, 0.2, 0.0, 1.0), "critical_velocity"),
        ((0.3, 0.2, 1.0, np.inf), "tangential_stiffness"),
    ):
        with pytest.raises(lsm.InputError, match=rf"VelocityWeakeningFriction\.{name} = .*must be"):
            lsm.effects.VelocityWeakeningFriction(*values)
