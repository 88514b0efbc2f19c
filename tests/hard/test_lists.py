"""Hard cases of places and lists, in their quick form."""

import pytest

from tests.helpers.scenes import PRECISION
from workflows.hard import cases_of

CASES = {case.name: case for case in cases_of("lists")}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    if PRECISION == "f32" and CASES[name].excepted:
        pytest.skip(CASES[name].excepted)
    assert CASES[name].run(bench) <= CASES[name].bound_in(PRECISION)
