"""The cell whose height a servo moves: affine flow, pressure work, normal stress, neighbours, energy and bits."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.allocation import read
from tests.helpers import scenes
from tests.helpers.processes import run_module

K = scenes.STIFFNESS
RATE = 0.4
WIDE, HIGH = 11.0, 9.0
PRESSURE = 0.02 * K  # 2 % of overlap


def value(row):
    """The one number of a row of the cell."""
    return float(read(row)[0])


def gas(dim, servo, rate=RATE):
    """Grains too small to meet, with velocities of their own."""
    rng = np.random.default_rng(3)
    lengths = (WIDE, HIGH, 7.0)[:dim]
    return scenes.scene(
        rng.uniform(-1.0, 2.0, (12, dim)) * lengths,
        [lsm.LinearElastic(K)],
        diameter=1e-3,
        velocity=rng.normal(0.0, 0.5, (12, dim)),
        lengths=lengths,
        periodic=(True,) * dim,
        thickness=2.0,
        shear_rate=rate,
        cell_servo=servo,
        dt=1e-2,
        skin=0.2,
        guards=lsm.Guards(displacement=None, step=None),
    )


def relative(sim):
    """Velocities of the grains relative to the mean flow, of a gas, on which no force acts."""
    return sim.state.velocity.to_numpy() - sim.domain.mean_flow(sim.state.position.to_numpy())


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.validate)])
def test_a_gas_follows_the_affine_flow_and_takes_its_pressure_work(runtime, dim):
    """A light height under a stress far above that of the gas falls at its speed limit: h(t) is known."""
    limit, steps = 0.3, 400
    sim = scenes.simulate(gas(dim, lsm.CellServo(1e6, 1.0, 1e-3, limit)))
    x, w, mass = sim.scene.position, sim.scene.velocity, sim.scene.masses()[0]
    volume = HIGH * sim.domain.area[0]
    # The kinetic stress of the measure and of the servo is sum m w w / V.
    sums = sim.measure.sums()
    momentum = (mass[:, None] * w).sum(axis=0)
    expected = (np.einsum("n,na,nb->ab", mass, w, w) - np.outer(momentum, momentum) / mass.sum()) / volume
    assert sums["stress"] == pytest.approx(expected, rel=1e-12)
    assert value(sim.domain.force) == pytest.approx((mass * w[:, 1] ** 2).sum() / HIGH, rel=1e-12)

    sim.run(steps)
    t, h = sim.time, HIGH - limit * sim.time
    assert value(sim.domain.height) == pytest.approx(h, rel=1e-12) and h < 0.9 * HIGH
    # Images: strain of the cell, and the displacement of the image above, rate times the integral of the height.
    shift = RATE * 0.5 * (HIGH + h) * t
    assert value(sim.domain.strain) == pytest.approx(RATE * t) and value(sim.domain.shift) == pytest.approx(shift)
    # Along y: w_y h is constant, and y/h changes by w_y dt/h^2 integrated. Along x: less rate times the own path.
    own_path = w[:, 1] * HIGH * np.log(HIGH / h) / limit
    y = x[:, 1] * h / HIGH + w[:, 1] * t
    found = sim.state.position.to_numpy()
    assert found[:, 1] == pytest.approx(y, abs=1e-11)
    now = relative(sim)
    assert now[:, 1] == pytest.approx(w[:, 1] * HIGH / h, rel=1e-11)
    assert now[:, 0] == pytest.approx(w[:, 0] - RATE * own_path, abs=1e-6)
    assert found[:, 2:] == pytest.approx(x[:, 2:] + w[:, 2:] * t, abs=1e-11)
    # Work: of the shear on w_x w_y, and of the pressure on w_y, which the grains take to the last joule.
    gained = 0.5 * (mass * (now[:, 0] ** 2 - w[:, 0] ** 2)).sum()
    assert sim.measure.sums()["shear_work"] == pytest.approx(gained, rel=1e-9)
    pressed = 0.5 * (mass * w[:, 1] ** 2).sum() * ((HIGH / h) ** 2 - 1.0)
    assert 0.5 * (mass * (now[:, 1] ** 2 - w[:, 1] ** 2)).sum() == pytest.approx(pressed, rel=1e-11)
    assert lsm.energies(sim).work - gained == pytest.approx(1e6 * sim.domain.area[0] * (HIGH - h), rel=1e-12)


@pytest.mark.validate
def test_the_origin_of_the_flow_may_be_anywhere(runtime):
    """The same gas as seen from another height: grains and images lie where they did."""
    found = []
    for up in (0.0, 3.7 * HIGH):
        scene = gas(2, lsm.CellServo(1.0, 1.0, 5e-3, 0.3))
        scene.position[:, 1] += up
        sim = scenes.simulate(scene)
        sim.run(300)
        h = value(sim.domain.height)
        x = sim.state.position.to_numpy() - up / HIGH * np.array([value(sim.domain.shift), h])
        found.append(np.concatenate([x.ravel(), relative(sim).ravel(), [h]]))
    assert abs(found[0][-1] / HIGH - 1.0) > 0.01
    assert found[1] == pytest.approx(found[0], abs=1e-9)


@pytest.mark.validate
def test_energy_of_a_gas_that_carries_its_lid(runtime):
    """The stress of the gas itself, without drag worth naming: the height oscillates, and the budget is closed."""
    scene = gas(2, lsm.CellServo(1.0, 1e-12, 2e-2, 100.0, 1e-9), rate=0.0)
    mass = scene.masses()[0]
    stress = (mass * scene.velocity[:, 1] ** 2).sum() / (HIGH * WIDE * 2.0)
    scene.cell_servo = replace(scene.cell_servo, stress=1.3 * stress)
    sim = scenes.simulate(scene)
    first, heights, balance = lsm.energies(sim), [], []
    for _ in range(60):
        sim.run(100)
        heights.append(value(sim.domain.height))
        balance.append(lsm.energies(sim).balance - first.balance)
    assert min(heights) < 0.9 * HIGH and min(heights) < heights[-1] - 0.1  # it comes back
    assert np.abs(balance).max() < 1e-4 * first.kinetic


def servo(stress=PRESSURE, limit=20.0, least=0.0):
    """Of the 48 grains of a packing, whose mass is about 4e4 kg."""
    return lsm.CellServo(stress, 2.0 * K, 1e4, limit, least_height=least)


def packed(body="discs", skin=None, parallel=None, rate=RATE):
    """48 frictional grains, dense."""
    more = scenes.packing(body)
    return scenes.scene(
        effects=scenes.frictional(),
        shear_rate=rate,
        cell_servo=servo(),
        dt=2e-4,
        skin=skin,
        parallel=parallel,
        thickness=1.0,
        **more,
    )


@pytest.fixture(scope="module")
def dense(runtime):
    return scenes.simulate(packed())


def begin(sim, **more):
    """Shear from the packing."""
    sim.reset(packed(**more))
    sim.rebuilds = 0


def image_distances(sim):
    """Distances of all pairs i < j to their nearest image, by brute force over images, and the pairs."""
    lengths, x = sim.domain.lengths, sim.state.position.to_numpy()
    up = np.array([value(sim.domain.shift), lengths[1]])
    upright = x - np.outer(np.floor(x[:, 1] / lengths[1]), up)
    upright[:, 0] %= lengths[0]
    i, j = np.triu_indices(len(x), 1)
    turns = np.rint(up[0] / lengths[0])
    d = [
        upright[j] + n * up + [(m - n * turns) * lengths[0], 0.0] - upright[i] for n in (-1, 0, 1) for m in range(-3, 4)
    ]
    return np.linalg.norm(d, axis=2).min(axis=0), i, j


def listed_pairs(sim):
    """Pairs of ids on the list, the lower one first."""
    starts, ids = sim.pairs.row_start.to_numpy(), sim.grains.id.to_numpy()
    first = np.repeat(ids[: len(sim)], np.diff(starts[: len(sim) + 1]))
    return set(zip(first.tolist(), sim.pairs.second_id.to_numpy()[: len(first)].tolist(), strict=True))


def test_grains_that_rest_in_the_flow_are_listed_before_it_brings_them_together(runtime):
    """Six rows of two discs: no grain moves against the flow, so that the deformation alone outdates the list."""
    x, y = np.meshgrid([2.0, 6.3], HIGH / 6.0 * np.arange(6))
    rows = {
        "position": np.stack([x.ravel(), y.ravel()], axis=1),
        "diameter": np.ones(12),
        "velocity": np.zeros((12, 2)),
    }
    sim = scenes.simulate(replace(gas(2, lsm.CellServo(1e6, 1.0, 1e-3, 0.5), rate=0.005), dt=1e-3, **rows))
    found = 0
    for _ in range(62):
        sim.run(100)
        distance, i, j = image_distances(sim)
        touching = distance < 1.0
        assert set(zip(i[touching].tolist(), j[touching].tolist())) <= listed_pairs(sim)
        found = max(found, touching.sum())
    assert found >= 6 and sim.rebuilds >= 2


def test_no_contact_is_missed_while_the_height_oscillates(dense):
    """A stress that rises and falls far beyond what the grains bear: the list must follow shear and stretch."""
    begin(dense, skin=0.25)
    r, heights, stretched = dense.state.radius.to_numpy(), [], 0.0
    for turn in range(60):
        dense.domain.set_servo(servo(PRESSURE * (4.0 if turn % 20 < 10 else 0.05)))
        dense.run(137)
        stretched = max(stretched, abs(value(dense.domain.stretch_since)))
        heights.append(value(dense.domain.height))
        distance, i, j = image_distances(dense)
        touching = distance < r[i] + r[j]
        assert touching.sum() > 10
        assert set(zip(i[touching].tolist(), j[touching].tolist())) <= listed_pairs(dense)
    assert np.ptp(heights) > 0.1 and stretched > 0.01


@pytest.mark.parametrize(("stretch", "shift"), [(1.0, 0.0), (0.93, 2.9), (1.3, -31.7)])
def test_the_list_of_a_stretched_cell_is_that_of_brute_force(dense, stretch, shift):
    begin(dense)
    rng, domain = np.random.default_rng(2), dense.domain
    lengths, r = np.array(dense.scene.lengths), dense.state.radius.to_numpy()
    domain.height[0], domain.shift[0] = stretch * lengths[1], shift
    domain.settle()
    tried = 0
    for _ in range(20):
        dense.state.position.from_numpy(rng.uniform(-2.0, 2.0, (len(dense), 2)) * lengths)
        if dense.search.count(dense.dt, dense.scene.guards) > dense.pairs.capacity:
            continue
        tried += 1
        dense.neighbours.write()
        distance, i, j = image_distances(dense)
        near = distance < r[i] + r[j] + dense.skin
        assert listed_pairs(dense) == set(zip(i[near].tolist(), j[near].tolist()))
    assert tried > 15


def test_stress_is_held_and_the_energy_budget_closed(dense):
    begin(dense)
    dense.run(10_000)
    first, before = lsm.energies(dense), dense.domain.snapshot()
    stress, work = [], 0.0
    for _ in range(80):
        dense.run(250)
        stress.append(dense.measure.sums()["stress"][1, 1])
    last, after = lsm.energies(dense), dense.domain.snapshot()
    work = dense.measure.sums()["shear_work"]
    assert dense.rebuilds > 20 and last.dissipated - first.dissipated > 4 * first.stored
    assert abs(last.balance - first.balance) < 1e-4 * work
    # The mean stress over all steps: the servo's, and what moves the height and its drag.
    area, drive, time = value(dense.domain.area), servo(), 20_000 * dense.dt
    mean = (after["force_sum"] - before["force_sum"]) / 20_000
    momentum = drive.inertia * (after["speed"] - before["speed"]) + drive.drag * (after["height"] - before["height"])
    assert mean == pytest.approx(PRESSURE * area + momentum / time, rel=1e-3)
    assert np.mean(stress) * area == pytest.approx(mean, rel=0.02)  # of the samples, by the measure


def test_consolidation_then_shear_then_constant_volume(dense):
    """At rest the grains are pressed; shear begins without a jolt; the height is held from one step to the next."""
    begin(dense, rate=0.0)
    dense.run(4000)
    assert dense.measure.sums()["shear_work"] == 0.0 and value(dense.domain.shift) == 0.0
    before = dense.measure.sums()
    dense.domain.set_shear_rate(RATE)
    after = dense.measure.sums()
    for name in ("translational_energy", "elastic_energy"):
        assert after[name] == pytest.approx(before[name], rel=1e-9)
    dense.run(1000)
    assert value(dense.domain.shift) > 0.0
    first = lsm.energies(dense)
    dense.domain.set_servo(replace(servo(), speed_limit=0.0))
    assert lsm.energies(dense).balance == pytest.approx(first.balance, abs=1e-5 * first.stored)
    height, work = value(dense.domain.height), value(dense.domain.work)
    dense.run(1000)
    assert value(dense.domain.height) == height and value(dense.domain.work) == work
    with pytest.raises(lsm.InputError, match=r"CellServo.inertia.*as at the start"):
        dense.domain.set_servo(replace(servo(), inertia=1.0))
    with pytest.raises(lsm.InputError, match="nan s-1, must be a finite number"):
        dense.domain.set_shear_rate(float("nan"))


def test_the_height_comes_to_rest_at_the_least_one(dense):
    """The stop takes the energy of its speed once; a height at rest loses nothing more."""
    scene = packed(rate=0.0)
    least = scene.lengths[1] - 0.04
    scene.cell_servo = servo(5.0 * PRESSURE, least=least)
    dense.reset(scene)
    first = lsm.energies(dense)
    dense.run(4000)
    assert value(dense.domain.height) == pytest.approx(least, abs=1e-12) and value(dense.domain.speed) == 0.0
    dissipated, work = value(dense.domain.dissipated), value(dense.domain.work)
    assert dissipated > 0.1 * work > 0.0
    dense.run(1000)
    assert value(dense.domain.dissipated) == dissipated and value(dense.domain.height) == pytest.approx(least)
    assert lsm.energies(dense).balance == pytest.approx(first.balance, abs=1e-3 * work)


def test_a_restored_run_gives_the_same_bits(dense, tmp_path):
    begin(dense)
    dense.domain.set_servo(servo(1.7 * PRESSURE))
    dense.domain.set_shear_rate(2.0 * RATE)
    dense.run(1000)
    lsm.save_checkpoint(dense, tmp_path / "half.nc")
    ends = []
    for _ in range(2):
        dense.run(1500)
        ends.append(state_of(dense))
        dense.reset(packed())  # what the file says replaces all of it
        lsm.restore_checkpoint(dense, tmp_path / "half.nc")
        assert dense.domain.servo == servo(1.7 * PRESSURE)
    assert [n for n in ends[0] if not np.array_equal(ends[0][n], ends[1][n])] == []


def state_of(sim):
    """{name: values} of grains and cell now."""
    names = ("position", "velocity", "angular_velocity", "shear_work", "dissipated")
    return {name: getattr(sim.state, name).to_numpy() for name in names} | sim.domain.snapshot()


def driven(sim, body):
    """{name: values} after a run from the start."""
    sim.rebuilds = 0
    sim.run(5000 if body == "discs" else 2000)
    return state_of(sim) | {"rebuilds": sim.rebuilds}


@pytest.mark.parametrize("body", ["discs", pytest.param("arcs", marks=pytest.mark.validate)])
def test_bits_depend_neither_on_threads_nor_on_the_skin(dense, tmp_path, body):
    """One thread here; two in a process of its own, with another skin."""
    sim = dense if body == "discs" else scenes.simulate(packed(body))
    sim.reset(packed(body, 0.05))
    here = driven(sim, body)
    run_module("tests.boundaries.test_driven_cell", tmp_path / "shared.npz", 2, 0.15, body)
    with np.load(tmp_path / "shared.npz") as arrays:
        shared = dict(arrays)
    assert here["rebuilds"] > 2 * shared["rebuilds"] > 4
    assert [n for n in here if n != "rebuilds" and not np.array_equal(here[n], shared[n])] == []


def test_a_cell_that_becomes_too_low_stops_the_run(dense):
    begin(dense)
    dense.domain.height[0] = 2.0
    dense.domain.settle()
    with pytest.raises(lsm.SimulationError, match=r"height of the cell fell to 2 m, must be >= .* begin with more"):
        dense.rebuild_neighbours()


def test_what_cannot_be_driven_is_refused():
    given_servo = servo()

    def cell(given=given_servo, periodic=(True, True), **more):
        effects = [lsm.LinearElastic(K)]
        return scenes.scene([(1.0, 1.0)], effects, lengths=(9.0, 9.0), periodic=periodic, cell_servo=given, **more)

    assert lsm.KernelSpec.of(cell()).sheared and not lsm.KernelSpec.of(cell(None)).cell_servo
    with pytest.raises(lsm.InputError, match=r"Scene.cell_servo: 5.0, must be CellServo"):
        cell(5.0)
    with pytest.raises(lsm.InputError, match=r"Scene.cell_servo: given needs a cell that is periodic along x and y"):
        cell(periodic=(True, False))
    with pytest.raises(lsm.InputError, match=r"Scene.area: 3 m2, must be left out with a cell_servo"):
        cell(area=3.0)
    with pytest.raises(lsm.InputError, match=r"ForestRuth, whose steps differ in length; must be a Verlet scheme"):
        cell(integrator=lsm.ForestRuth)
    with pytest.raises(lsm.InputError, match=r"CellServo.stress.*> 0 Pa"):
        servo(-1.0)
    with pytest.raises(lsm.InputError, match=r"CellServo.speed_limit.*0 for a constant height"):
        servo(limit=-1.0)


if __name__ == "__main__":
    sim = scenes.simulate(packed(sys.argv[4], float(sys.argv[3]), True), threads=int(sys.argv[2]))
    np.savez(sys.argv[1], **driven(sim, sys.argv[4]))
