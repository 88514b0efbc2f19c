"""Platens: fixed, at constant velocity with a ramp, under servo-controlled stress; and their work."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import taichi_lsm as lsm
from taichi_lsm.effects.restitution import damping_ratio_of
from tests.helpers import scenes

K, STRESS, LIMIT = 1.0e4, 200.0, 0.04
BASE, PRESS, RAM = 0, 1, 2
MASS = 1000.0 * np.pi / 4
INERTIA = 3.0e3
START = np.array([(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (20.0, 0.0), (22.0, 0.0)])


def servo(stress):
    return lsm.ServoStress(stress, 1, K / 3, INERTIA, LIMIT, damping_ratio=0.5)


@pytest.fixture(scope="module")
def press(runtime):
    """A column of two discs between a base and a servo press; far away a ram that drives towards one free disc."""
    platens = [
        lsm.Platen("base", [lsm.Fixed(), lsm.Fixed()]),
        lsm.Platen("press", [lsm.Fixed(), servo(STRESS)]),
        lsm.Platen("ram", [lsm.ConstantVelocity(0.5, 2.0), lsm.Fixed()]),
    ]
    return scenes.simulate(
        scenes.scene(
            START,
            [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=0.3)],
            platen_index=np.array([BASE, -1, -1, PRESS, RAM, -1]),
            platens=platens,
            thickness=1.0,
            area=1.0,
            dt=1e-3,
        )
    )


def restart(sim, lift=0.0, stress=STRESS):
    sim.platens.set("press", 1, servo(stress))
    sim.platens.set("ram", 0, lsm.ConstantVelocity(0.5, 2.0))
    position = START + np.array([0.0, lift]) * (np.arange(6) == 3)[:, None]
    scenes.reload(sim, position=position, velocity=np.zeros((6, 2)))


def test_servo_reaches_its_stress_on_an_elastic_column(press):
    restart(press)
    press.run(30_000)
    now = press.platens.snapshot()
    force = press.platens.force.to_numpy()
    assert force[PRESS, 1] == pytest.approx(STRESS, rel=1e-6)
    assert force[BASE, 1] == pytest.approx(-STRESS, rel=1e-6)
    assert now["displacement"][PRESS, 1] == pytest.approx(-3 * STRESS / K, rel=1e-6)
    assert abs(now["velocity"][PRESS, 1]) < 1e-8
    assert not now["displacement"][BASE].any() and not now["velocity"][BASE].any()
    # all the work of the load is in the springs, the dashpots and the servo's drag
    stored, lost = column_energy(press)
    assert now["work"][PRESS, 1] == pytest.approx(STRESS * 3 * STRESS / K, rel=1e-6)
    assert stored == pytest.approx(0.5 * 3 * STRESS**2 / K, rel=1e-5)
    assert stored + lost + now["dissipated"][PRESS, 1] == pytest.approx(now["work"][PRESS, 1], rel=2e-3)
    press.platens.set("press", 1, servo(0.5 * STRESS))
    press.run(30_000)
    assert press.platens.force.to_numpy()[PRESS, 1] == pytest.approx(0.5 * STRESS, rel=1e-6)


def column_energy(sim):
    """Energy stored in and dissipated by the contacts of the column: the ram's part is told by its disc's motion."""
    sums = sim.measure.sums()
    return sums["elastic_energy"], sums["dissipated_viscous_damping"] - ram_loss(sim)


def ram_loss(sim):
    """The ram's work less the kinetic energy that it and its disc have gained."""
    work = sim.platens.snapshot()["work"][RAM, 0]
    free = sim.state.velocity.to_numpy()[5]
    return work - 0.5 * MASS * 0.5**2 - 0.5 * MASS * free @ free


def test_press_in_flight_falls_at_the_speed_limit_and_settles(press):
    restart(press, lift=1.0)
    speeds = []
    for _ in range(4000):
        press.run(10)
        speeds.append(press.platens.velocity.to_numpy()[PRESS, 1])
        if press.platens.force.to_numpy()[PRESS, 1] > 0:
            break
    assert np.all(np.abs(speeds) <= LIMIT)
    assert np.min(speeds) == -LIMIT
    assert press.time == pytest.approx(1.0 / LIMIT, rel=0.1)  # and the time to reach that speed
    forces = []
    for _ in range(600):
        press.run(50)
        speeds.append(press.platens.velocity.to_numpy()[PRESS, 1])
        forces.append(press.platens.force.to_numpy()[PRESS, 1])
    assert np.all(np.abs(speeds) <= LIMIT)
    assert np.max(forces) < 3 * STRESS
    assert forces[-1] == pytest.approx(STRESS, rel=1e-5)
    # what the drag and the speed limit took is accounted for: the press came down with the work of its load
    now = press.platens.snapshot()
    stored, lost = column_energy(press)
    assert now["work"][PRESS, 1] == pytest.approx(STRESS * (1.0 + 3 * STRESS / K), rel=1e-6)
    assert stored + lost + now["dissipated"][PRESS, 1] == pytest.approx(now["work"][PRESS, 1], rel=2e-3)


def test_constant_velocity_is_reached_by_a_ramp_and_its_work_is_accounted_for(press):
    restart(press)
    press.run(125)
    now = press.platens.snapshot()
    assert now["velocity"][RAM, 0] == pytest.approx(2.0 * press.time, rel=1e-12)
    assert now["displacement"][RAM, 0] == pytest.approx(press.time**2, rel=1e-2)
    press.run(375)
    now = press.platens.snapshot()
    assert now["velocity"][RAM, 0] == 0.5
    assert now["work"][RAM, 0] == pytest.approx(0.5 * MASS * 0.5**2, rel=1e-12)
    assert now["force_sum"][RAM, 0] == 0.0
    press.run(2500)  # in between the ram has hit the disc, which flies ahead
    now = press.platens.snapshot()
    free = press.state.velocity.to_numpy()[5, 0]
    assert free == pytest.approx(0.5 * (1 + expected_restitution()), rel=0.02)
    assert -now["force_sum"][RAM, 0] * press.dt == pytest.approx(MASS * free, rel=1e-10)  # impulse and momentum
    distance_times_force = -now["force_sum"][RAM, 0] * press.dt * 0.5
    assert now["work"][RAM, 0] == pytest.approx(0.5 * MASS * 0.5**2 + distance_times_force, rel=1e-12)
    assert now["dissipated"][RAM, 0] == 0.0
    press.platens.set("ram", 0, lsm.ConstantVelocity(-0.25))
    press.run(1)
    assert press.platens.velocity.to_numpy()[RAM, 0] == -0.25


def expected_restitution():
    """Restitution against a ram that does not give way, with the dashpot for the pair's own reduced mass."""
    c = 2.0 * damping_ratio_of(0.3) * np.sqrt(K * 0.5 * MASS)

    def force(t, y):
        return K * y[0] + c * y[1]

    force.terminal, force.direction = True, -1
    motion = solve_ivp(lambda t, y: [y[1], -force(t, y) / MASS], (0, 10), [0, 1], events=force, rtol=1e-9, atol=1e-12)
    return -motion.y[1, -1]


def test_drive_of_another_kind_is_refused(press):
    with pytest.raises(lsm.InputError, match="'press', axis 1: ConstantVelocity cannot replace ServoStress"):
        press.platens.set("press", 1, lsm.ConstantVelocity(0.0))
    with pytest.raises(lsm.InputError, match="Fixed cannot replace ConstantVelocity"):
        press.platens.set("ram", 0, lsm.Fixed())


def test_drive_of_a_platen_or_an_axis_that_there_is_not_is_refused(press):
    with pytest.raises(lsm.InputError, match=r"platen 'lid': no such platen, must be one of .*'press'"):
        press.platens.set("lid", 1, servo(STRESS))
    with pytest.raises(lsm.InputError, match="platen 'press', axis 2: must be one of"):
        press.platens.set("press", 2, servo(STRESS))


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: lsm.ConstantVelocity(np.nan), "velocity"),
        (lambda: lsm.ConstantVelocity("fast"), "velocity"),
        (lambda: lsm.ConstantVelocity(1.0, 0.0), "acceleration"),
        (lambda: lsm.ConstantVelocity(1.0, None), "acceleration"),
        (lambda: lsm.ServoStress(0.0, 1, 1.0, 1.0, 1.0), "stress"),
        (lambda: lsm.ServoStress(1.0, 0, 1.0, 1.0, 1.0), "outward"),
        (lambda: lsm.ServoStress(1.0, 1, -1.0, 1.0, 1.0), "stiffness"),
        (lambda: lsm.ServoStress(1.0, 1, 1.0, np.inf, 1.0), "inertia"),
        (lambda: lsm.ServoStress(1.0, 1, 1.0, 1.0, 0.0), "speed_limit"),
        (lambda: lsm.ServoStress(1.0, 1, 1.0, 1.0, 1.0, 0.0), "damping_ratio"),
    ],
)
def test_values_out_of_range_name_the_drive_and_the_field(make, field):
    with pytest.raises(lsm.InputError, match=rf"\.{field} = .*must be"):
        make()


@pytest.mark.parametrize(
    ("platens", "message"),
    [
        ([lsm.Platen("wall", [lsm.Fixed()])], "'wall': 1 drives"),
        ([lsm.Platen("wall", [lsm.Fixed(), 0.5])], "'wall': drive 0.5, must be one of .*'Fixed'"),
        ([lsm.Platen("wall", [lsm.Fixed()] * 2), lsm.Platen("none", [lsm.Fixed()] * 2)], "'none': no grain"),
    ],
)
def test_platens_that_make_no_sense_are_refused(runtime, platens, message):
    scene = scenes.scene(START[:2], [lsm.LinearElastic(K)], platen_index=np.array([0, -1]), platens=platens)
    with pytest.raises(lsm.InputError, match=message):
        scenes.simulate(scene)
