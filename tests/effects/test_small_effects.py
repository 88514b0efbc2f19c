"""Rolling resistance, cohesion and global damping against closed forms, and the sets of effects that are refused."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

K, DENSITY = 1.0e6, 1000.0
G, GROUND = 9.81, 1.0e4  # m s-2; diameter of the fixed disc that is the ground [m]
ROLLING, SPEED = 0.05, 1.0
STIFF = 1.0e7  # the ground: arms are shorter by half the overlap


def rolling_disc():
    """A disc of diameter 1 that rolls on top of a fixed disc, so large that it is flat."""
    mass = DENSITY * np.pi / 4
    height = 0.5 * (GROUND + 1.0) - mass * G / STIFF
    return scenes.scene(
        [(0.0, 0.0), (0.0, height)],
        [
            lsm.LinearElastic(STIFF),
            lsm.ViscousDamping(restitution=0.1),
            lsm.CoulombFriction(0.8, 0.5 * STIFF),
            lsm.effects.RollingResistance(ROLLING, 0.1 * STIFF),
            lsm.Gravity((0.0, -G)),
        ],
        diameter=[GROUND, 1.0],
        thickness=1.0,
        platen_index=[0, -1],
        platens=[lsm.Platen("ground", [lsm.Fixed(), lsm.Fixed()])],
        velocity=np.array([(0.0, 0.0), (SPEED, 0.0)]),
        angular_velocity=np.array([(0.0,), (-SPEED / 0.5,)]),
        skin=0.2,
    )


def test_a_rolling_disc_slows_down_by_two_thirds_of_mu_r_g(runtime):
    """m R^2 (1 + 1/2) dv/dt = -mu_r R F_n R."""
    sim = scenes.simulate(rolling_disc())
    sim.run(int(1.0 / sim.dt))
    v, angular_velocity = sim.state.velocity.to_numpy()[1, 0], sim.state.angular_velocity.to_numpy()[1, 0]
    assert SPEED - v == pytest.approx(2.0 / 3.0 * ROLLING * G * sim.time, rel=0.01)
    arm = 0.5 - 0.5 * DENSITY * np.pi / 4 * G / STIFF
    assert v == pytest.approx(-arm * angular_velocity, rel=1e-3)
    sums = sim.measure.sums()
    kinetic = 0.75 * DENSITY * np.pi / 4 * (SPEED**2 - v**2)
    assert sums["dissipated_rolling_resistance"] == pytest.approx(kinetic, rel=0.01)
    sim.run(int(2.5 / sim.dt))
    assert abs(sim.state.velocity.to_numpy()[1, 0]) < 0.01 * SPEED  # it rocks on the spring


PULL_OFF, REACH = 50.0, 0.05


@pytest.fixture(scope="module")
def cohesive(runtime):
    """Two balls that cling to each other, drawn apart by opposite constant forces or left to themselves."""
    effects = [lsm.LinearElastic(K), lsm.effects.Cohesion(PULL_OFF, REACH)]
    return scenes.simulate(scenes.scene([(0.0, 0.0, 0.0), (1.02, 0.0, 0.0)], effects, skin=0.1))


def test_cohesion_takes_the_energy_of_its_reach_to_part_grains(cohesive):
    """From contact without overlap, f h/2 is needed to come free: below that the balls return, above they escape."""
    mass = DENSITY * np.pi / 6
    escape = np.sqrt(2.0 * PULL_OFF * REACH / (0.5 * mass) / 2.0)  # m*/2 v^2 = f h/2
    dt = 2e-5
    for share, parted in ((0.98, False), (1.02, True)):
        velocity = 0.5 * share * escape * np.array([(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
        scenes.reload(cohesive, dt, position=np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]), velocity=velocity)
        start, _ = scenes.energy(cohesive)
        gaps = []
        for _ in range(40):
            cohesive.run(int(0.2 * REACH / escape / dt))
            x = cohesive.state.position.to_numpy()
            gaps.append(float(x[1, 0] - x[0, 0]) - 1.0)
        assert (max(gaps) > REACH) == parted
        assert scenes.energy(cohesive)[0] == pytest.approx(start, abs=scenes.tolerance(1e-4) * PULL_OFF * REACH)
    assert cohesive.contacts().sizes["contact"] == 0 and not cohesive.state.force.to_numpy().any()


def test_grains_at_rest_overlap_by_the_pull_off_force_over_the_stiffness(cohesive):
    at_rest = 1.0 - PULL_OFF / K
    scenes.reload(cohesive, position=np.array([(0.0, 0.0, 0.0), (at_rest, 0.0, 0.0)]), velocity=np.zeros((2, 3)))
    cohesive.run(100)
    x = cohesive.state.position.to_numpy()
    assert x[1, 0] - x[0, 0] == pytest.approx(at_rest, abs=scenes.tolerance(1e-14, 1e-7))
    assert cohesive.measure.sums()["contact_count"] == 1


def test_global_damping_is_exponential_and_dissipates_what_it_takes(runtime):
    rate, dt = 0.7, 1e-3
    velocity = np.random.default_rng(1).standard_normal((5, 3))
    position = 4.0 * np.arange(15.0).reshape(5, 3)
    angular_velocity = velocity[:, ::-1].copy()
    effects = [lsm.effects.GlobalDamping(rate), lsm.CoulombFriction(0.5, K), lsm.LinearElastic(K)]
    sim = scenes.simulate(scenes.scene(position, effects, velocity=velocity, angular_velocity=angular_velocity, dt=dt))
    start, _ = scenes.energy(sim)
    sim.run(2000)
    left = np.exp(-rate * sim.time)
    assert sim.state.velocity.to_numpy() == pytest.approx(left * velocity, rel=1e-6)
    assert sim.state.angular_velocity.to_numpy() == pytest.approx(left * angular_velocity, rel=1e-6)
    energy, lost = scenes.energy(sim)
    assert energy + lost == pytest.approx(start, rel=1e-12)


SPHERE = [(0.0, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ([lsm.ViscousDamping(restitution=0.5)], "must be listed beside an elastic effect"),
        ([lsm.LinearElastic(K), lsm.Gravity((0.0, -G))], "must be 3 numbers"),
        ([lsm.LinearElastic(K), lsm.LinearElastic(K)], "may be listed once"),
    ],
)
def test_sets_of_effects_that_make_no_sense_are_refused(effects, words):
    with pytest.raises(lsm.InputError, match=words):
        scenes.scene(SPHERE, effects)


def test_a_scene_has_one_effect_of_each_role():
    class OtherFriction(lsm.CoulombFriction):
        pass

    with pytest.raises(lsm.InputError, match=r"'coulomb_friction', 'other_friction'.* of friction, one may be listed"):
        scenes.scene(SPHERE, [lsm.LinearElastic(K), lsm.CoulombFriction(0.5, K), OtherFriction(0.4, K)])
