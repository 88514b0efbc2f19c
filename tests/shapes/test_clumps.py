"""Clumps of discs and spheres: mass of the union, and error of the outline."""

import numpy as np
import pytest

import taichi_lsm as lsm


@pytest.fixture(scope="module")
def angular():
    return lsm.shapes.random_angular_shapes(1, 3)[0]


def test_clumps_have_the_mass_of_their_union():
    two = lsm.shapes.clump([(0, 0), (1, 0)], [1.0, 1.0], normalise=False)
    assert two.measure == pytest.approx(2 * np.pi - (2 * np.pi / 3 - np.sqrt(3) / 2), rel=1e-12)
    pair = lsm.shapes.clump([(0, 0, 0), (1, 0, 0)], [1.0, 1.0], normalise=False)
    assert pair.measure == pytest.approx(8 / 3 * np.pi - 5 * np.pi / 12, rel=2e-3)
    assert len(two.parts) == 2 and two.part_bounds()[1] == pytest.approx([1.0, 1.0])


@pytest.mark.validate  # shape-roughness has a cheaper relative
def test_discs_need_many_more_elements_than_arcs_for_the_same_outline(angular):
    errors = [lsm.shapes.outline_error(angular, lsm.shapes.equal_clump(angular, n)) for n in (30, 60)]
    assert 0.02 < errors[0] < 0.06 and 0.3 < errors[1] / errors[0] < 0.7
