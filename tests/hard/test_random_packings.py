"""In scenes drawn at random the energy never grows."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workflows.hard.packings import any_angular, any_discs, growth

MAKERS = {"discs": any_discs, "angular": any_angular}
BOUND = 5e-3  # the ripple of Verlet inside contacts


@pytest.mark.validate
@pytest.mark.parametrize("kind", ["discs", "angular"])
def test_energy_never_grows_in_any_scene(bench, kind):
    @settings(max_examples=12, derandomize=True, database=None)
    @given(st.integers(0, 2**32 - 1))
    def of_seed(seed):
        assert growth(bench.simulate(MAKERS[kind](seed)), 4000) <= BOUND

    of_seed()
