"""Aggregates that break as they collide: energy budget, the same bits for any threads, checkpoints, load, fragments."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from tests import bonds_run, scenes

ROOT = Path(__file__).resolve().parents[2]
STEPS = 3000
RUNS = {"one thread": (1, "alone", 0.1), "two threads, other skin": (2, "shared", 0.2)}


@pytest.fixture(scope="module")
def rubble(runtime):
    return scenes.simulate(bonds_run.rubble())


def test_energy_budget_closes_and_fragments_are_counted(rubble):
    rubble.load(bonds_run.rubble())
    aggregates, whole = 9, bonds_run.PIECES
    assert np.array_equal(lsm.fragments(rubble), np.repeat(np.arange(aggregates), whole))
    begin, _ = scenes.energy(rubble)
    balance = []
    for _ in range(10):
        rubble.run(STEPS // 10)
        balance.append(sum(scenes.energy(rubble)) / begin - 1)
    sums = rubble.measure.sums()
    print(balance, sums["dissipated_elastic_brittle_bond"] / begin, rubble.bonds.contact_gain.to_numpy().sum() / begin)
    assert np.abs(balance).max() < 1e-3
    assert sums["dissipated_elastic_brittle_bond"] > 0.03 * begin
    assert rubble.bonds.contact_gain.to_numpy().sum() > 0.03 * begin
    assert 0 < sums["bond_count"] == rubble.bonds.intact.to_numpy().sum() < rubble.bonds.count - 10
    labels = lsm.fragments(rubble)
    assert aggregates < labels.max() + 1 < len(rubble)
    for piece in range(len(rubble)):  # no bond reaches from one aggregate into another
        assert set(np.flatnonzero(labels == labels[piece]) // whole) == {piece // whole}
    intact = rubble.scene.bonds[rubble.bonds.intact.to_numpy() == 1]
    assert np.array_equal(labels[intact[:, 0]], labels[intact[:, 1]])


def test_intact_bonds_are_on_no_list_and_broken_ones_are(rubble):
    rubble.load(bonds_run.rubble())

    def listed():
        starts = rubble.pairs.row_start.to_numpy()[: len(rubble) + 1]
        first = rubble.grains.id.to_numpy()[np.repeat(np.arange(len(rubble)), np.diff(starts))]
        return set(zip(first.tolist(), rubble.pairs.partner_id.to_numpy()[: starts[-1]].tolist()))

    bonds = set(map(tuple, rubble.scene.bonds.tolist()))
    assert not listed() & bonds
    rubble.run(STEPS)
    intact = rubble.bonds.intact.to_numpy() == 1
    assert not listed() & set(map(tuple, rubble.scene.bonds[intact].tolist()))
    assert listed() & set(map(tuple, rubble.scene.bonds[~intact].tolist()))


def test_a_partly_broken_aggregate_is_restored_bit_for_bit(rubble, tmp_path):
    file = tmp_path / "checkpoint.nc"
    rubble.load(bonds_run.rubble())
    rubble.run(STEPS)
    lsm.save_checkpoint(rubble, file)
    half = bonds_run.digest(rubble)
    assert 0 < rubble.measure.sums()["bond_count"] < rubble.bonds.count
    rubble.run(STEPS)
    end = bonds_run.digest(rubble)
    second = scenes.simulate(bonds_run.rubble())
    lsm.restore_checkpoint(second, file)
    assert bonds_run.digest(second) == half
    second.run(STEPS)
    assert bonds_run.digest(second) == end != half
    with pytest.raises(lsm.InputError, match="Simulation.load"):
        fewer = bonds_run.rubble()
        fewer.bonds = fewer.bonds[1:]
        rubble.load(fewer)


def test_the_bits_do_not_depend_on_threads_or_on_the_list(tmp_path):
    results = []
    for threads, path, skin in RUNS.values():
        file = tmp_path / f"{threads}.json"
        command = [sys.executable, "-m", "tests.bonds_run", str(file), str(STEPS), str(threads)]
        done = subprocess.run([*command, path, str(skin)], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        results.append(json.loads(file.read_text(encoding="utf-8")))
    one, two = results
    assert one["finite"] and 0 < one["intact"] < one["bonds"] - 10 and one["rebuilds"] > two["rebuilds"]
    assert [name for name, value in one["digest"].items() if two["digest"][name] != value] == []


def test_a_launch_per_stage_gives_the_same_bits(rubble):
    """The path of a GPU, taken by the CPU."""
    rubble.load(bonds_run.rubble())
    rubble.run(STEPS)
    crew = bonds_run.digest(rubble)
    rubble.load(bonds_run.rubble())
    rubble.integrator.offloaded = True
    rubble.run(STEPS)
    rubble.integrator.offloaded = False
    assert rubble.bonds.intact.to_numpy().sum() < rubble.bonds.count - 10
    assert bonds_run.digest(rubble) == crew


@pytest.mark.parametrize("pieces", (7, 12))
def test_an_aggregate_is_whole_and_has_the_area_of_a_disc(pieces):
    grain = lsm.angular_aggregate(pieces, 3, corner_radius=0.05)
    assert len(grain.shapes) == pieces and (grain.diameter**2).sum() == pytest.approx(1.0)
    assert np.allclose(grain.diameter**2 @ grain.position, 0.0, atol=1e-12)
    links = np.eye(pieces, dtype=int)
    links[tuple(grain.pairs.T)] = links[tuple(grain.pairs.T[::-1])] = 1
    assert (np.linalg.matrix_power(links, pieces) > 0).all()
    assert 0.5 < grain.reach < 1.2
    with pytest.raises(ValueError, match="pieces = 1"):
        lsm.angular_aggregate(1, 3, 0.05)
    with pytest.raises(ValueError, match="corner_radius"):
        lsm.angular_aggregate(pieces, 3, 0.0)
