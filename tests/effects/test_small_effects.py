"""Rolling resistance, cohesion and global damping against closed forms, and the sets of effects that are refused."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.effects.restitution import damping_ratio_of
from tests.helpers import scenes

K, DENSITY = 1.0e6, 1000.0
G, GROUND = 9.81, 1.0e4  # m s-2; diameter of the fixed disc that is the ground [m]
ROLLING, SPEED = 0.05, 1.0
STIFF = 1.0e7  # the ground: arms are shorter by half the overlap


def rolling_disc(shapes=None):
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
            lsm.effects.RollingDamping(restitution=1.0),  # none, but where a test sets it
            lsm.Gravity((0.0, -G)),
        ],
        shapes=shapes,
        shape_index=[0, len(shapes) - 1] if shapes else 0,
        diameter=[GROUND, 1.0],
        thickness=1.0,
        platen_index=[0, -1],
        platens=[lsm.Platen("ground", [lsm.Fixed(), lsm.Fixed()])],
        velocity=np.array([(0.0, 0.0), (SPEED, 0.0)]),
        angular_velocity=np.array([(0.0,), (-SPEED / 0.5,)]),
        skin=0.2,
    )


@pytest.fixture(scope="module")
def rolling(runtime):
    """The simulation of `rolling_disc`."""
    return scenes.simulate(rolling_disc())


def test_a_rolling_disc_slows_down_by_two_thirds_of_mu_r_g(rolling):
    """m R^2 (1 + 1/2) dv/dt = -mu_r R F_n R."""
    sim = rolling
    sim.run(int(1.0 / sim.dt))
    v, angular_velocity = sim.state.velocity.to_numpy()[1, 0], sim.state.angular_velocity.to_numpy()[1, 0]
    assert SPEED - v == pytest.approx(2.0 / 3.0 * ROLLING * G * sim.time, rel=0.01)
    arm = 0.5 - 0.5 * DENSITY * np.pi / 4 * G / STIFF
    assert v == pytest.approx(-arm * angular_velocity, rel=1e-3)
    sums = sim.measure.sums()
    kinetic = 0.75 * DENSITY * np.pi / 4 * (SPEED**2 - v**2)
    assert sums["dissipated_rolling_resistance"] == pytest.approx(kinetic, rel=0.01)
    assert sums["dissipated_rolling_damping"] == 0.0
    sim.run(int(2.5 / sim.dt))
    assert abs(sim.state.velocity.to_numpy()[1, 0]) < 0.01 * SPEED  # it rocks on the spring


@pytest.mark.validate
def test_rolling_damping_of_arcs_is_that_of_the_disc(runtime):
    arcs = [lsm.disc(), lsm.shapes.regular_disc_of_arcs(30)]
    test_rolling_damping_slows_a_disc_exponentially(scenes.simulate(rolling_disc(arcs)))


@pytest.mark.validate
def test_rolling_damping_slows_a_sphere_that_rolls_and_pivots(runtime):
    """7/5 m R^2 domega/dt = -c a^2/4 omega of rolling, 2/5 m R^2 domega/dt = -c a^2/2 omega of pivoting."""
    mass, c = DENSITY * np.pi / 6, 2.0 * damping_ratio_of(0.5)
    depth = mass * G / STIFF
    effects = [lsm.LinearElastic(STIFF), lsm.ViscousDamping(restitution=0.1), lsm.CoulombFriction(0.8, 0.5 * STIFF)]
    effects += [lsm.effects.RollingDamping(0.5), lsm.Gravity((0.0, -G, 0.0))]
    start = np.array([(0.0, 0.0, 0.0), (0.0, 1.0, -SPEED / (0.5 - 0.5 * depth))])
    sim = scenes.simulate(
        scenes.scene(
            [(0.0, 0.0, 0.0), (0.0, 0.5 * (GROUND + 1.0) - depth, 0.0)],
            effects,
            diameter=[GROUND, 1.0],
            platen_index=[0, -1],
            platens=[lsm.Platen("ground", [lsm.Fixed()] * 3)],
            velocity=np.array([(0.0, 0.0, 0.0), (SPEED, 0.0, 0.0)]),
            angular_velocity=start,
            skin=0.2,
        )
    )
    sim.run(int(0.3 / sim.dt))  # then the slope of the ground has not yet made it faster
    rate = c * np.sqrt(STIFF * mass) * depth / (mass * 0.25)  # c a^2/(m R^2), a^2 = 2 R d
    omega, arm = sim.state.angular_velocity.to_numpy()[1], 0.5 - 0.5 * depth
    # Angular momentum about the contact over m R^2, which the spring of friction leaves alone.
    before, now = (
        v * arm - 0.1 * w for v, w in ((SPEED, start[1, 2]), (sim.state.velocity.to_numpy()[1, 0], omega[2]))
    )
    assert np.log(now / before) == pytest.approx(-rate / 4.0 / 1.4 * sim.time, rel=0.02)
    assert np.log(omega[1] / start[1, 1]) == pytest.approx(-rate / 2.0 / 0.4 * sim.time, rel=0.02)


def test_rolling_damping_slows_a_disc_exponentially(rolling):
    """3/2 m R^2 domega/dt = -c a^2/3 omega, a^2 = 2 R d, c = 2 zeta sqrt(k m), but no more than -3/8 a F_n."""
    scene, mass = rolling.scene, DENSITY * np.pi / 4
    scenes.effect(rolling, "rolling_resistance").mu_[0] = 0.0
    depth = mass * G / STIFF
    a = np.sqrt(2.0 * 0.5 * depth)
    omega = scene.angular_velocity / (1.0 - depth)  # the arm is shorter by half the depth
    columns = {"position": scene.position, "velocity": scene.velocity, "angular_velocity": omega}
    for restitution, limited in ((0.5, False), (0.1, True)):
        c = 2.0 * damping_ratio_of(restitution)
        scenes.effect(rolling, "rolling_damping").c_[0] = c
        scenes.reload(rolling, **columns)
        rolling.run(int(0.3 / rolling.dt))  # then the slope of the ground has not yet made it faster
        v, time = rolling.state.velocity.to_numpy()[1, 0], rolling.time
        rate = c * np.sqrt(STIFF * mass) * a**2 / 3.0 / (1.5 * mass * 0.25)
        expected = SPEED - 0.375 * a * G / (1.5 * 0.5) * time if limited else SPEED * np.exp(-rate * time)
        assert SPEED - v == pytest.approx(SPEED - expected, rel=0.02) and v < 0.99 * SPEED
        lost = rolling.measure.sums()["dissipated_rolling_damping"]
        assert lost == pytest.approx(0.75 * mass * (SPEED**2 - v**2), rel=0.02)


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
