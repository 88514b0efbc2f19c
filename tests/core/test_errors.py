"""Values that a caller gives, checked before anything is computed."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import step_count


@pytest.mark.parametrize("steps", [10.5, -5, "10", None, np.nan, np.inf, [1]])
def test_steps_of_a_run_are_whole_numbers(steps):
    with pytest.raises(lsm.InputError, match=r"^Simulation.run: steps = .*, must be a whole number >= 0$"):
        step_count(steps)


@pytest.mark.parametrize("steps", [0, 7, np.int64(7), 7.0])
def test_whole_numbers_of_every_type_are_steps(steps):
    assert step_count(steps) == steps and type(step_count(steps)) is int
