"""Values that a caller gives, checked before anything is computed."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import finite, reason, shown, step_count


@pytest.mark.parametrize("steps", [10.5, -5, True, "10", None, np.nan, np.inf, [1]])
def test_steps_of_a_run_are_whole_numbers(steps):
    with pytest.raises(lsm.InputError, match=r"^Simulation.run: steps = .*, must be a whole number >= 0$"):
        step_count(steps)


@pytest.mark.parametrize("steps", [0, 7, np.int64(7), 7.0])
def test_whole_numbers_of_every_type_are_steps(steps):
    assert step_count(steps) == steps and type(step_count(steps)) is int


def test_an_integer_beyond_all_floats_is_not_finite():
    assert not finite(10**400)
    with pytest.raises(lsm.InputError, match=r"^gravity.acceleration = .*: must be"):
        lsm.effects.make_effects([{"name": "gravity", "acceleration": [0, 10**5000]}])


def test_messages_shorten_values():
    assert shown("x" * 9999).count("x") < 130 and shown(10**5000) == "a value of type int"
    assert reason(OSError("two\nlines")) == "two lines" and len(reason(OSError("x" * 9999))) < 310
    with pytest.raises(lsm.InputError, match=r"^effects: 101 tables, must be at most 100$"):
        lsm.effects.make_effects([{"name": "gravity"}] * 101)
