"""The errors that a caller is expected to catch: `InputError` before a run, `SimulationError` during one."""

from collections.abc import Iterable, Mapping
from os import PathLike


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
