"""Stress of a slab: a lattice in closed form, across the border of the cell, in motion, with and without a volume."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

K, PITCH, OVERLAP, THICKNESS = 1e5, 1.0, 0.01, 0.7
COLUMNS, ROWS = 4, 6
HIGH = ROWS * PITCH * np.sqrt(3.0) / 2.0
PRESSURE = np.sqrt(3.0) * K * OVERLAP / (PITCH * THICKNESS)


def lattice(thickness=THICKNESS):
    """Discs on a hexagonal lattice in a periodic cell, each with six contacts of force K OVERLAP."""
    column, row = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
    position = np.stack([(column + 0.5 * (row % 2)) * PITCH, (row + 0.5) * HIGH / ROWS], axis=-1).reshape(-1, 2)
    return scenes.scene(
        position,
        [lsm.LinearElastic(K)],
        diameter=np.full(len(position), PITCH + OVERLAP),
        lengths=(COLUMNS * PITCH, HIGH),
        periodic=(True, True),
        thickness=thickness,
        skin=0.05,
        dt=1e-5,
        integrator=lsm.VelocityVerlet,
    )


@pytest.fixture(scope="module")
def sim(runtime):
    return scenes.simulate(lattice())


def start(sim, shift=0.0, velocity=(0.0, 0.0)):
    x = sim.scene.position + np.array([0.0, shift])
    scenes.reload(sim, position=x, velocity=np.broadcast_to(velocity, x.shape).copy())
    return x


@pytest.mark.parametrize("runtime", ["f64", "f32"], indirect=True)
@pytest.mark.parametrize("slab", [(), (0.0, HIGH), (0.3, 0.3 + HIGH), (4.1, 5.9), (-0.4, 0.6)])
@pytest.mark.parametrize("cells", [0.0, 0.27, -3.0])
def test_stress_of_a_hexagonal_lattice(sim, slab, cells):
    """sqrt(3) k delta / (a b) along all axes, wherever the slab and the border of the cell lie."""
    start(sim, cells * HIGH)
    exact = scenes.tolerance(1e-11, 1e-5)
    sums = sim.measure.sums(*slab)
    bottom, top = slab or (0.0, HIGH)
    if top - bottom == pytest.approx(HIGH):
        assert sums["stress"] == pytest.approx(PRESSURE * np.eye(2), abs=exact * PRESSURE)
        assert sums["stress_volume"] == pytest.approx(sums["stress"] * COLUMNS * PITCH * HIGH * THICKNESS)
    # the same force crosses all planes: a slab of any height has the normal stress of the cell
    assert sums["stress"][1, 1] == pytest.approx(PRESSURE, rel=exact)


def test_a_motion_of_all_grains_together_is_no_stress(sim):
    for slab in ((), (0.0, 0.5 * HIGH)):
        start(sim)
        rest = sim.measure.sums(*slab)["stress"]
        start(sim, velocity=(10.0, -7.0))
        assert sim.measure.sums(*slab)["stress"] == pytest.approx(rest, abs=1e-9 * PRESSURE)


def test_kinetic_stress_is_that_of_the_fluctuations(sim):
    """Rows that move against each other at +-u, in a flow that carries all of them."""
    u = 3.0
    x = start(sim)
    rest = sim.measure.sums()["stress"]
    against = np.where(np.round(x[:, 1] / HIGH * ROWS - 0.5) % 2 == 0, u, -u)
    scenes.reload(sim, velocity=np.stack([10.0 + against, np.zeros(len(x))], axis=1))
    mass = sim.scene.masses()[0].sum()
    kinetic = mass * u**2 / (COLUMNS * PITCH * HIGH * THICKNESS)
    found, exact = sim.measure.sums()["stress"] - rest, scenes.tolerance(1e-9, 1e-7)
    assert found == pytest.approx(np.diag([kinetic, 0.0]), abs=exact * PRESSURE)


@pytest.mark.parametrize("cells", [0.0, 2.0])
def test_a_profile_is_no_stress(sim, cells):
    """Velocities that are linear in the height over the slab, also of grains that have crossed the border."""
    low, high, rate = 0.2, 0.2 + 0.9 * HIGH, 5.0
    x = start(sim)
    rest = sim.measure.sums(low, high)["stress"]
    flow = np.stack([1.5 + rate * ((x[:, 1] - low) % HIGH), np.zeros(len(x))], axis=1)
    scenes.reload(sim, position=x + np.array([0.0, cells * HIGH]), velocity=flow)
    assert sim.measure.sums(low, high, None, 1.5, rate)["stress"] == pytest.approx(rest, abs=1e-9 * PRESSURE)
    assert sim.measure.sums(low, high)["stress"][0, 0] > rest[0, 0] + 1e-3 * PRESSURE  # without the profile


def test_stress_is_over_the_volume_that_is_given_or_that_of_the_scene(sim):
    start(sim)
    whole = sim.measure.sums()["stress"]
    assert sim.measure.sums(volume=1.0)["stress"] == pytest.approx(whole * sim.measure.volume())
    sim.reset(lattice(2.0 * THICKNESS))
    assert sim.measure.sums()["stress"] == pytest.approx(0.5 * whole)
    sim.reset(lattice())


@pytest.mark.parametrize(
    ("slab", "message"),
    [
        ((1.0, 1.0), "high 1 m, must be > low"),
        ((0.0, 2.0 * HIGH), "periodic in y"),
        ((0.0,), "periodic in y"),
        ((0.0, 1.0, 0.0), "volume 0 m3, must be > 0"),
    ],
)
def test_refused_slabs(sim, slab, message):
    with pytest.raises(lsm.InputError, match=message):
        sim.measure.sums(*slab)
