"""Faults that kernels report: they cannot raise, so the first launch after one stops the run."""

from ..errors import SimulationError
from ..runtime import ti

PAIR_BASE = 2**30
TEXTS = {
    1: "grains {} and {}: their overlap reached the cap at which the contact is no longer unique; "
    "use stiffer grains or less stress",
    2: "grain {}: its centre went beyond wall number {}; use stiffer grains or a smaller step",
}


@ti.data_oriented
class Faults:
    """The worst fault of a launch and the persistent ids of its two grains, or of its grain and wall."""

    def __init__(self):
        self.code = ti.field(ti.i32, ())
        self.pair = ti.field(ti.i64, ())  # (code * PAIR_BASE + first id) * PAIR_BASE + second

    @ti.func
    def report(self, code: ti.template(), first, second):
        """Of several pairs the one with the highest ids is kept, whatever thread comes first."""
        ti.atomic_max(self.code[None], code)
        ti.atomic_max(self.pair[None], (((ti.cast(code, ti.i64) << 30) + first) << 30) + second)

    def clear(self):
        """Forget what was reported."""
        self.code[None] = 0
        self.pair[None] = 0

    def raise_any(self, step):
        """Raise SimulationError with the step, the grains and the cause, if there was a fault."""
        if self.code[None]:
            first, l = divmod(int(self.pair[None]), PAIR_BASE)
            code, k = divmod(first, PAIR_BASE)
            raise SimulationError(f"step {step}, {TEXTS[code].format(k, l)}")
