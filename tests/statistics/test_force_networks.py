"""Force chains: columns of grains that carry a load, forks, bends and ends."""

import numpy as np
import pytest

from taichi_lsm import InputError, force_chains
from tests.helpers.contact_tables import grains_of, moment_of


def loaded(place, pairs, forces):
    """(grains, contacts) of discs that press on each other along the lines between their centres."""
    place, pairs = np.asarray(place, float), np.asarray(pairs)
    branch = place[pairs[:, 1]] - place[pairs[:, 0]]
    normal = branch / np.linalg.norm(branch, axis=1)[:, None]
    point = place[pairs[:, 0]] + 0.5 * branch
    return moment_of(pairs[:, 0], pairs[:, 1], point, branch, normal, forces, np.zeros_like(branch))


def column(count=6, glued=()):
    """A column of grains under a load of 10 N, and beside it one under 1 N."""
    place = [[x, y] for x in (0.0, 3.0) for y in range(count)]
    pairs = [(i, i + 1) for i in range(count - 1)] + [(count + i, count + i + 1) for i in range(count - 1)]
    forces = [10.0] * (count - 1) + [1.0] * (count - 1)
    return grains_of(place, 1.0, glued=glued), loaded(place, pairs, forces)


def test_the_column_that_carries_the_load_is_a_chain():
    grains, contacts = column()
    found = force_chains(grains, contacts=contacts)
    assert found.chain.values.tolist() == [0] * 6 + [-1] * 6 and found.chain_size.values.tolist() == [6]
    assert np.abs(found.direction.values[:6, 1]) == pytest.approx(1.0)
    assert found.contact_chain.values.tolist() == [0] * 5 + [-1] * 5
    major = found.major_stress.values
    assert major[1] == pytest.approx(2.0 * major[0]) and float(found.mean_stress) == pytest.approx(major.mean())


def test_platens_end_chains_and_do_not_belong_to_them():
    grains, contacts = column(glued=(0, 5, 6, 11))
    found = force_chains(grains, contacts=contacts)
    assert found.chain.values.tolist() == [-1, 0, 0, 0, 0, -1] + [-1] * 6
    assert np.isnan(found.major_stress.values[[0, 5]]).all() and np.isfinite(found.mean_stress)
    assert force_chains(grains, contacts=contacts, least=5).chain_size.size == 0


def bent(angle):
    """A column of three and three more grains that leave it by an angle."""
    step = np.array([np.sin(angle), np.cos(angle)])
    place = [np.array([0.0, y]) for y in (-2.0, -1.0, 0.0)] + [n * step for n in (1.0, 2.0, 3.0)]
    place += [np.array([9.0, y]) for y in range(6)]
    pairs = [(i, i + 1) for i in range(5)] + [(6 + i, 7 + i) for i in range(5)]
    return grains_of(place, 1.0), loaded(place, pairs, [10.0] * 5 + [1.0] * 5)


@pytest.mark.parametrize(("bend", "sizes"), [(0.6, [6]), (1.9, [3, 3])])
def test_a_chain_bends_by_a_right_angle_at_most(bend, sizes):
    """At the bend the direction of the stress is halfway between the two parts, or across where it turns back."""
    grains, contacts = bent(bend)
    found = force_chains(grains, contacts=contacts)
    assert found.chain_size.values.tolist() == sizes and (found.chain.values[6:] == -1).all()
    assert force_chains(grains, contacts=contacts, angle=0.1).chain.values[2] == -1


def test_of_a_fork_the_straighter_arm_goes_on():
    place = [[0.0, -2.0], [0.0, -1.0], [0.0, 0.0], [0.2, 0.98], [0.4, 1.96], [-0.6, 0.8], [-1.2, 1.6]]
    place += [[9.0, float(y)] for y in range(9)]
    pairs = [(0, 1), (1, 2), (2, 3), (3, 4), (2, 5), (5, 6)] + [(7 + i, 8 + i) for i in range(8)]
    forces = [10.0] * 4 + [9.0] * 2 + [0.5] * 8
    found = force_chains(grains_of(place, 1.0), contacts=loaded(place, pairs, forces))
    assert found.chain.values[:7].tolist() == [0, 0, 0, 0, 0, -1, -1]


def test_the_order_of_ids_does_not_matter():
    grains, contacts = bent(0.6)
    order = np.random.default_rng(1).permutation(12)  # new id of each grain
    place = np.empty((12, 2))
    place[order] = grains.position.values[0]
    pairs = np.sort(order[np.stack([contacts.first_id.values, contacts.second_id.values], axis=1)], axis=1)
    found = force_chains(grains_of(place, 1.0), contacts=loaded(place, pairs, contacts.normal_force.values))
    same = force_chains(grains, contacts=contacts)
    assert (found.chain.values[order] >= 0).tolist() == (same.chain.values >= 0).tolist()
    assert found.chain_size.values.tolist() == same.chain_size.values.tolist() == [6]


def test_wrong_angles_and_numbers_are_refused():
    grains, contacts = column()
    for given, message in (
        ({"angle": 2.0}, "angle = 2.0: must be > 0"),
        ({"least": 1}, "least = 1: must be an integer"),
    ):
        with pytest.raises(InputError, match=message):
            force_chains(grains, contacts=contacts, **given)
    empty = force_chains(grains, contacts=contacts.isel(contact=slice(0)))
    assert (empty.chain.values == -1).all() and empty.chain_size.size == 0
