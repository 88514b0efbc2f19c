"""What must not change: energy of conservative scenes to order dt^2, momenta to rounding, the balance with losses."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

SEEDS = 8


def thermal(sim, seed, temperature=1e-4):
    """Start the packing with random velocities and angular velocities [m/s, rad/s], and no momentum."""
    rng = np.random.default_rng(seed)
    arguments = sim.scene
    n, speed = len(sim), np.sqrt(temperature * scenes.STIFFNESS / 800.0)
    velocity = speed * rng.standard_normal((n, 2))
    mass = arguments.masses()[0]
    velocity -= (mass[:, None] * velocity).sum(axis=0) / mass.sum()
    columns = {"position": arguments.position, "velocity": velocity}
    if sim.spec.rotates:
        columns["angular_velocity"] = 2 * speed * rng.standard_normal((n, 1))
    if sim.grains.has("orientation"):
        columns["orientation"] = np.stack([np.cos(arguments.angle), np.sin(arguments.angle)], axis=1)
    return columns


def drift(sim, columns, dt, duration, samples):
    """Greatest relative change of the energy over a fixed duration."""
    scenes.reload(sim, dt, **columns)
    start, _ = scenes.energy(sim)
    worst = 0.0
    for _ in range(samples):
        sim.run(round(duration / samples / dt))
        worst = max(worst, abs(scenes.energy(sim)[0] / start - 1))
    return worst


@pytest.mark.parametrize("name", ["elastic_discs", pytest.param("elastic_arcs", marks=pytest.mark.validate)])
def test_energy_drift_falls_as_the_square_of_the_step(reference_packing, name):
    sim = reference_packing(name)
    contact_time = np.pi * np.sqrt(sim.scene.masses()[0].mean() / (2 * scenes.STIFFNESS))
    samples, duration = 20, 20 * contact_time
    per_contact = np.array([50, 80, 130, 220, 400])
    drifts = []
    for seed in range(SEEDS):
        start = thermal(sim, seed)
        drifts.append([drift(sim, start, contact_time / n, duration, samples) for n in per_contact])
    drifts = np.array(drifts)
    assert sim.measure.sums()["contact_count"] > 60
    order = -np.polyfit(np.log(per_contact), np.log(drifts).mean(axis=0), 1)[0]
    assert order == pytest.approx(2.0, abs=0.25)
    assert np.sqrt((drifts[:, 0] ** 2).mean()) < 1e-3


def falling_together(dim, speed=2.0, count=40):
    """An isolated cluster of grains that fly at each other: angular ones in 2D, spheres in 3D."""
    rng = np.random.default_rng(dim)
    side = int(np.ceil(count ** (1 / dim)))
    lattice = np.stack(np.unravel_index(np.arange(count), (side,) * dim), axis=1)
    position = 1.25 * (lattice - 0.5 * side) + rng.uniform(-0.05, 0.05, (count, dim))
    angular_velocities = 1 if dim == 2 else 3
    return scenes.scene(
        position,
        scenes.frictional(1e7),
        shapes=lsm.shapes.random_angular_shapes(5, 2) if dim == 2 else None,
        shape_index=np.arange(count) % 5 if dim == 2 else 0,
        diameter=rng.uniform(0.8, 1.1, count),
        angle=rng.uniform(0, 6, count) if dim == 2 else None,
        velocity=-speed * position + 0.3 * rng.standard_normal((count, dim)),
        angular_velocity=2 * rng.standard_normal((count, angular_velocities)),
    )


PLANE = pytest.param(2, marks=pytest.mark.validate)


@scenes.both_precisions
@pytest.mark.parametrize("dim", [PLANE, 3])
def test_momenta_of_an_isolated_cluster_are_exact(runtime, dim):
    sim = scenes.simulate(falling_together(dim))
    linear0, _, angular0, _ = scenes.momenta(sim)
    touched = 0
    for _ in range(10):
        sim.run(200)
        touched = max(touched, sim.measure.sums()["contact_count"])
        linear, size, angular, angular_size = scenes.momenta(sim)
        assert np.abs(linear - linear0).max() < scenes.tolerance(1e-12, 1e-6) * size
        assert np.abs(angular - angular0).max() < scenes.tolerance(1e-10, 1e-5) * angular_size
    assert touched > 20 and sim.rebuilds > 2
    assert sum(v for k, v in sim.measure.sums().items() if k.startswith("dissipated")) > 0


@pytest.fixture(scope="module")
def collapse(runtime):
    """A column of frictional, damped angular grains above a floor of glued discs."""
    rng = np.random.default_rng(4)
    floor = np.stack([np.arange(24) - 11.5, np.zeros(24)], axis=1)
    column = np.stack(np.divmod(np.arange(60), 12), axis=1) @ np.diag([1.25, 1.25]) + [-2.5, 1.3]
    position = np.concatenate([floor, column + rng.uniform(-0.05, 0.05, column.shape)])
    n = len(position)
    glued = np.arange(n) < 24
    return scenes.simulate(
        scenes.scene(
            position,
            [*scenes.frictional(1e7), lsm.Gravity((0.0, -10.0))],
            shapes=[lsm.disc(), *lsm.shapes.random_angular_shapes(6, 9)],
            shape_index=np.where(glued, 0, 1 + np.arange(n) % 6),
            angle=rng.uniform(0, 6, n),
            platen_index=np.where(glued, 0, -1),
            platens=[lsm.Platen("floor", [lsm.Fixed()] * 2)],
            area=1.0,
        )
    )


def test_energy_balance_of_a_collapse_closes(collapse):
    sim, scene = collapse, collapse.scene
    n = len(sim)
    columns = {"position": scene.position, "velocity": np.zeros((n, 2)), "angular_velocity": np.zeros((n, 1))}
    columns["orientation"] = np.stack([np.cos(scene.angle), np.sin(scene.angle)], axis=1)
    coarse = sim.dt
    residual = []
    for fraction in (1, 4, 16):
        scenes.reload(sim, coarse / fraction, **columns)
        start, none = scenes.energy(sim)
        assert none == 0.0
        worst = 0.0
        for _ in range(20):
            sim.run(round(0.05 / sim.dt))
            left, lost = scenes.energy(sim)
            worst = max(worst, abs(left + lost - start))
        residual.append(worst / lost)
        sums = sim.measure.sums()
        assert lost > 0.1 * abs(start)  # most of the fall is over
        assert sums["dissipated_coulomb_friction"] > 0.02 * lost
        assert sums["dissipated_viscous_damping"] > 0.02 * lost
    assert residual[0] < 5e-3
    assert residual[2] < 0.2 * residual[0]
