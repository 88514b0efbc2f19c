"""Restitution and duration of impacts of two grains, against closed forms and a numerical solution."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import taichi_lsm as lsm
from taichi_lsm.effects.restitution import damping_ratio_of, restitution_of
from tests.helpers import scenes

K, SPEED, GAP = 1.0e5, 2.0, 0.02
PAIRS = 40


@pytest.fixture(scope="module")
def impacts(runtime):
    """Pairs of spheres of unequal masses that fly at each other in random directions."""
    rng = np.random.default_rng(3)
    scale = rng.uniform(0.5, 1.5, (PAIRS, 2))
    towards = rng.standard_normal((PAIRS, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    first = 6.0 * np.stack(np.unravel_index(np.arange(PAIRS), (4, 4, 4)), axis=1)
    second = first + (0.5 * scale.sum(axis=1) + GAP)[:, None] * towards
    position = np.stack([first, second], axis=1).reshape(-1, 3)
    effects = [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=1.0)]
    sim = scenes.simulate(scenes.scene(position, effects, diameter=scale.ravel(), skin=0.5))
    mass = (1000.0 * np.pi / 6 * scale**3).T
    return sim, position, towards, mass[0] * mass[1] / mass.sum(axis=0), mass


def fly(impacts, restitution, steps_per_contact):
    """(separation speed over SPEED, duration [s]) of every impact: the duration from the path flown afterwards."""
    sim, position, towards, reduced, mass = impacts
    scenes.effect(sim, "viscous_damping").c_[0] = 2.0 * damping_ratio_of(restitution)
    dt = np.pi * np.sqrt(reduced.min() / K) / steps_per_contact
    share = np.stack([mass[1], -mass[0]]) / mass.sum(axis=0)  # at rest as a whole
    velocity = np.stack([SPEED * share[0, :, None] * towards, SPEED * share[1, :, None] * towards], axis=1)
    scenes.reload(sim, dt, position=position, velocity=velocity.reshape(-1, 3))
    time = GAP / SPEED + 3.0 * np.pi * np.sqrt(reduced.max() / K)
    sim.run(int(np.ceil(time / dt)))
    x, v = (getattr(sim.state, name).to_numpy().reshape(-1, 2, 3) for name in ("position", "velocity"))
    parting = np.sum((v[:, 1] - v[:, 0]) * towards, axis=1)
    gap = np.linalg.norm(x[:, 1] - x[:, 0], axis=1) - sim.state.radius.to_numpy().reshape(-1, 2).sum(axis=1)
    assert np.all(gap > 0) and sim.contacts().sizes["contact"] == 0
    return parting / SPEED, sim.time - GAP / SPEED - gap / parting


def test_elastic_impact_lasts_half_a_period_and_returns_all(impacts):
    reduced = impacts[3]
    exact = np.pi * np.sqrt(reduced / K)
    error = []
    for steps in (50, 200, 800):
        restitution, duration = fly(impacts, 1.0, steps)
        error.append((np.abs(duration / exact - 1).max(), np.abs(restitution - 1).max()))
    assert error[2][0] < 1e-5 and error[2][1] < 1e-5
    order = np.log(np.array(error[0]) / np.array(error[2])) / np.log(16)
    assert np.all(order > 1.7)


@pytest.mark.parametrize("e", [0.1, 0.5, 0.9])
def test_impact_returns_the_requested_restitution(impacts, e):
    """At second order in dt: the onset of the dashpot within a step and the lag of its velocity are made up for."""
    error = [np.abs(fly(impacts, e, steps)[0] - e).max() for steps in (50, 400)]
    assert error[0] < 1e-3
    assert error[1] < error[0] / 8**1.7


def test_energy_lost_in_impacts_is_the_energy_dissipated(impacts):
    """The dissipated work closes the budget step by step: the residual falls with dt, not only the restitution."""
    sim, _, _, reduced, _ = impacts
    start = 0.5 * np.sum(reduced) * SPEED**2
    residual = []
    for steps in (200, 1600):
        restitution, _ = fly(impacts, 0.5, steps)
        left, lost = scenes.energy(sim)
        assert left == pytest.approx(0.5 * np.sum(reduced * (restitution * SPEED) ** 2), rel=1e-12)
        residual.append(abs(left + lost - start) / start)
    assert residual[0] < 5e-6 and residual[1] < 0.05 * residual[0]


@pytest.mark.parametrize("zeta", [0.05, 0.5, 0.9, 1.0, 1.3, 4.0])
def test_restitution_of_is_that_of_the_equation_of_motion(zeta):
    """x'' = -x - 2 zeta x' from x = 0, x' = 1 until the force vanishes: Schwager & Poeschel (2007)."""

    def parted(t, y):
        return y[0] + 2 * zeta * y[1]

    parted.terminal, parted.direction = True, -1
    motion = solve_ivp(lambda t, y: [y[1], -parted(t, y)], (0, 100), [0, 1], events=parted, rtol=1e-11, atol=1e-13)
    assert restitution_of(zeta) == pytest.approx(-motion.y[1, -1], rel=1e-8)


def test_damping_ratio_is_the_inverse_of_restitution():
    for e in (0.01, 0.1, np.exp(-2.0), 0.5, 0.999):
        assert restitution_of(damping_ratio_of(e)) == pytest.approx(e, rel=1e-10)
    assert damping_ratio_of(1.0) == 0.0 == 1.0 - restitution_of(0.0)


def test_a_rate_is_not_loaded_as_a_restitution(impacts):
    sim, position, *_ = impacts
    effects = [lsm.LinearElastic(K), lsm.ViscousDamping(rate=1.0)]
    with pytest.raises(lsm.InputError, match="rate"):
        sim.reset(scenes.scene(position, effects, skin=0.5))


def test_refusals():
    for arguments in ({}, {"restitution": 0.5, "rate": 1.0}, {"restitution": 0.0}, {"restitution": 1.1}, {"rate": -1}):
        with pytest.raises(lsm.InputError, match="ViscousDamping"):
            lsm.ViscousDamping(**arguments)
