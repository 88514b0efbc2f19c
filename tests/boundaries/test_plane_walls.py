"""Plane walls: impacts, rolling, rest, energy, and the same bits however the grains are stored."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.boundaries.wall_servo import SERVO_ROWS
from taichi_lsm.contact import neighbour_search
from taichi_lsm.core.allocation import read
from taichi_lsm.effects.global_damping import GlobalDamping
from taichi_lsm.effects.restitution import damping_ratio_of
from taichi_lsm.effects.rolling_resistance import RollingResistance
from tests.helpers import scenes
from tests.helpers.processes import run_module

K = 1e8
G = 9.81
SIDE = 10.0
COUNT = 24
FLOOR = lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 2.0))
BOX = [
    FLOOR,
    lsm.PlaneWall("left", (0.0, 0.0), (1.0, 0.0)),
    lsm.PlaneWall("right", (SIDE, 0.0), (-1.0, 0.0)),
    lsm.PlaneWall("lid", (0.0, SIDE), (0.0, -1.0)),
]
SERVO = lsm.WallServo(3e5, K, 4e3, 20.0)
PRESSED = [*BOX[:3], replace(BOX[3], servo=SERVO)]
HALL = [*BOX[:2], lsm.PlaneWall("right", (90.0, 0.0), (-1.0, 0.0)), lsm.PlaneWall("lid", (0.0, 90.0), (0.0, -1.0))]


def effects_of(gravity):
    return [
        lsm.LinearElastic(K),
        lsm.ViscousDamping(restitution=1.0),
        lsm.CoulombFriction(0.3, 0.5 * K),
        RollingResistance(0.0, 1e4),
        GlobalDamping(0.0),
        lsm.Gravity(gravity),
    ]


def box_of_discs(walls=BOX, **more):
    """24 discs in a box, far from each other."""
    rng = np.random.default_rng(5)
    place = np.stack(np.divmod(np.arange(COUNT), 5), axis=1) * 1.7 + 1.2
    return scenes.scene(place, effects_of((0.0, -G)), diameter=rng.uniform(0.7, 1.2, COUNT), walls=walls, **more)


def settings(sim, walls=BOX, restitution=1.0, friction=0.3, rolling=0.0, drag=0.0, gravity=(0.0, -G)):
    """Other values of the effects and walls, for the next `reload`."""
    sim.scene.walls = walls
    scenes.effect(sim, "viscous_damping").c_[0] = 2.0 * damping_ratio_of(restitution)
    scenes.effect(sim, "coulomb_friction").mu_[0] = friction
    scenes.effect(sim, "rolling_resistance").mu_[0] = rolling
    scenes.effect(sim, "global_damping").gamma_[0] = drag
    for axis, g in enumerate(gravity):
        scenes.effect(sim, "gravity").g_[axis] = g


def state(sim):
    """Everything that must not depend on threads or slots: {name: values}."""
    names = sorted(set(sim.grains.variables) - {"built_position"})
    servos = {f"servo_{row.name}": read(getattr(sim.walls.servos, row.name)) for row in SERVO_ROWS if sim.walls.servos}
    return {n: getattr(sim.state, n).to_numpy() for n in names} | sim.walls.snapshot() | servos


def same(first, second):
    return [name for name, value in first.items() if not np.array_equal(value, second[name])]


def fly(sim, seconds=1.0, dt=2e-4, walls=BOX):
    """A gas of discs that the lid, coming down and moving along, compresses and drags.

    Returns the energy of the grains and the balance of the budget at the start.
    """
    rng = np.random.default_rng(6)
    settings(sim, walls, restitution=0.8)
    v = rng.normal(0, 5, (COUNT, 2))
    start = box_of_discs().position
    scenes.reload(sim, dt, position=start, velocity=v, angular_velocity=rng.normal(0, 5, (COUNT, 1)))
    sim.walls.set_velocity("lid", (2.0, 0.0 if walls[3].servo else -4.0))
    before, balance = sum(scenes.energy(sim)), lsm.energies(sim).balance
    sim.run(int(seconds / sim.dt))
    return before, balance


@pytest.fixture(scope="module")
def discs(runtime):
    """With a lid that has a servo, so that any wall may have one."""
    return scenes.simulate(box_of_discs(PRESSED, dt=1e-4))


def one(sim, height, velocity, dt=None, steps=None):
    """All discs far apart but the first one, whose centre is so high above the floor; None: where it lies at rest.
    The step is given, or by how many steps an impact lasts. Returns its radius and mass."""
    r, mass = float(sim.state.radius.to_numpy()[0]), 1.0 / float(sim.state.inverse_mass.to_numpy()[0])
    x = np.stack([1.5 * np.arange(COUNT), np.full(COUNT, 50.0)], axis=1)
    v = np.zeros_like(x)
    x[0], v[0] = (5.0, r - mass * G / K if height is None else height), velocity
    scenes.reload(
        sim, dt or np.pi * np.sqrt(mass / K) / steps, position=x, velocity=v, angular_velocity=np.zeros((COUNT, 1))
    )
    return r, mass


@pytest.mark.parametrize("e", [1.0, 0.6])
def test_free_fall_and_restitution(discs, e):
    settings(discs, HALL, restitution=e)
    r, mass = one(discs, 1.0, (0.0, 0.0), 2e-6)
    h = 1.0 - r
    speed = np.sqrt(2 * G * h)
    discs.run(int((speed / G + 1.5 * np.pi * np.sqrt(mass / K)) / discs.dt))
    x, v = discs.state.position.to_numpy()[0], discs.state.velocity.to_numpy()[0]
    assert v[1] > 0 and discs.walls.snapshot()["force"][0, 1] == 0.0
    top = x[1] - r + v[1] ** 2 / (2 * G)
    # the weight m g acts beside a force of sqrt(k m) v: with dashpots the height changes by that ratio
    assert top == pytest.approx(e**2 * h, rel=1e-5 if e == 1.0 else 2 * G * np.sqrt(mass / K) / speed)
    assert x[0] == 5.0 and v[0] == 0.0


def test_impacts_on_walls_are_of_high_order(discs):
    """Impulses where the contact begins and ends: plain Verlet errs by 1e-3 with 20 steps per impact."""
    settings(discs, HALL, friction=0.0, gravity=(0.0, 0.0))
    error = []
    for steps in (20.3, 40.3):
        r, mass = one(discs, 0.65, (1.0, -3.0), steps=steps)
        discs.run(int((0.65 - r) / 3.0 / discs.dt + 1.5 * steps))
        v = discs.state.velocity.to_numpy()[0]
        assert v[1] > 0 and v[0] == 1.0
        error.append(abs(v[1] / 3.0 - 1))
    assert error[0] < 2e-5 and error[1] < error[0] / 8


def test_work_of_a_moving_wall_is_what_the_grain_gains(discs):
    """In the middle of the impact, where the force is greatest, and after it: there a speed of 4 m/s is right to 2e-5,
    as the test above says, which is 4e-5 of the gain."""
    settings(discs, [lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0), (0.7, 1.0)), *HALL[1:]], gravity=(0.0, 0.0))
    r, mass = one(discs, 0.65, (0.7, -3.0), steps=20.3)
    before = sum(scenes.energy(discs))
    first_touch = (0.65 - r) / 4.0 / discs.dt
    for steps, gain, error in ((10.15, None, 5e-3), (20.3, 0.5 * mass * (5.0**2 - 3.0**2), 4e-5)):
        discs.run(int(first_touch + steps + 5 * (gain is not None)) - discs.step)
        work = discs.walls.snapshot()["work"][0]
        assert work == pytest.approx(sum(scenes.energy(discs)) - before, rel=error)
        assert gain is None or work == pytest.approx(gain, rel=error)


def test_a_sliding_disc_ends_rolling_at_two_thirds_of_its_speed(discs):
    settings(discs, HALL)
    r, mass = one(discs, None, (3.0, 0.0), 2e-5)
    sliding = 3.0 / (3 * 0.3 * G)  # v0/(3 mu g)
    discs.run(int(0.9 * sliding / discs.dt))
    assert discs.state.velocity.to_numpy()[0, 0] > 2.05
    assert discs.measure.sums()["sliding_count"] == 1
    discs.run(int(0.6 * sliding / discs.dt))
    v, angular_velocity = discs.state.velocity.to_numpy()[0], discs.state.angular_velocity.to_numpy()[0, 0]
    assert v[0] == pytest.approx(2.0, rel=5e-3) and -angular_velocity * r == pytest.approx(2.0, rel=5e-3)


@pytest.mark.parametrize(("slope", "rolls"), [(0.9, False), (1.1, True)])
def test_rolling_resistance_holds_up_to_its_slope(discs, slope, rolls):
    """M <= mu_r R F_n, R that of the disc: the wall has no curvature. A tilted gravity stands for a tilted floor."""
    angle = np.arctan(0.1 * slope)
    gravity = (G * np.sin(angle), -G * np.cos(angle))
    settings(discs, HALL, restitution=0.5, friction=0.5, rolling=0.1, drag=5.0, gravity=gravity)
    one(discs, None, (0.0, 0.0), 5e-5)
    discs.run(80_000)
    speed = discs.state.velocity.to_numpy()[0, 0]
    if rolls:  # (slope - 1) mu_r g cos against the drag gamma v, both with the inertia of rolling, 3/2 m
        assert speed == pytest.approx((slope - 1) * 0.1 * G * np.cos(angle) / (1.5 * 5.0), rel=0.02)
    else:
        assert abs(speed) < 1e-4


def test_a_heap_weighs_on_the_walls(discs):
    settings(discs, restitution=0.3, drag=8.0)
    heap = box_of_discs()
    scenes.reload(discs, 2e-4, position=heap.position, velocity=heap.velocity, angular_velocity=heap.angular_velocity)
    discs.run(40_000)
    scenes.effect(discs, "global_damping").gamma_[0] = 400.0
    discs.run(60_000)
    weight = G / discs.state.inverse_mass.to_numpy()
    force = discs.walls.snapshot()["force"]
    assert force.sum(axis=0)[1] == pytest.approx(-weight.sum(), rel=1e-9)
    assert abs(force.sum(axis=0)[0]) < 1e-9 * weight.sum()
    assert force[0, 1] < -0.5 * weight.sum() and np.all(force[3] == 0.0)
    sums = discs.measure.sums()
    assert sums["contact_count"] >= COUNT
    # the trace of the stress is the virial of the outer forces
    x, r = discs.state.position.to_numpy(), discs.state.radius.to_numpy()
    rows = discs.walls.row_force.to_numpy()[: 4 * COUNT].reshape(COUNT, 4, 2)
    virial = np.sum(weight * x[:, 1])
    for w, n in enumerate(([0, -1], [-1, 0], [1, 0], [0, 1])):
        depth = rows[:, w] @ n / K
        virial += np.sum(rows[:, w] * (x + np.outer(r - 0.5 * depth, n)))
    assert np.trace(sums["stress_volume"]) == pytest.approx(virial, rel=1e-6)
    assert np.isnan(sums["stress"]).all()  # the cell is open: no volume is known


def test_energy_closes_between_moving_walls(discs):
    before, _ = fly(discs, dt=5e-5)
    after = sum(scenes.energy(discs))
    work = discs.walls.snapshot()["work"]
    assert work[3] > 0.05 * before and np.all(work[:3] == 0.0)
    assert after - before == pytest.approx(work.sum(), abs=4e-4 * work[3])


def test_a_lid_flies_freely_under_its_servo_up_to_the_limit(discs):
    """a = P/M, from rest half a step before the start; the work is P times the path, what the limit takes is lost."""
    steps, limited, dt, a = 100, 30, 1e-4, SERVO.force / SERVO.inertia
    for limit, path in ((1.0, steps * (steps + 1) / 2), (limited * a * dt, limited * (steps - (limited - 1) / 2))):
        lid = replace(HALL[3], servo=replace(SERVO, speed_limit=limit, damping_ratio=1e-12))
        settings(discs, [*HALL[:3], lid], gravity=(0.0, 0.0))
        one(discs, 1.0, (0.0, 0.0), dt)
        begin = lsm.energies(discs)
        discs.run(steps)
        now, wall = lsm.energies(discs), discs.walls.snapshot()
        assert wall["displacement"][3] == pytest.approx([0.0, -path * a * dt**2], rel=1e-9)
        assert now.work == pytest.approx(SERVO.force * path * a * dt**2, rel=1e-9)
        assert now.kinetic == pytest.approx(0.5 * SERVO.inertia * min(limit, (steps + 0.5) * a * dt) ** 2, rel=1e-9)
        assert now.balance == pytest.approx(begin.balance, abs=2e-4 * now.work)
        assert (now.dissipated > 0.5 * now.work) == (limit < 1.0)


def test_a_lid_that_lands_presses_with_the_force_of_its_servo(discs):
    """Discs in a row on the floor: the lid falls on the largest; the floor carries its force and the weights."""
    r, mass = discs.state.radius.to_numpy().astype(float), 1.0 / discs.state.inverse_mass.to_numpy()
    servo = replace(SERVO, force=1e5, damping_ratio=0.5)
    lid = lsm.PlaneWall("lid", (0.0, 2.0 * r.max() + 0.01), (0.0, -1.0), servo=servo)
    settings(discs, [*HALL[:3], lid], restitution=0.3, drag=8.0)
    x = np.stack([1.5 * np.arange(COUNT) + 1.0, r - mass * G / K], axis=1)
    scenes.reload(discs, 1e-4, position=x, velocity=0.0 * x, angular_velocity=np.zeros((COUNT, 1)))
    begin = lsm.energies(discs).balance
    discs.run(12_000)
    wall, now = discs.walls.snapshot(), lsm.energies(discs)
    assert wall["force"][3] == pytest.approx([0.0, 1e5], rel=1e-8, abs=1e-3)
    assert wall["force"][0, 1] == pytest.approx(-1e5 - G * mass.sum(), rel=1e-8)
    assert wall["displacement"][3, 1] == pytest.approx(-0.01 - 2.0 * 1e5 / K - mass[r.argmax()] * G / K, rel=0.05)
    assert now.work == pytest.approx(-1e5 * wall["displacement"][3, 1], rel=1e-9)
    assert now.balance == pytest.approx(begin, abs=2e-5 * now.work)
    discs.walls.set_servo("lid", replace(servo, force=5e4))
    discs.run(12_000)
    assert discs.walls.snapshot()["force"][3, 1] == pytest.approx(5e4, rel=1e-8)


def test_impacts_on_an_accelerated_lid_are_of_high_order(discs):
    """The onset correction needs the velocities of the lid in both last steps, which differ by 0.4 m/s and less."""
    lid = lsm.PlaneWall("lid", (0.0, 89.0), (0.0, -1.0), servo=lsm.WallServo(4e6, K, 1e4, 1e3, damping_ratio=1e-9))
    settings(discs, [*HALL[:3], lid], friction=0.0, gravity=(0.0, 0.0))
    error, radius = [], float(discs.state.radius.to_numpy()[0])
    for steps in (40.3, 80.3):
        _, mass = one(discs, 89.0 - radius - 0.0101, (0.0, 1.0), steps=steps)
        begin = lsm.energies(discs).balance
        discs.run(int(np.sqrt(0.02 / 400.0) / discs.dt + 2 * steps))
        assert discs.state.velocity.to_numpy()[0, 1] < -8.0 and discs.walls.snapshot()["force"][3, 1] == 0.0
        error.append(abs(lsm.energies(discs).balance - begin) / (0.5 * mass))
    assert error[0] < 3e-5 and error[1] < error[0] / 8


def test_energy_closes_under_a_lid_with_a_servo_that_drags(discs):
    _, begin = fly(discs, dt=5e-5, walls=PRESSED)
    now, wall = lsm.energies(discs), discs.walls.snapshot()
    assert wall["displacement"][3, 0] == pytest.approx(2.0, rel=1e-9)
    assert wall["displacement"][3, 1] < -1.0 and now.dissipated > 0.1 * now.work > 0.0
    assert now.balance == pytest.approx(begin, abs=4e-4 * now.work)


@pytest.mark.validate  # tests/physics/test_bits.py has a wall
def test_bits_do_not_depend_on_slots_and_survive_a_checkpoint(discs, tmp_path, monkeypatch):
    fly(discs, 0.6, walls=PRESSED)
    half = state(discs)
    lsm.save_checkpoint(discs, tmp_path / "half.nc")
    discs.run(2000)
    reference = state(discs)
    assert discs.rebuilds > 10 and len(same(half, reference)) > 5
    lsm.restore_checkpoint(discs, tmp_path / "half.nc")
    assert not same(state(discs), half)
    discs.run(2000)
    assert not same(state(discs), reference)
    monkeypatch.setattr(neighbour_search, "SORT_LEAST", 1)
    monkeypatch.setattr(neighbour_search, "SORT_INTERVAL", 1)
    fly(discs, 0.6, walls=PRESSED)
    discs.run(2000)
    assert not np.array_equal(discs.grains.slots, np.arange(COUNT))
    assert not same(state(discs), reference)


@pytest.mark.validate  # two processes; test_bits.py has a wall and compares threads in `make test`
def test_bits_do_not_depend_on_threads(tmp_path):
    digests = []
    for threads in (1, 2):
        file = tmp_path / f"{threads}.json"
        run_module("tests.boundaries.test_plane_walls", file, threads)
        digests.append(json.loads(file.read_text(encoding="utf-8")))
    assert digests[0] == digests[1]
    assert digests[0]["work"][3] > 0.0


def test_reset_refuses_walls_of_other_names_and_changes_nothing(discs):
    scene, before = discs.scene, state(discs)
    other = box_of_discs()
    other.walls = [replace(wall, name=f"other {wall.name}") for wall in PRESSED]
    with pytest.raises(lsm.InputError, match=r"Simulation.reset: walls .*'other"):
        discs.reset(other)
    assert discs.scene is scene and same(before, state(discs)) == []


def test_velocity_that_makes_no_sense_is_refused(discs):
    settings(discs, HALL)
    with pytest.raises(lsm.InputError, match=r"wall 'nowhere': no such wall, must be one of .*'floor'"):
        discs.walls.set_velocity("nowhere", (0.0, 0.0))
    with pytest.raises(lsm.InputError, match="wall 'floor': velocity = 'fast', must be 2 finite numbers"):
        discs.walls.set_velocity("floor", "fast")


def test_servos_that_make_no_sense_are_refused(discs):
    settings(discs, PRESSED)
    discs.walls.begin(PRESSED)
    with pytest.raises(lsm.InputError, match=r"wall 'lid': velocity = .*, must lie along the wall, whose servo"):
        discs.walls.set_velocity("lid", (0.0, -1.0))
    with pytest.raises(lsm.InputError, match=r"wall 'floor': servo = WallServo.*, must be a WallServo for a wall that"):
        discs.walls.set_servo("floor", SERVO)
    with pytest.raises(lsm.InputError, match=r"WallServo.inertia = 1.0: must be 4000.0 kg as at the start"):
        discs.walls.set_servo("lid", replace(SERVO, inertia=1.0))


def test_a_servo_too_light_for_the_step_is_refused_early(discs):
    """M >= K dt^2: before anything is compiled, at another step, and for a servo that is changed."""
    light = [*BOX[:3], replace(BOX[3], servo=replace(SERVO, inertia=0.9))]
    least = r"WallServo.inertia = 0.9: must be >= stiffness dt\^2 = 1 kg, for the wall oscillates .* lower the step"
    with pytest.raises(lsm.InputError, match=least):
        box_of_discs(light, dt=1e-4).chosen_dt()
    with pytest.raises(lsm.InputError, match=r"WallServo.inertia = 1e-06: must be >= stiffness dt\^2"):
        box_of_discs([*BOX[:3], replace(BOX[3], servo=replace(SERVO, inertia=1e-6))]).chosen_dt()
    settings(discs, PRESSED)
    with pytest.raises(lsm.InputError, match=r"WallServo.inertia = 4000.0: must be >= stiffness dt\^2 = 1e\+06 kg"):
        discs.set_time_step(0.1)
    scenes.reload(discs, 1e-4)
    with pytest.raises(lsm.InputError, match=r"WallServo.inertia = 4000.0: must be >= stiffness dt\^2 = 10000 kg"):
        discs.walls.set_servo("lid", replace(SERVO, stiffness=1e12))


def test_a_grain_that_goes_through_a_wall_stops_the_run(discs):
    settings(discs, HALL)
    one(discs, 0.7, (0.0, -500.0), 1e-4)
    with pytest.raises(lsm.SimulationError, match="grain 0: its centre went beyond wall 'floor'"):
        discs.run(100)


if __name__ == "__main__":
    gas = scenes.simulate(box_of_discs(parallel=True), threads=int(sys.argv[2]))
    fly(gas, 0.5)
    Path(sys.argv[1]).write_text(json.dumps({n: v.tolist() for n, v in state(gas).items()}), encoding="utf-8")
