"""Platens under an imposed shear stress or at a velocity, and under a servo with a spring behind it; and their work."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.stepping.step_loop_cpu import StepLoopCPU
from taichi_lsm.stepping.step_loop_gpu import StepLoopGPU
from tests.helpers import scenes

K, STRESS, LIMIT = 1.0e4, 200.0, 0.04
COLUMN = K / 3  # stiffness of three contacts in series
BASE, PRESS, SLED = 0, 1, 2
INERTIA, AREA = 3.0e3, 0.5
START = np.array([(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (20.0, 0.0), (21.4, 0.0)])


def servo(stress, normal_stiffness=0.0):
    return lsm.ServoWithSpring(stress, 1, COLUMN, INERTIA, LIMIT, 0.5, normal_stiffness)


@pytest.fixture(scope="module")
def sim(runtime):
    """A column of two discs between a base and a press; far away a sled that can push against one free disc."""
    platens = [
        lsm.Platen("base", [lsm.Fixed(), lsm.Fixed()]),
        lsm.Platen("press", [lsm.Fixed(), servo(STRESS / AREA)]),
        lsm.Platen("sled", [lsm.VelocityOrStress(INERTIA, velocity=0.0), lsm.Fixed()]),
    ]
    return scenes.simulate(
        scenes.scene(
            START,
            [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=0.3)],
            platen_index=np.array([BASE, -1, -1, PRESS, SLED, -1]),
            platens=platens,
            thickness=1.0,
            area=AREA,
            dt=1e-3,
        )
    )


def restart(sim, lift=0.0):
    sim.platens.set("press", 1, servo(STRESS / AREA))
    push(sim, velocity=0.0)
    position = START + np.array([0.0, lift]) * (np.arange(6) == 3)[:, None]
    scenes.reload(sim, position=position, velocity=np.zeros((6, 2)))


def push(sim, **by):
    sim.platens.set("sled", 0, lsm.VelocityOrStress(INERTIA, **by))


def sled(sim):
    """(displacement, velocity, work, kinetic energy) of the sled along its way."""
    now = sim.platens.snapshot()
    moved, speed, work = (float(now[name][SLED, 0]) for name in ("displacement", "velocity", "work"))
    return moved, speed, work, 0.5 * INERTIA * speed**2


def test_a_free_platen_is_accelerated_by_its_stress_and_keeps_the_budget_as_its_drive_changes(sim):
    restart(sim)
    steps, rate = 400, -600.0 * AREA / INERTIA
    push(sim, stress=-600.0)
    sim.run(steps)
    moved, speed, work, kinetic = sled(sim)
    assert speed == pytest.approx(rate * steps * sim.dt, rel=1e-12)
    assert moved == pytest.approx(0.5 * rate * steps * (steps + 1) * sim.dt**2, rel=1e-12)
    assert work == pytest.approx(kinetic, rel=1e-12)
    # at a velocity, reached at a bounded rate from the velocity that the stress has given
    push(sim, velocity=0.2, acceleration=0.5)
    assert sled(sim) == (moved, speed, work, kinetic)
    sim.run(100)
    assert sled(sim)[1] == pytest.approx(speed + 0.5 * 100 * sim.dt, rel=1e-12)
    sim.run(1000)
    assert sled(sim)[1] == 0.2
    assert sled(sim)[2] == pytest.approx(0.5 * INERTIA * 0.2**2, rel=1e-10)
    # and back: the platen goes on from 0.2 m/s
    push(sim, stress=60.0)
    sim.run(100)
    _, speed, work, kinetic = sled(sim)
    assert speed == pytest.approx(0.2 + 60.0 * AREA / INERTIA * 100 * sim.dt, rel=1e-12)
    assert work == pytest.approx(kinetic, rel=1e-10)
    assert sim.platens.snapshot()["dissipated"][SLED, 0] == 0.0


def test_the_work_of_a_stress_against_contacts_is_in_the_budget(sim):
    restart(sim)
    push(sim, stress=300.0)
    sim.run(1)
    before = lsm.energies(sim)
    sim.run(6000)  # in between the sled has hit the disc
    after, now = lsm.energies(sim), sim.platens.snapshot()
    assert -now["force_sum"][SLED, 0] * sim.dt > 100.0  # [N s]
    moved, speed, work, _ = sled(sim)
    assert work == pytest.approx(300.0 * AREA * moved, rel=1e-3)  # tau A times the way, of the mean velocities
    momentum = INERTIA * speed - now["force_sum"][SLED, 0] * sim.dt
    assert momentum == pytest.approx(300.0 * AREA * sim.time, rel=1e-10)
    assert after.balance - before.balance == pytest.approx(0.0, abs=2e-3 * (after.work - before.work))


def test_the_stress_of_a_servo_rises_on_its_spring_and_the_budget_stays_closed(sim):
    restart(sim)
    sim.run(30_000)
    begun = sim.platens.snapshot()
    assert sim.platens.force.to_numpy()[PRESS, 1] == pytest.approx(STRESS, rel=1e-6)
    assert begun["stretch"][PRESS, 1] == 0.0  # not yet put in
    stiff = 2e3 / AREA
    sim.platens.set("press", 1, servo(0.5 * STRESS / AREA, stiff))
    sim.run(30_000)
    rise = 0.5 * STRESS / (COLUMN + stiff * AREA)  # S/2 + k_n A u = S - K u
    now = sim.platens.snapshot()
    assert now["stretch"][PRESS, 1] == pytest.approx(rise, rel=1e-6)
    assert now["displacement"][PRESS, 1] - begun["displacement"][PRESS, 1] == pytest.approx(rise, rel=1e-6)
    assert sim.platens.force.to_numpy()[PRESS, 1] == pytest.approx(0.5 * STRESS + stiff * AREA * rise, rel=1e-6)
    assert servo(0.5 * STRESS / AREA, stiff).stress_at(rise) == pytest.approx((0.5 * STRESS + 2e3 * rise) / AREA)
    done = now["work"][PRESS, 1] - begun["work"][PRESS, 1]
    assert done == pytest.approx(-0.5 * STRESS * rise - 0.5 * stiff * AREA * rise**2, rel=1e-6)
    # the work of servo and spring and what the column gave are in the drag and the dashpots
    lost = now["dissipated"][PRESS, 1] - begun["dissipated"][PRESS, 1]
    gave = 0.5 / COLUMN * (STRESS**2 - (STRESS - COLUMN * rise) ** 2)
    assert 0.0 < lost < gave + done
    assert lsm.energies(sim).balance == pytest.approx(0.0, abs=2e-3 * gave)


def test_a_servo_on_its_spring_never_pulls_the_platen_away(sim):
    """Above a gap the stress falls with the height; below 0 the drag alone acts, and the platen does not come back."""
    restart(sim, lift=3.0)
    stiff = 2e4 / AREA
    sim.platens.set("press", 1, servo(STRESS / AREA, stiff))
    loose = -STRESS / (stiff * AREA)  # where there is no stress
    heights = []
    for _ in range(400):
        sim.run(10)
        heights.append(sim.platens.displacement.to_numpy()[PRESS, 1])
    assert min(heights) < 1.5 * loose and np.all(np.diff(heights) <= 0.0)
    assert servo(STRESS / AREA, stiff).stress_at(2.0 * loose) == 0.0


@pytest.mark.validate
def test_both_step_loops_give_the_same_bits(sim):
    found = []
    for loop in (StepLoopCPU(sim.stages), StepLoopGPU(sim.stages)):
        sim.step_loop = loop
        restart(sim)
        sim.platens.set("press", 1, servo(STRESS / AREA, 4e3))
        push(sim, stress=3000.0)
        sim.run(1500)
        push(sim, velocity=-0.1, acceleration=1.0)
        sim.run(500)
        found.append(sim.platens.snapshot() | {"position": sim.state.position.to_numpy()})
    assert found[0]["stretch"][PRESS, 1] != 0.0 and found[0]["force_sum"][SLED, 0] < 0.0
    assert [name for name in found[0] if not np.array_equal(found[0][name], found[1][name])] == []


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: lsm.VelocityOrStress(1.0), "velocity = None"),
        (lambda: lsm.VelocityOrStress(1.0, velocity=1.0, stress=1.0), "velocity = 1.0"),
        (lambda: lsm.VelocityOrStress(1.0, stress=np.nan), "stress = nan"),
        (lambda: lsm.VelocityOrStress(0.0, stress=1.0), "inertia = 0.0"),
        (lambda: lsm.VelocityOrStress(1.0, velocity=1.0, acceleration=0.0), "acceleration = 0.0"),
        (lambda: servo(1.0, -1.0), "normal_stiffness = -1.0"),
        (lambda: servo(0.0), "stress = 0.0"),
    ],
)
def test_values_out_of_range_name_the_drive_and_the_field(make, field):
    with pytest.raises(lsm.InputError, match=rf"\.{field}.*must be"):
        make()


def test_drives_that_the_step_does_not_resolve_or_that_were_not_compiled_are_refused(sim):
    restart(sim)
    most = INERTIA / sim.dt**2 / AREA
    with pytest.raises(lsm.InputError, match=r"normal_stiffness = .*must be <= inertia/\(dt\^2 area\) = 6e\+09"):
        sim.platens.set("press", 1, servo(STRESS, 1.01 * most))
    with pytest.raises(lsm.InputError, match=r"inertia = 1\.0: must be 3000\.0 kg as at the start"):
        sim.platens.set("sled", 0, lsm.VelocityOrStress(1.0, stress=1.0))
    with pytest.raises(lsm.InputError, match="ConstantVelocity cannot replace VelocityOrStress"):
        sim.platens.set("sled", 0, lsm.ConstantVelocity(0.0))
