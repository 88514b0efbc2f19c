"""Faults that kernels report: they cannot raise, so the first launch after one stops the run."""

from ..errors import SimulationError
from ..runtime import ti

PAIR_BASE = 2**31
TEXTS = {
    1: "their overlap reached the cap at which the contact is no longer unique; use stiffer grains or less stress",
}


@ti.data_oriented
class Faults:
    """The worst fault of a launch and the persistent ids of its two grains."""

    def __init__(self):
        self.code = ti.field(ti.i32, ())
        self.pair = ti.field(ti.i64, ())  # first id * PAIR_BASE + second

    @ti.func
    def report(self, code: ti.template(), first, second):
        """Of several pairs the one with the highest ids is kept, whatever thread comes first."""
        ti.atomic_max(self.code[None], code)
        ti.atomic_max(self.pair[None], (ti.cast(first, ti.i64) << 31) + second)

    def clear(self):
        """Forget what was reported."""
        self.code[None] = 0
        self.pair[None] = 0

    def raise_any(self, step):
        """Raise SimulationError with the step, the grains and the cause, if there was a fault."""
        code = self.code[None]
        if code:
            k, l = divmod(int(self.pair[None]), PAIR_BASE)
            raise SimulationError(f"step {step}, grains {k} and {l}: {TEXTS[code]}")
