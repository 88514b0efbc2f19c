"""Hard cases of drives, in their quick form."""

import pytest

import taichi_lsm as lsm
from tests.helpers.scenes import PRECISION
from workflows.hard import cases_of, driven

CASES = {case.name: case for case in cases_of("driven")}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    case = CASES[name]
    if PRECISION == "f32" and case.excepted:
        pytest.skip(case.excepted)
    assert case.run(bench) <= case.bound_in(PRECISION)


def test_a_layer_that_is_sheared_exceeds_the_bounds_of_one_at_rest(bench):
    sim = driven.at_rest(bench)
    before = driven.height(sim)
    sim.platens.set("bottom", 0, lsm.ConstantVelocity(1e-3))
    sim.run(10_000)
    assert abs(driven.height(sim) - before) > 10 * CASES["creep_of_the_thickness"].bound_in(PRECISION)
    assert driven.height(driven.at_rest(bench)) == before


def test_a_broken_chain_without_its_book_exceeds_the_bound_of_the_energy(bench):
    sim = bench.simulate(driven.chain())
    begin = lsm.energies(sim).balance
    sim.run(1000)
    now = lsm.energies(sim)
    assert abs((now.balance - now.dissipated) / begin - 1.0) > 10 * CASES["chain_that_snaps"].bound
