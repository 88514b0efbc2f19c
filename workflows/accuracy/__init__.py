"""Knobs that trade accuracy for time. Each module of this package measures some of them, error and cost.

A module defines `KNOBS` {name: title} and `measure(params, report=None)` -> list of Trials, to be called in a process
of its own, beside which nothing else runs: its costs are processor times. Errors are taken against a reference that
the same call computes with the most accurate setting, or against a closed form.
"""

import time
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Trial:
    """One measurement of one setting.

    knob, setting: names; value: number of the setting on an axis, e.g. steps per contact; quantity: what the error is
    of, e.g. "energy drift"; replica: which of several measurements; error [in the unit of the quantity]: absolute
    deviation from the reference; reference: what it is taken from; cost [s]: processor time for one grain and one unit
    of the time scale of the module, which cancels in `relative`; relative [1]: cost over that of our own discs or
    spheres at the default settings, timed in turn with it.
    """

    knob: str
    setting: str
    value: float
    quantity: str
    replica: int
    error: float
    reference: float
    cost: float
    relative: float


class Clock:
    """Processor seconds of blocks."""

    def __init__(self):
        self.seconds = 0.0

    @contextmanager
    def running(self):
        """Add the processor time of the block, all threads together."""
        began = time.process_time()
        try:
            yield
        finally:
            self.seconds += time.process_time() - began
