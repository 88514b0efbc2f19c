"""Friction against closed forms: sliding to rolling, oblique impacts, and a spring that turns with its contact."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.rotation import advanced_orientation, rotate
from taichi_lsm.core.runtime import ti
from taichi_lsm.effects import contact_type
from taichi_lsm.effects.restitution import damping_ratio_of
from tests.helpers import scenes
from tests.helpers.sliders import Sliders

K, MU, G = 1.0e8, 0.3, 10.0
HARD = 1.0e12  # [N/m]: an impact is over before the discs have turned round each other


@pytest.mark.parametrize(
    ("dim", "rolling", "when"), [pytest.param(2, 2 / 3, 1 / 3, marks=pytest.mark.validate), (3, 5 / 7, 2 / 7)]
)
def test_sliding_turns_into_rolling(runtime, dim, rolling, when):
    """A grain thrown along a floor, with the flat top of one glued giant: v ends at 2/3 v0 (disc), 5/7 v0 (sphere)."""
    giant, v0 = 2.0e6, 1.0
    weight = (1000.0 * np.pi / 4 if dim == 2 else 1000.0 * np.pi / 6) * G
    sink = weight / K
    position = np.zeros((2, dim))
    position[0, 1] = -0.5 * giant
    position[1, 1] = 0.5 - sink
    velocity = np.zeros((2, dim))
    velocity[1, 0] = v0
    gravity = np.zeros(dim)
    gravity[1] = -G
    effects = [lsm.LinearElastic(K), lsm.CoulombFriction(MU, 20 * K), lsm.Gravity(tuple(gravity))]
    floor = lsm.Platen("floor", [lsm.Fixed()] * dim)
    sim = scenes.simulate(
        scenes.scene(
            position,
            effects,
            diameter=np.array([giant, 1.0]),
            velocity=velocity,
            platen_index=np.array([0, -1]),
            platens=[floor],
            area=1.0,
            thickness=1.0,
            skin=0.5,
            dt=1e-4,
        )
    )
    start, _ = scenes.energy(sim)
    slide_time = when * v0 / (MU * G)
    sim.run(int(0.8 * slide_time / sim.dt))
    assert sim.state.velocity.to_numpy()[1, 0] == pytest.approx(v0 - MU * G * sim.time, abs=1e-3)
    assert sim.measure.sums()["sliding_count"] == 1
    sim.run(int(0.2 * slide_time / sim.dt))
    speeds = []
    for _ in range(200):  # the spring rings when sliding ends: its mean counts
        sim.run(10)
        omega = sim.state.angular_velocity.to_numpy()[1, -1]
        speeds.append((sim.state.velocity.to_numpy()[1, 0], -0.5 * omega))
    v, rim = np.mean(speeds, axis=0)
    assert v == pytest.approx(rolling * v0, abs=2e-3)
    assert rim == pytest.approx(v, abs=5e-3)
    left, lost = scenes.energy(sim)
    mass = weight / G
    assert lost == pytest.approx(0.5 * mass * v0**2 * (1 - rolling), rel=1e-2)
    assert abs(left + lost - start) < 2e-3 * mass * v0**2


ANGLES = np.radians([10.0, 25.0, 40.0, 55.0, 70.0, 75.0, 80.0, 85.0])


@pytest.fixture(scope="module")
def oblique(runtime):
    """Pairs of equal discs that meet at angles from 10 to 85 degrees to the normal, with springs k_t = 10 k."""
    n = len(ANGLES)
    angle = np.linspace(0, 5, n)  # each pair lies in another direction
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    first = 5.0 * np.stack([np.arange(n), np.zeros(n)], axis=1)
    position = np.stack([first, first + normal], axis=1).reshape(-1, 2)
    velocity = 0.5 * (np.cos(ANGLES)[:, None] * normal + np.sin(ANGLES)[:, None] * tangent)
    effects = [lsm.LinearElastic(HARD), lsm.ViscousDamping(restitution=1.0), lsm.CoulombFriction(MU, 10 * HARD)]
    sim = scenes.simulate(scenes.scene(position, effects, skin=0.5, thickness=1.0))
    return sim, position, np.stack([velocity, -velocity], axis=1).reshape(-1, 2), normal, tangent


def collide(oblique, restitution, steps):
    sim, position, velocity, normal, tangent = oblique
    scenes.effect(sim, "viscous_damping").c_[0] = 2.0 * damping_ratio_of(restitution)
    mass = 1000.0 * np.pi / 4
    duration = np.pi * np.sqrt(0.5 * mass / HARD)
    angular_velocity = np.zeros((len(position), 1))
    scenes.reload(sim, duration / steps, position=position, velocity=velocity, angular_velocity=angular_velocity)
    sim.run(int(1.5 * steps))
    assert sim.contacts().sizes["contact"] == 0
    v = sim.state.velocity.to_numpy().reshape(-1, 2, 2)
    return v, sim.state.angular_velocity.to_numpy().reshape(-1, 2), mass


@pytest.mark.parametrize("e", [1.0, 0.6])
def test_oblique_impact_that_slides_all_the_way(oblique, e):
    """Beyond a grazing angle the impulse is mu times the normal one: Chung & Ooi (2011), tests 4 and 5, for discs."""
    v, omega, mass = collide(oblique, e, 4000)
    normal, tangent = oblique[3:]
    v_n, v_t = 0.5 * np.cos(ANGLES), 0.5 * np.sin(ANGLES)
    # relative slip 2 v_t stops under an impulse j with j (2/m + 2 r^2/I) = j 6/m: it slides if mu j_n stays below
    j = MU * mass * (1 + e) * v_n
    slides = 6 * j / mass < 0.7 * 2 * v_t
    assert 3 <= slides.sum() < len(ANGLES)
    out_n = np.sum(v[:, 1] * normal, axis=1)
    out_t = np.sum(v[:, 0] * tangent, axis=1)
    assert np.abs(out_n - e * v_n).max() < 1e-3
    assert (out_t - (v_t - j / mass))[slides] == pytest.approx(0, abs=5e-4)
    inertia = mass / 8
    assert (omega[:, 0] + 0.5 * j / inertia)[slides] == pytest.approx(0, abs=2e-3)
    assert omega[:, 0] == pytest.approx(omega[:, 1], rel=1e-12)  # equal discs rotate alike


def test_energy_of_oblique_impacts_closes(oblique):
    """At second order in dt; several steps, for the error depends on when in a step the contact begins and ends."""
    sim, _, velocity, *_ = oblique
    residual = []
    for steps in (50, 60, 70, 80, 800):
        _, _, mass = collide(oblique, 0.8, steps)
        start = 0.5 * mass * np.sum(velocity**2)
        left, lost = scenes.energy(sim)
        residual.append(abs(left + lost - start) / start)
        assert lost > 0.1 * start
    assert np.sqrt(np.mean(np.square(residual[:4]))) < 2e-5
    assert residual[4] < 2e-7


COUNT = 300


@ti.data_oriented
class RollingPair:
    """Contacts whose spring is loaded once, and then turned with the pair as one rigid body."""

    def __init__(self, effect):
        self.effect, self.contact_type = effect.bound(), contact_type(3)
        self.normal, self.slip, self.omega, self.force = (ti.Vector.field(3, ti.f64, COUNT) for _ in range(4))
        self.orientation = ti.Vector.field(4, ti.f64, COUNT)

    @ti.kernel
    def roll(self, steps: int, dt: ti.f64):
        for c in range(COUNT):
            memory = ti.Vector([0.0, 0.0, 0.0], ti.f64)
            orientation = ti.Vector([1.0, 0.0, 0.0, 0.0], ti.f64)
            for step in range(steps + 1):
                contact = self.contact_type(0)
                contact.touching, contact.normal_force, contact.dt = 1, 1.0e9, dt
                contact.slip = 0.0 * self.slip[c]
                if step == 0:
                    contact.slip = self.slip[c] / dt
                else:
                    last = rotate(orientation, self.normal[c])
                    orientation = advanced_orientation(orientation, self.omega[c], dt)
                    n = rotate(orientation, self.normal[c])
                    contact.normal_change = last.dot(n) * n - last
                    contact.normal_angular_velocity = self.omega[c].dot(rotate(orientation, self.normal[c]))
                contact.normal = rotate(orientation, self.normal[c])
                self.effect.on_contact(contact, memory)
                self.force[c] = contact.tangential_force
            self.orientation[c] = orientation


def test_spring_in_3d_turns_with_its_contact(runtime):
    """Rolled by 2 rad about any axis, also about the normal, the force is the first one turned by as much."""
    rng = np.random.default_rng(1)
    pair = RollingPair(lsm.CoulombFriction(MU, K))
    normal, slip, omega = rng.standard_normal((3, COUNT, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    omega *= 2.0 / np.linalg.norm(omega, axis=1)[:, None]
    omega[:50] = 2.0 * normal[:50]
    slip = 1e-3 * (slip - np.sum(slip * normal, axis=1)[:, None] * normal)
    for name, values in (("normal", normal), ("slip", slip), ("omega", omega)):
        getattr(pair, name).from_numpy(values)
    errors = []
    for steps in (500, 4000):
        pair.roll(steps, 1.0 / steps)
        w, v = np.split(pair.orientation.to_numpy(), [1], axis=1)
        first = -K * slip
        expected = first + 2 * np.cross(v, np.cross(v, first) + w * first)
        off = np.linalg.norm(pair.force.to_numpy() - expected, axis=1) / np.linalg.norm(first, axis=1)
        errors.append(off.max())
    assert errors[0] < 1e-5 and errors[1] < 0.03 * errors[0]  # of second order


@pytest.mark.parametrize("dim", [2, 3])
def test_dynamic_limit_holds_from_the_static_one_until_the_contact_sticks(runtime, dim):
    """A spring loaded to mu_s F_n drops to mu_d F_n, stays there while it slides, and is at mu_s again after a rest."""
    mu_s, mu_d, k_t = 0.6, 0.4, 1e3
    bench = Sliders(lsm.CoulombFriction(mu_s, k_t, mu_d), 3, dim=dim)
    step = 1e-3 * mu_s / k_t  # a thousand to the static limit
    bench.set(history=0.0, load=step, dt=1.0)
    bench.slide(999)
    assert bench.force.to_numpy() == pytest.approx(0.999 * mu_s, rel=scenes.tolerance(1e-9))
    assert np.all(bench.lost.to_numpy() == 0.0)
    bench.slide(3)
    assert bench.force.to_numpy() == pytest.approx(mu_d, rel=scenes.tolerance(1e-12, 1e-6))
    drop = 0.5 * (mu_s**2 - mu_d**2) / k_t
    assert bench.lost.to_numpy() == pytest.approx(drop + 2 * mu_d * step, rel=0.01)
    bench.slide(500)
    assert bench.lowest.to_numpy() == pytest.approx(mu_d, rel=scenes.tolerance(1e-12, 1e-6))
    assert bench.highest.to_numpy() == pytest.approx(mu_d, rel=scenes.tolerance(1e-12, 1e-6))
    bench.set(load=-step)
    bench.slide(1)
    bench.set(load=step)
    bench.slide(600)
    assert bench.highest.to_numpy() == pytest.approx(mu_s, abs=1e-3 * mu_s)


def test_equal_coefficients_are_plain_friction(runtime):
    outcome = []
    for effect in (lsm.CoulombFriction(MU, 1e3, MU), lsm.CoulombFriction(MU, 1e3)):
        bench = Sliders(effect, 50, dim=3)
        bench.set(history=0.0, load=np.linspace(-1e-5, 1e-5, 50), dt=1.0)
        bench.slide(100)
        outcome.append([bench.force.to_numpy(), bench.lost.to_numpy()])
    assert np.array_equal(*outcome)
    assert 0 < np.count_nonzero(outcome[0][1]) < 50


def test_values_of_another_variant_are_not_loaded(oblique):
    sim, position, velocity, *_ = oblique
    effects = [
        lsm.LinearElastic(HARD),
        lsm.ViscousDamping(restitution=1.0),
        lsm.CoulombFriction(MU, 10 * HARD, 0.5 * MU),
    ]
    with pytest.raises(lsm.InputError, match="static and dynamic"):
        sim.reset(scenes.scene(position, effects, velocity=velocity, skin=0.5, thickness=1.0))


def test_refusals():
    with pytest.raises(lsm.InputError, match=r"dynamic_coefficient = 0.4: must be from 0 to coefficient, 0.3"):
        lsm.CoulombFriction(0.3, 1.0, 0.4)
    for coefficient, stiffness in ((-0.1, 1.0), (np.nan, 1.0), (0.5, 0.0), (0.5, np.inf)):
        with pytest.raises(lsm.InputError, match="CoulombFriction"):
            lsm.CoulombFriction(coefficient, stiffness)
