"""Hard cases of the laws of contact, in their quick form."""

import pytest

import taichi_lsm as lsm
from tests.helpers.scenes import PRECISION
from workflows.hard import Bench, cases_of

CASES = {case.name: case for case in cases_of("effects")}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    case = CASES[name]
    if PRECISION == "f32" and case.excepted:
        pytest.skip(case.excepted)
    assert case.run(bench) <= case.bound_in(PRECISION)


class Careless(Bench):
    """Runs the scenes with another integrator."""

    def __init__(self, precision, integrator):
        super().__init__(precision)
        self.integrator = integrator

    def simulate(self, scene):
        scene.integrator = self.integrator
        return super().simulate(scene)


@pytest.mark.parametrize(
    "name, integrator",
    [
        ("friction_of_ten", lsm.ExplicitEuler),
        ("elastic_impacts", lsm.VelocityVerlet),  # which makes an error wherever a contact begins
    ],
)
def test_a_lesser_integrator_exceeds_the_bound(runtime, name, integrator):
    case = CASES[name]
    assert case.run(Careless(PRECISION, integrator)) > 1.5 * case.bound
