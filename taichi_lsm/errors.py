"""The errors that a caller is expected to catch."""


class SimulationError(RuntimeError):
    """A run could not be completed: it diverged, overflowed a table or lost a grain."""


class InputError(ValueError):
    """The description of a run is wrong or contradicts itself; nothing was computed."""
