"""A slider drawn by a spring: where rate-and-state friction becomes unstable, and the stress drop of stick-slip."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.helpers.sliders import Sliders

pytestmark = pytest.mark.skipif(scenes.PRECISION == "f32", reason="growth rates need f64")

A, B, MU_0 = 0.01, 0.015, 0.6  # under a normal force of 1 N, with D_c = 1 m and V_0 = 1 m/s
CRITICAL = B - A
BLOCK = 1e-4  # [kg]


@pytest.mark.parametrize("evolution", ["ageing", pytest.param("slip", marks=pytest.mark.validate)])
def test_stability_boundary_of_a_spring_slider(runtime, evolution):
    """K_c = (b - a) F_n/D_c (1 + m V^2/(a F_n D_c)): Ruina (1983), with inertia Rice & Ruina (1983)."""
    count, k_t = 21, 0.5
    effect = lsm.effects.RateAndStateFriction(MU_0, A, B, 1.0, 1.0, k_t, evolution)
    bench = Sliders(effect, count, mass=BLOCK)
    stiffness = CRITICAL * np.linspace(0.9, 1.12, count)
    start = np.zeros((count, 2))
    start[:, 0] = -MU_0 / k_t  # steady slip at V_0
    bench.set(history=start, force=MU_0, velocity=1.0, stretch=MU_0 / stiffness, stiffness=stiffness, dt=4e-3)
    bench.set(load=1.0)
    bench.pull(500)
    assert np.ptp(bench.force.to_numpy()) < 1e-9
    bench.set(load=1.0 + 1e-3)
    period = 2 * np.pi * np.sqrt(A / (B - A))
    bench.pull(int(2 * period / 4e-3))
    oscillations = []
    for _ in range(2):
        bench.pull(int(4 * period / 4e-3))
        oscillations.append(bench.highest.to_numpy() - bench.lowest.to_numpy())
    growth = np.log(oscillations[1] / oscillations[0])
    assert growth[0] > 0.1 and growth[-1] < -0.1 and np.all(np.diff(growth) < 0)
    series = stiffness * k_t / (stiffness + k_t)
    boundary = np.interp(0.0, -growth, series)
    assert boundary == pytest.approx(CRITICAL * (1 + BLOCK / A), rel=0.01)


N, MU_S, MU_D, SPRING, PULL = 10.0, 0.6, 0.4, 1.0, 0.05
K, GIANT, INERTIA = 1e3, 2.0e6, 2.0
CHUNK = 5  # steps


@pytest.fixture(scope="module")
def rides(runtime):
    """rides(effect): a glued disc that is pressed on the flat top of a free giant, far too heavy to move, and drawn."""
    made = {}

    def get(effect):
        if effect.name not in made:
            drives = [lsm.SpringLoadPoint(PULL, SPRING, INERTIA), lsm.ServoStress(N, 1, K, INERTIA, 1.0, 0.5)]
            made[effect.name] = scenes.simulate(
                scenes.scene(
                    [(0.0, -0.5 * GIANT), (0.0, 0.5 - N / K)],
                    [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=0.3), effect],
                    diameter=np.array([GIANT, 1.0]),
                    platen_index=np.array([-1, 0]),
                    platens=[lsm.Platen("slider", drives)],
                    density=1.0,
                    thickness=1.0,
                    area=1.0,
                    skin=0.2,
                    dt=1e-2,
                )
            )
        return made[effect.name]

    return get


def budget(sim):
    """(work of the drives, kinetic and stored energy, energy lost) [J]; the spring lies outside."""
    now = sim.platens.snapshot()
    stored, lost = scenes.energy(sim)
    stored += 0.5 * float((sim.platens.mass.to_numpy() * now["velocity"] ** 2).sum())
    return now["work"].sum(), stored, lost + now["dissipated"].sum()


def forces(sim, time, stiffness):
    """Force of the spring [N] every CHUNK steps, for this time [s]."""
    result = np.zeros(int(time / sim.dt / CHUNK))
    for i in range(len(result)):
        sim.run(CHUNK)
        result[i] = stiffness * sim.platens.stretch[0][0]
    return result


def test_stick_slip_drops_the_force_by_twice_the_difference(rides):
    """A slider released at mu_s N oscillates about mu_d N and sticks again at (2 mu_d - mu_s) N.

    The spring of the contact, which has no damping, then oscillates by (mu_s - mu_d) N and reaches mu_s N when the
    load is mu_d N: there the slider goes on, and slides steadily.
    """
    sim = rides(lsm.CoulombFriction(MU_S, 0.5 * K, MU_D))
    sim.run(500)  # the press settles
    begin, at = budget(sim), sim.time
    force = forces(sim, 175.0, SPRING)
    now = sim.platens.snapshot()
    assert now["stretch"][0, 0] == pytest.approx(PULL * sim.time - now["displacement"][0, 0], rel=1e-9)
    first = int(np.argmax(force))
    low = first + int(np.argmin(force[first : first + 200]))
    second = low + int(np.argmax(force[low:]))
    assert force[[first, low, second]] == pytest.approx(N * np.array([MU_S, 2 * MU_D - MU_S, MU_D]), rel=0.02)
    assert force[second:] == pytest.approx(np.full(len(force) - second, N * MU_D), rel=0.02)
    # what the drives did is in the grains or lost, and the load point did what the spring passed on or holds
    end = budget(sim)
    work, gained, lost = (b - a for a, b in zip(begin, end, strict=True))
    assert lost > 15.0 and work == pytest.approx(gained + lost, rel=1e-4)
    start = PULL * at * SPRING
    held = 0.5 / SPRING * (force[-1] ** 2 - start**2)
    assert work == pytest.approx(PULL * np.trapezoid([start, *force], dx=CHUNK * sim.dt) - held, rel=5e-3)


@pytest.mark.validate
def test_rate_and_state_slips_steadily_only_on_a_stiff_spring(rides):
    d_c, v_0 = 0.05, 0.005
    sim = rides(lsm.effects.RateAndStateFriction(MU_0, A, B, d_c, v_0, 0.5 * K))
    critical = CRITICAL * N / d_c
    oscillations = []
    for stiffness in (2.0 * critical, 0.5 * critical):
        scenes.reload(sim, position=np.array([(0.0, -0.5 * GIANT), (0.0, 0.5 - N / K)]))
        for velocity, distance in ((10 * v_0, 0.9 * MU_0 * N / stiffness), (v_0, 10 * d_c), (3 * v_0, 100 * d_c)):
            sim.platens.set("slider", 0, lsm.SpringLoadPoint(velocity, stiffness, INERTIA))
            sim.run(int(distance / velocity / sim.dt))
        force = forces(sim, 10 * d_c / velocity, stiffness)
        oscillations.append(np.ptp(force) / N)
        if stiffness > critical:
            assert force == pytest.approx(N * (MU_0 + (A - B) * np.log(3.0)), rel=1e-4)
    assert oscillations[0] < 1e-5 and oscillations[1] > B


def test_springs_that_make_no_sense_are_refused(rides):
    for values, name in (
        ((np.inf, 1.0, 1.0), "velocity"),
        ((1.0, 0.0, 1.0), "stiffness"),
        ((1.0, 1.0, -1.0), "inertia"),
    ):
        with pytest.raises(lsm.InputError, match=rf"SpringLoadPoint\.{name} = .*must be"):
            lsm.SpringLoadPoint(*values)
    sim = rides(lsm.CoulombFriction(MU_S, 0.5 * K, MU_D))
    for drive, message in (
        (lsm.SpringLoadPoint(PULL, 1e5, INERTIA), "stiffness = 100000.0: must be <= inertia/dt"),
        (lsm.SpringLoadPoint(PULL, SPRING, 3.0), "inertia = 3.0: must be 2.0 kg as at the start"),
    ):
        with pytest.raises(lsm.InputError, match=message):
            sim.platens.set("slider", 0, drive)
    sim.platens.set("slider", 0, lsm.SpringLoadPoint(PULL, SPRING, INERTIA))
    dt = sim.dt
    with pytest.raises(lsm.InputError, match=r"stiffness = .*must be <= inertia/dt"):  # as against a longer step
        sim.set_time_step(1.1 * np.sqrt(INERTIA / SPRING))
    assert sim.dt == sim.platens.dt == sim.integrator.dt[None] == dt
