"""The neighbour list against every pair tested one by one, and what pairs remember across rebuilds."""

import itertools

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.boundaries.periodic_cell import Domain
from taichi_lsm.contact import neighbour_search
from taichi_lsm.contact.neighbour_list import NeighbourList, grown
from taichi_lsm.contact.neighbour_search import BUFFER, SORT_INTERVAL, NeighbourSearch, morton_code
from taichi_lsm.contact.pair_storage import Pairs
from taichi_lsm.stepping.grain_state import Grains
from taichi_lsm.stepping.kernel_spec import KernelSpec
from tests.helpers import scenes

COUNT = 300
SKIN = 0.1


class Finder:
    """Search and list without forces: one compilation serves every placing of COUNT grains."""

    def __init__(self, dim, periodic):
        self.dim, self.periodic = dim, periodic
        spec = KernelSpec(dim=dim, count=COUNT, rotates=True, kind="chain", history=2)
        self.grains = Grains(spec)
        self.grains.set_column("platen_index", -1)
        self.grains.set_column("radius", 0.5)
        self.domain = Domain((10.0,) * dim, periodic)
        self.search = NeighbourSearch(spec, self.grains, self.domain, SKIN)
        capacity = self.grains.slot_of.shape[0]
        self.pairs = Pairs(spec, capacity, COUNT * COUNT // 2)
        self.list = NeighbourList(self.search, self.pairs)

    def find(self, position, radius, lengths):
        """Set (n, 2) of listed pairs of ids, in list order, after a rebuild at these places."""
        lengths = np.array(lengths, float)
        self.domain.length.from_numpy(lengths)
        self.domain.inverse_length.from_numpy(1.0 / lengths)
        self.grains.set_column("position", position)
        self.grains.set_column("radius", radius)
        self.search.grid.set_width(2.0 * radius.max() + SKIN)
        self.search.count(0.0, lsm.Guards())
        self.list.write()
        return self.listed()

    def rows(self):
        """Slots of the first grain of every list entry."""
        starts = self.pairs.row_start.to_numpy()[: COUNT + 1]
        return np.repeat(np.arange(COUNT), np.diff(starts))

    def listed(self):
        first = self.rows()
        return np.stack([self.grains.id.to_numpy()[first], self.pairs.second_id.to_numpy()[: len(first)]], axis=1)


def brute_force(position, radius, lengths, periodic):
    """All pairs (i < j) nearer than the sum of radii and the skin."""
    apart = position[:, None] - position[None]
    for axis, (length, repeats) in enumerate(zip(lengths, periodic)):
        if repeats:
            apart[..., axis] -= length * np.round(apart[..., axis] / length)
    near = np.linalg.norm(apart, axis=2) < radius[:, None] + radius + SKIN
    return np.argwhere(np.triu(near, 1))


@pytest.fixture(scope="module")
def finders(runtime):
    return {2: Finder(2, (True, False)), 3: Finder(3, (True, False, True))}


CELLS = {"two cells": 2.1, "three cells": 3.3, "many cells": 20.0, "crowded": 3.3}


def placed(rng, dim, case):
    """position, radius, lengths of a case; the cell's periodic lengths count in widths of the search cells."""
    wide = case == "wide sizes"
    radius = 0.5 * 10 ** rng.uniform(-1, 0, COUNT) if wide else rng.uniform(0.35, 0.5, COUNT)
    radius[0] = 0.5
    reach = 2.0 * radius.max() + SKIN
    length = reach * CELLS.get(case, 6.5)
    extent = np.full(dim, length)
    extent[1] = max(1.0, 1.2 * COUNT / length ** (dim - 1))
    if case == "crowded":
        extent[1] *= 0.2
    position = rng.uniform(0, 1, (COUNT, dim)) * extent
    if case == "unwrapped":  # positions are never wrapped: grains may be many lengths away
        position[:, 0] += length * rng.integers(-5, 5, COUNT)
    if case == "negative":
        position[:, 1] -= 1.7 * extent[1]
    if case == "far beyond the grid":
        shift = np.array([0.0, -3.0e3, 7.0e3, 1.0e6])  # the grid wraps round at a few thousand cells
        position[:, 1] += shift[rng.integers(0, 4, COUNT)]
        position[::7, 1] = np.round(position[::7, 1], 1)
    return position, radius, [length] * dim


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("case", [*CELLS, "wide sizes", "unwrapped", "negative", "far beyond the grid"])
def test_list_holds_every_near_pair_once_in_order(finders, dim, case):
    finder = finders[dim]
    for seed in range(3):
        position, radius, lengths = placed(np.random.default_rng(seed), dim, case)
        listed = finder.find(position, radius, lengths)
        expected = brute_force(position, radius, lengths, finder.periodic)
        assert len(expected) > 30
        assert np.array_equal(listed[np.lexsort(listed.T[::-1])], expected)
        starts = finder.pairs.row_start.to_numpy()[: COUNT + 1]
        for a, b in itertools.pairwise(starts):
            assert np.all(np.diff(listed[a:b, 1]) > 0)
        if case == "crowded":  # rows that were not noted whole while they were counted
            assert np.diff(starts).max() > BUFFER


@pytest.mark.parametrize("dim", [2, 3])
def test_transpose_lists_every_entry_at_its_partner_in_rising_ids(finders, dim):
    finder = finders[dim]
    finder.find(*placed(np.random.default_rng(9), dim, "many cells"))
    listed, pairs, grains = finder.listed(), finder.pairs, finder.grains
    starts = pairs.column_start.to_numpy()[: COUNT + 1]
    column = pairs.column.to_numpy()[: len(listed)]
    assert starts[0] == 0 and starts[-1] == len(listed)
    assert np.array_equal(np.sort(column), np.arange(len(listed)))
    partner_slot = np.repeat(np.arange(COUNT), np.diff(starts))
    assert np.array_equal(listed[column, 1], grains.id.to_numpy()[partner_slot])
    assert np.array_equal(pairs.second_slot.to_numpy()[column], partner_slot)
    for a, b in itertools.pairwise(starts):
        assert np.all(np.diff(listed[column[a:b], 0]) > 0)


def remembered(listed):
    """A history, status and feature that tell the pair they belong to."""
    code = listed[:, 0] * 1000.0 + listed[:, 1]
    return np.stack([code, 1.0 / code], axis=1), 1 + listed[:, 1] % 3, np.stack([listed[:, 0], -listed[:, 1]], axis=1)


def remember(pairs, listed):
    for name, values in zip(("history", "status", "feature"), remembered(listed)):
        raw = getattr(pairs, name).to_numpy()
        raw[: len(listed)] = values
        getattr(pairs, name).from_numpy(raw)


def check_memory(pairs, before, after):
    """Pairs listed before and after keep what they held; new ones hold nothing."""
    kept = (after[:, None] == before[None]).all(axis=2).any(axis=1)
    for name, values, empty in zip(("history", "status", "feature"), remembered(after), (0.0, 0, -1)):
        held = getattr(pairs, name).to_numpy()[: len(after)]
        assert np.array_equal(held[kept], values[kept])
        assert np.all(held[~kept] == empty)
    return kept


@pytest.mark.parametrize("dim", [2, 3])
def test_memory_survives_rebuilds_and_resorting(finders, dim, monkeypatch):
    finder, rng = finders[dim], np.random.default_rng(5)
    position, radius, lengths = placed(rng, dim, "many cells")
    before = finder.find(position, radius, lengths)
    monkeypatch.setattr(neighbour_search, "SORT_LEAST", 0)  # else so few grains are not sorted
    orders = set()
    for _ in range(2 * SORT_INTERVAL + 2):
        remember(finder.pairs, before)
        position = position + rng.uniform(-0.1, 0.1, position.shape)
        after = finder.find(position, radius, lengths)
        kept = check_memory(finder.pairs, before, after)
        assert 0.5 < kept.mean() < 1.0
        orders.add(finder.grains.id.to_numpy()[:COUNT].tobytes())
        before = after
    assert len(orders) >= 3  # the grains were re-sorted in between, and not at every rebuild
    assert len(orders) <= 4


def test_growth_of_the_list_keeps_memory(finders):
    finder, rng = finders[2], np.random.default_rng(6)
    position, radius, lengths = placed(rng, 2, "many cells")
    before = finder.find(position, radius, lengths)
    remember(finder.pairs, before)
    small, finder.pairs = finder.pairs, grown(finder.pairs, COUNT * COUNT)
    small_list, finder.list = finder.list, NeighbourList(finder.search, finder.pairs)
    try:
        after = finder.find(position + rng.uniform(-0.1, 0.1, position.shape), radius, lengths)
        assert finder.pairs.capacity > small.capacity
        assert check_memory(finder.pairs, before, after).mean() > 0.5
    finally:
        finder.pairs, finder.list = small, small_list


def test_glued_grains_are_not_listed_and_crushed_platens_are_named(finders):
    finder = finders[2]
    position, radius, lengths = placed(np.random.default_rng(2), 2, "many cells")
    glued = np.where(np.arange(COUNT) % 3 == 0, 0, -1)
    finder.grains.set_column("platen_index", glued)
    try:
        listed = finder.find(position, radius, lengths)
        both = brute_force(position, radius, lengths, finder.periodic)
        expected = both[(glued[both] < 0).any(axis=1)]
        assert 0 < len(expected) < len(both)
        assert np.array_equal(listed[np.lexsort(listed.T[::-1])], expected)
        finder.grains.set_column("platen_index", np.arange(COUNT) % 2)
        with pytest.raises(lsm.SimulationError, match="touches the other platen"):
            finder.find(position, radius, lengths)
    finally:
        finder.grains.set_column("platen_index", -1)


def test_position_that_is_no_number_names_the_grain(finders):
    finder = finders[3]
    position, radius, lengths = placed(np.random.default_rng(2), 3, "many cells")
    position[117, 2] = np.nan
    with pytest.raises(lsm.SimulationError, match="grain 117"):
        finder.find(position, radius, lengths)


def test_morton_code_orders_a_square_in_z():
    cell = np.array([(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, 1), (0, 2)])
    assert morton_code(cell).tolist() == [0, 1, 2, 3, 4, 7, 8]
    assert morton_code(np.array([(1, 1, 1), (0, 0, 2)])).tolist() == [7, 32]


def test_simulation_finds_contacts_when_its_list_overflows(runtime):
    """A loose state fits the first list; brought together the grains need a larger one, and nothing is lost."""
    loose = 3.0 * np.stack(np.divmod(np.arange(64), 8), axis=1)
    sim = scenes.simulate(scenes.scene(loose, [lsm.LinearElastic(1.0)], skin=1.2))
    room = sim.pairs.capacity
    dense = 0.32 * loose
    scenes.reload(sim, position=dense, velocity=np.zeros((64, 2)))
    assert sim.pairs.capacity > room
    apart = np.linalg.norm(dense[:, None] - dense, axis=2)[np.triu_indices(64, 1)]
    touching = apart[apart < 1.0]
    sums = sim.measure.sums()
    assert sums["contact_count"] == len(touching) == 112
    assert sums["elastic_energy"] == pytest.approx(0.5 * np.sum((1.0 - touching) ** 2), rel=1e-12)
    crushed = dense.copy()
    crushed[5] = dense[6]
    with pytest.raises(lsm.SimulationError, match="grains 5 and 6: their overlap reached the limit"):
        scenes.reload(sim, position=crushed, velocity=np.zeros((64, 2)))
    scenes.reload(sim, position=dense, velocity=np.zeros((64, 2)))
    sim.state.position.from_numpy(np.where(np.arange(64)[:, None] == 17, np.nan, dense))
    with pytest.raises(lsm.SimulationError, match="step 0: grain 17: its position is not a number"):
        sim.run(3)
