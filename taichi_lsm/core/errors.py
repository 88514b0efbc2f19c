"""The errors that a caller is expected to catch."""


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
