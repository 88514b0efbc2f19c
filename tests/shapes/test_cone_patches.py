"""Grains of general patches: mass, and how well the cones tile."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError


@pytest.fixture(scope="module")
def angular():
    return lsm.shapes.random_angular_shapes(1, 3)[0]


def test_patches_of_a_chain_tile_and_have_its_mass(angular):
    shape = lsm.shapes.GrainShape.from_patches(*angular.patches())
    assert sum(shape.coverage()) < 1e-12
    assert shape.measure == pytest.approx(angular.measure, rel=1e-12)
    assert shape.inertia == pytest.approx(angular.inertia, rel=1e-12)
    assert shape.centre == pytest.approx(angular.centre, abs=1e-12)
    assert shape.bounding_radius == pytest.approx(angular.bounding_radius, rel=1e-12)


def test_coverage_counts_missed_and_doubly_covered_angles(angular):
    patches = angular.patch_count
    assert lsm.shapes.from_chain(angular, 1e-3).coverage().uncovered == pytest.approx(
        patches * 2e-3 / (2 * np.pi), rel=1e-9
    )
    assert lsm.shapes.from_chain(angular, -1e-3).coverage().doubly_covered == pytest.approx(
        patches * 2e-3 / (2 * np.pi), rel=1e-9
    )
    n = np.concatenate([np.eye(3), -np.eye(3)])
    cube = lsm.shapes.GrainShape.from_patches(
        0 * n, np.full(6, 0.5), n, np.full(6, np.pi / 4), measure=1.0, inertia=[1, 1, 1]
    )
    covered = 6 * (1 - np.cos(np.pi / 4)) / 2  # the six cones touch and leave the corners out
    assert cube.coverage().uncovered == pytest.approx(1 - covered, abs=1e-3)
    with pytest.raises(InputError, match="measure, inertia: must be given"):
        lsm.shapes.GrainShape.from_patches(0 * n, np.full(6, 0.5), n, np.full(6, np.pi / 4))
