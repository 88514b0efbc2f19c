"""Hard cases of solid grains, in their quick form."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers.scenes import PRECISION
from workflows.hard import cases_of, error_of_impact
from workflows.hard.solids import impact

CASES = {case.name: case for case in cases_of("solids")}


@pytest.mark.parametrize("name", CASES)
def test_a_hard_case_respects_its_bound(bench, name):
    assert CASES[name].run(bench) <= CASES[name].bound_in(PRECISION)


def test_features_that_do_not_join_cost_energy(bench):
    """Faces moved by a hundredth of the size: the measure sees it."""
    rng, shapes = np.random.default_rng(1), lsm.random_angular_polyhedra(4, 1)
    turns = rng.normal(size=(3, 2, 4))
    turns /= np.linalg.norm(turns, axis=2)[..., None]

    def errors():
        angular_velocity = np.full((2, 3), 20.0)
        return [
            error_of_impact(bench, impact(shapes, q, offset=(0.2, 0.1), angular_velocity=angular_velocity), 200_000)
            for q in turns
        ]

    smooth = max(errors())
    for shape in shapes:
        centre = shape.feature_centre.copy()
        centre[: shape.face_count] *= 1.01
        object.__setattr__(shape, "feature_centre", centre)
    assert max(errors()) > max(1e-3, 10.0 * smooth)
