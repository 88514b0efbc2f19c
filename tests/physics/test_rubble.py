"""Aggregates that break as they collide: energy budget, the same bits for any threads, checkpoints, load, fragments."""

import json

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.stepping.step_loop_gpu import StepLoopGPU
from tests.helpers import bonds_run, scenes
from tests.helpers.processes import run_module

STEPS = 3000

pytestmark = pytest.mark.validate  # compiles and runs for long; test_freed_contacts has the small forms


@pytest.fixture(scope="module")
def rubble(runtime):
    return scenes.simulate(bonds_run.rubble())


def test_energy_budget_closes_and_fragments_are_counted(rubble):
    rubble.reset(bonds_run.rubble())
    aggregates, whole = 9, bonds_run.PIECES
    assert np.array_equal(lsm.fragments(rubble), np.repeat(np.arange(aggregates), whole))
    begin, _ = scenes.energy(rubble)
    balance, fracture = [], [rubble.state.dissipated.to_numpy()[:, -1]]
    for _ in range(100):
        rubble.run(STEPS // 100)
        balance.append(sum(scenes.energy(rubble)) / begin - 1)
        fracture.append(rubble.state.dissipated.to_numpy()[:, -1])
    sums = rubble.measure.sums()

    assert np.abs(balance).max() < 1e-3
    assert sums["dissipated_elastic_brittle_bond"] > 0.03 * begin
    assert (np.diff(fracture, axis=0) >= 0.0).all()  # no break creates energy
    gain = rubble.bonds.contact_gain.to_numpy()
    assert (gain >= 0.0).all() and gain.sum() > 1e-3 * begin
    assert 0 < sums["bond_count"] == rubble.bonds.intact.to_numpy().sum() < rubble.bonds.count - 10
    labels = lsm.fragments(rubble)
    assert aggregates < labels.max() + 1 < len(rubble)
    for piece in range(len(rubble)):  # no bond reaches from one aggregate into another
        assert set(np.flatnonzero(labels == labels[piece]) // whole) == {piece // whole}
    intact = rubble.scene.bonds[rubble.bonds.intact.to_numpy() == 1]
    assert np.array_equal(labels[intact[:, 0]], labels[intact[:, 1]])


def test_intact_bonds_are_on_no_list_and_broken_ones_are(rubble):
    rubble.reset(bonds_run.rubble())

    def listed():
        starts = rubble.pairs.row_start.to_numpy()[: len(rubble) + 1]
        first = rubble.grains.id.to_numpy()[np.repeat(np.arange(len(rubble)), np.diff(starts))]
        return set(zip(first.tolist(), rubble.pairs.second_id.to_numpy()[: starts[-1]].tolist()))

    bonds = set(map(tuple, rubble.scene.bonds.tolist()))
    assert not listed() & bonds
    rubble.run(STEPS)
    intact = rubble.bonds.intact.to_numpy() == 1
    assert not listed() & set(map(tuple, rubble.scene.bonds[intact].tolist()))
    assert listed() & set(map(tuple, rubble.scene.bonds[~intact].tolist()))


def test_the_bits_do_not_depend_on_the_launches_or_on_the_list(rubble):
    """The path of a GPU, taken by the CPU, with another skin."""
    rubble.reset(bonds_run.rubble())
    rubble.rebuilds = 0
    rubble.run(STEPS)
    reference, rebuilds = bonds_run.digest(rubble), rubble.rebuilds
    rubble.reset(bonds_run.rubble())
    skin, loop = rubble.skin, rubble.step_loop
    rubble.set_skin(2.0 * skin)
    rubble.rebuild_neighbours()
    rubble.step_loop, rubble.rebuilds = StepLoopGPU(rubble.stages), 0
    rubble.run(STEPS)
    assert type(rubble.step_loop) is StepLoopGPU  # a list that outgrows its storage would have replaced it
    rubble.step_loop = loop
    rubble.set_skin(skin)
    assert rubble.bonds.intact.to_numpy().sum() < rubble.bonds.count - 10
    assert rubble.rebuilds < rebuilds
    assert different(bonds_run.digest(rubble), reference) == []


def test_threads_and_a_checkpoint_of_broken_aggregates_change_no_bit(rubble, tmp_path):
    """Two threads in a process of their own: from the start, and from the checkpoint that one thread has left."""
    rubble.reset(bonds_run.rubble())
    rubble.run(STEPS)
    half = bonds_run.digest(rubble)
    lsm.save_checkpoint(rubble, tmp_path / "half.nc")
    assert 0 < rubble.measure.sums()["bond_count"] < rubble.bonds.count - 10
    rubble.run(STEPS)
    end = bonds_run.digest(rubble)
    assert {"intact", "force", "sums"} <= set(different(half, end))
    run_module("tests.helpers.bonds_run", tmp_path, STEPS, 2, scenes.PRECISION)
    theirs = json.loads((tmp_path / "digests.json").read_text(encoding="utf-8"))
    assert different(theirs["half"], half) == []
    assert different(theirs["end"], end) == []
    fewer = bonds_run.rubble()
    fewer.bonds = fewer.bonds[1:]
    with pytest.raises(lsm.InputError, match=r"Simulation.reset"):
        rubble.reset(fewer)


def different(digest, other):
    """Names of the columns that are not the same bits; the travel of a grain goes on when a scene is loaded."""
    assert set(digest) == set(other)
    return [name for name, value in digest.items() if other[name] != value and name != "travel"]


@pytest.mark.parametrize("pieces", [7, 12])
def test_an_aggregate_is_whole_and_has_the_area_of_a_disc(pieces):
    grain = lsm.shapes.angular_aggregate(pieces, 3, corner_radius=0.05)
    assert len(grain.shapes) == pieces and (grain.diameter**2).sum() == pytest.approx(1.0)
    assert np.allclose(grain.diameter**2 @ grain.position, 0.0, atol=1e-12)
    links = np.eye(pieces, dtype=int)
    links[tuple(grain.pairs.T)] = links[tuple(grain.pairs.T[::-1])] = 1
    assert (np.linalg.matrix_power(links, pieces) > 0).all()
    assert 0.5 < grain.reach < 1.2
    with pytest.raises(ValueError, match="pieces = 1"):
        lsm.shapes.angular_aggregate(1, 3, 0.05)
    with pytest.raises(ValueError, match="corner_radius"):
        lsm.shapes.angular_aggregate(pieces, 3, 0.0)
