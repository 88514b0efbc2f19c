"""The errors that a caller is expected to catch."""

import math
from typing import Any


class SimulationError(RuntimeError):
    """A run could not be completed: it diverged, overflowed a table or lost a grain.

    step: number of the step it stopped in, None if not known; grains: persistent ids of the grains at fault;
    values: {name: number} that the message quotes; saved: files that hold the state, see `Simulation.keep_checkpoints`.
    """

    def __init__(self, message, step=None, grains=(), values=None):
        super().__init__(message)
        self.step, self.grains, self.values = step, tuple(int(k) for k in grains), dict(values or {})
        self.saved = ()


class InputError(ValueError):
    """The description of a run is wrong or contradicts itself; nothing was computed."""


def require(condition: object, owner: object, field: str, value: object, allowed: str) -> None:
    """Raise InputError unless the value of a field is allowed.

    Parameters
    ----------
    condition
        True if the value is allowed.
    owner
        Effect or drive that the value was given to; the message names its class.
    field
        Name of the field.
    value
        What was given.
    allowed
        What the field must be, for example "> 0 Pa".
    """
    if not condition:
        raise InputError(f"{type(owner).__name__}.{field} = {value!r}: must be {allowed}")


def finite(value: Any) -> bool:
    """Whether `value` is one finite number; False for text, None and arrays too."""
    try:
        return math.isfinite(value)
    except TypeError:
        return False
