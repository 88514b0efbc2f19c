"""Hard cases of grains of arcs, in their quick form."""

import pytest

import taichi_lsm as lsm
from tests.helpers.scenes import PRECISION
from workflows.hard import cases_of, error_of_impact
from workflows.hard.outlines import impact

CASES = {case.name: case for case in cases_of("outlines")}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    assert CASES[name].run(bench) <= CASES[name].bound_in(PRECISION)


def test_a_seam_that_jumps_costs_energy(bench):
    """Patches that do not join: the measure sees it."""
    scene = impact(lsm.random_angular_shapes(2, 1), (0.3, 2.0), height=0.7, angular_velocity=(15.0, 12.0))
    smooth = error_of_impact(bench, scene)
    for shape in scene.shapes:
        centre = shape.parts[0].centre.copy()
        centre[::2] *= 1.01
        object.__setattr__(shape.parts[0], "centre", centre)
    assert error_of_impact(bench, scene) > max(1e-3, 10.0 * smooth)
