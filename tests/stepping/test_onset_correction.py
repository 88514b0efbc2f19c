"""Collisions with the onset correction against plain Verlet, and the shadow energy."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

PAIRS = 200
STIFFNESS = 2000.0


def pairs_on_course(dim, rng):
    """Arguments of `scenes.scene`: 200 pairs of random grains in open space, each flying at each other off centre."""
    if dim == 2:
        shapes, _, diameter = lsm.shapes.voronoi_packing(64, 8.0, 1, corner_radius=0.08, gap=0.02)
        kind = rng.integers(0, len(shapes), 2 * PAIRS)
        diameter = diameter[kind]
        orientations = {"angle": rng.uniform(0, 2 * np.pi, 2 * PAIRS)}
    else:
        shapes = lsm.shapes.random_angular_polyhedra(6, 3)
        kind = rng.integers(0, len(shapes), 2 * PAIRS)
        diameter = np.ones(2 * PAIRS)
        orientations = {"orientation": lsm.random_rotations(rng, 2 * PAIRS, 3)}
    reach = np.array([s.bounding_radius for s in shapes])[kind] * diameter
    place = np.zeros((2 * PAIRS, dim))
    place[::2, 1] = place[1::2, 1] = 10.0 * np.arange(PAIRS)
    place[1::2, 0] = reach[::2] + reach[1::2] + 0.02
    place[1::2, 1] += rng.uniform(-0.6, 0.6, PAIRS) if dim == 2 else rng.uniform(-0.4, 0.4, PAIRS)
    velocity = np.zeros((2 * PAIRS, dim))
    velocity[::2, 0], velocity[1::2, 0] = 0.3, -0.3
    motion = {"velocity": velocity, "angular_velocity": rng.normal(0, 0.3, (2 * PAIRS, 1 if dim == 2 else 3))}
    return {"position": place, "shapes": shapes, "shape_index": kind, "diameter": diameter, **motion, **orientations}


class Collisions:
    """The pairs of `pairs_on_course` with one elasticity and integration, compiled once for all time steps."""

    def __init__(self, dim, elastic, integrator):
        self.dim, self.arguments = dim, pairs_on_course(dim, np.random.default_rng(3))
        more = {"density": 1.0, "thickness": 1.0, "skin": 0.1, "track_dissipation": False, **self.arguments}
        self.scene = scenes.scene(effects=[elastic], integrator=integrator, dt=1e-3, **more)
        self.sim = scenes.simulate(self.scene)

    def energy(self):
        """Kinetic energy of each pair."""
        mass, inertia = self.scene.masses()
        v, omega = self.sim.state.velocity.to_numpy(), self.sim.state.angular_velocity.to_numpy()
        own = self.sim.state.angular_momentum.to_numpy() if self.dim == 3 else inertia * omega
        each = 0.5 * mass * (v**2).sum(axis=1) + 0.5 * (own * omega).sum(axis=1)
        return each[::2] + each[1::2]

    def errors(self, dt=1e-3, time=4.0):
        """Relative energy error of the pairs (PAIRS,), nan for those that did not collide or have not parted."""
        self.scene.dt = dt
        self.sim.reset(self.scene)
        before = self.energy()
        self.sim.run(round(time / dt))
        collided = np.abs(self.sim.state.velocity.to_numpy() - self.scene.velocity).max(axis=1)[::2] > 1e-6
        touching = self.sim.state.force.to_numpy()[::2].any(axis=1)
        return np.where(collided & ~touching, self.energy() / before - 1.0, np.nan)


def rms(errors):
    """Root mean square of those that are numbers."""
    return np.sqrt(np.nanmean(errors**2))


@pytest.mark.skipif(scenes.PRECISION == "f32", reason="the errors are below the rounding of f32")
@pytest.mark.validate  # tests/experiments/test_accuracy_collisions.py has the order
@pytest.mark.parametrize("dim", [2, 3])
def test_onset_correction_cuts_the_error_of_collisions_by_thirty(dim):
    elastic = lsm.LinearElastic(STIFFNESS)
    plain, corrected = (Collisions(dim, elastic, i).errors() for i in (lsm.VelocityVerlet, lsm.OnsetVerlet))
    assert np.isfinite(plain).sum() > 100 and np.isfinite(corrected).sum() > 100
    assert rms(plain) / rms(corrected) > 30.0


def hertz_of_the_duration(duration, speed, mass, radius):
    """Hertz contact whose impacts of a reduced mass at this speed last as long; nu = 0.3."""
    depth = speed * duration / 2.9432
    modulus = 15.0 / 16.0 * mass * speed**2 / (np.sqrt(radius) * depth**2.5)
    return lsm.effects.Hertz(youngs_modulus=2.0 * (1.0 - 0.3**2) * modulus, poissons_ratio=0.3)


def error_of_a_collision(sim, duration, steps_per_contact):
    """Error of the energy after a head-on collision at 0.6 m/s, rms over where in the step the contact begins."""
    dt = duration / (steps_per_contact + 0.3)
    errors = []
    for phase in np.linspace(0.0, 1.0, 8, endpoint=False):
        velocity = np.array([[0.3, 0.0], [-0.3, 0.0]])
        position = sim.scene.position + np.array([[0.0, 0.0], [0.6 * dt * phase, 0.0]])
        scenes.reload(sim, dt, position=position, velocity=velocity)
        sim.run(int(0.02 / 0.6 / dt + 1.5 * steps_per_contact) + 2)
        assert sim.measure.sums()["contact_count"] == 0
        errors.append((sim.state.velocity.to_numpy() ** 2).sum() / 0.18 - 1.0)
    return np.sqrt(np.mean(np.square(errors)))


@pytest.mark.skipif(scenes.PRECISION == "f32", reason="the errors are below the rounding of f32")
@pytest.mark.validate  # compiles for long
@pytest.mark.parametrize("dim", [2, 3])
def test_collisions_of_angular_grains_converge_with_hertz(dim):
    """200 collisions off centre, on arcs, faces, edges and corners: the median, and the worst, none of which crosses a
    seam unnoticed (those that did, 3 % of the crossings, erred by 1.6e-6 at any step)."""
    duration = np.pi * np.sqrt(0.8 / (2.0 * STIFFNESS))
    hertz = hertz_of_the_duration(duration, 0.6, 0.4 if dim == 2 else 0.26, 0.25)
    pairs = Collisions(dim, hertz, lsm.OnsetVerlet)
    every = np.abs([pairs.errors(dt) for dt in (2e-3, 2.5e-4)])
    errors, worst = np.nanmedian(every, axis=1), np.nanmax(every, axis=1)
    print(f"{dim}D: median {errors}, worst {worst}")
    assert np.log(errors[0] / errors[1]) / np.log(8.0) > 3.3
    assert errors[1] < 1e-9 and worst[1] < 1e-7


# tests/experiments/test_accuracy_collisions.py has the order of linear contacts
@pytest.mark.parametrize("force_law", ["hertz", pytest.param("linear", marks=pytest.mark.validate)])
def test_head_on_collision_converges_at_fourth_order(force_law):
    """Verlet alone has order 2 with springs and 2.5 with Hertz's force."""
    duration = np.pi * np.sqrt(0.25 * np.pi / (2.0 * STIFFNESS))
    elastic = lsm.LinearElastic(STIFFNESS)
    if force_law == "hertz":
        elastic = hertz_of_the_duration(duration, 0.6, 0.125 * np.pi, 0.25)
    sim = scenes.simulate(scenes.scene([(0.0, 0.0), (1.02, 0.0)], [elastic], density=1.0, thickness=1.0, dt=1e-3))
    coarse, fine = error_of_a_collision(sim, duration, 25), error_of_a_collision(sim, duration, 100)
    assert np.log(coarse / fine) / np.log(4.0) > 3.5
    assert fine < scenes.tolerance(1e-7)


def test_shadow_energy_of_an_oscillation_is_flatter_than_the_energy():
    """Two grains in lasting contact, pressed by a third: the energy ripples, the shadow energy hardly moves."""
    effects = [lsm.LinearElastic(STIFFNESS), lsm.Gravity((-1.0, 0.0))]
    platens = [lsm.Platen("floor", [lsm.Fixed(), lsm.Fixed()])]
    scene = scenes.scene(
        [(0.0, 0.0), (0.999, 0.0)],
        effects,
        density=1.0,
        thickness=1.0,
        platen_index=[0, -1],
        platens=platens,
        area=1.0,
        dt=1e-3,
    )
    sim = scenes.simulate(scene)
    shadow = lsm.ShadowEnergy(sim)
    energies, shadows = [], []
    for _ in range(200):
        sim.run(1)
        energies.append(scenes.energy(sim)[0])
        shadows.append(energies[-1] + shadow.correction())
    assert np.ptp(shadows) < 0.05 * np.ptp(energies)
