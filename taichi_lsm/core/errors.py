"""The errors that a caller is expected to catch: `InputError` before a run, `SimulationError` during one."""

import math
import reprlib
from collections.abc import Iterable, Mapping
from os import PathLike
from typing import Any


class SimulationError(RuntimeError):
    """A run could not be completed: it diverged, overflowed a table or lost a grain.

    Parameters
    ----------
    message
        What happened, in which step, and what to do about it.
    step
        Number of the step in which the run stopped, None if it is not known.
    grains
        Persistent ids of the grains at which it happened.
    values
        Numbers that the message quotes, by name.

    Attributes
    ----------
    saved : sequence of paths
        Files that hold the state at the stop, see `Simulation.keep_checkpoints`; empty if none was written.
    """

    def __init__(
        self,
        message: str,
        step: int | None = None,
        grains: Iterable[int] = (),
        values: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(message)
        self.step = step
        self.grains = tuple(int(k) for k in grains)
        self.values = dict(values or {})
        self.saved: tuple[str | PathLike[str], ...] = ()


class InputError(ValueError):
    """What the user gave is wrong, contradicts itself or cannot be read; nothing was computed.

    The message names the field or file, quotes the value, and says what is allowed and what to do.
    """


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 120
_SHORT.maxtuple = _SHORT.maxlist = _SHORT.maxdict = 8


def shown(value: object) -> str:
    """`repr` of a value that anyone may have given, shortened for a message of one line."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return f"a value of type {type(value).__name__}"


def reason(error: BaseException) -> str:
    """What an error of another library says, on one line and not without end."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 300 else f"{text[:300]}..."


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
        raise InputError(f"{type(owner).__name__}.{field} = {shown(value)}: must be {allowed}")


def finite(value: Any) -> bool:
    """Whether `value` is one finite number; False for text, None, bool, arrays, and integers beyond all floats too."""
    try:
        return math.isfinite(value) and not isinstance(value, bool)
    except (TypeError, OverflowError):
        return False


def step_count(steps: Any) -> int:
    """Number of steps that a run is asked for, as an int; InputError unless it is a whole number >= 0."""
    if isinstance(steps, bool) or not (finite(steps) and steps >= 0 and int(steps) == steps):
        raise InputError(f"Simulation.run: steps = {steps!r}, must be a whole number >= 0")
    return int(steps)
