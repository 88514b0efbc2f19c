"""Scenes drawn at random: energy never grows and no number is lost."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.scenes import PRECISION
from workflows.hard import Bench
from workflows.hard.packings import any_angular, any_discs, growth

MAKERS = {"discs": any_discs, "angular": any_angular}
BOUND = 5e-3  # the ripple of Verlet inside contacts


@pytest.fixture(scope="module")
def bench(runtime):
    return Bench(PRECISION)


@pytest.mark.parametrize("kind", MAKERS)
def test_energy_never_grows(bench, kind):
    @settings(max_examples=12, deadline=None, derandomize=True, database=None)
    @given(st.integers(0, 2**32 - 1))
    def of_seed(seed):
        assert growth(bench.simulate(MAKERS[kind](seed)), 4000) <= BOUND

    of_seed()
