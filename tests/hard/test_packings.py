"""Hard cases of packings, in their quick form; and scenes drawn at random, in which energy never grows."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.helpers.scenes import PRECISION
from workflows.hard import cases_of
from workflows.hard.packings import any_angular, any_discs, growth

MAKERS = {"discs": any_discs, "angular": any_angular}
BOUND = 5e-3  # the ripple of Verlet inside contacts
CASES = {case.name: case for case in cases_of("packings")}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    if PRECISION == "f32" and CASES[name].excepted:
        pytest.skip(CASES[name].excepted)
    assert CASES[name].run(bench) <= CASES[name].bound_in(PRECISION)


@pytest.mark.parametrize("kind", MAKERS)
def test_energy_never_grows_in_any_scene(bench, kind):
    @settings(max_examples=12, deadline=None, derandomize=True, database=None)
    @given(st.integers(0, 2**32 - 1))
    def of_seed(seed):
        assert growth(bench.simulate(MAKERS[kind](seed)), 4000) <= BOUND

    of_seed()
