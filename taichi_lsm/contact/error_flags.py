"""Faults that kernels report: they cannot raise, so the launch ends after the step of a fault and the run stops."""

from ..core.runtime import ti

PAIR_BASE = 2**30
OVERLAP, WALL = 1, 2  # codes


@ti.data_oriented
class ErrorFlags:
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

    def taken(self):
        """(code, first id, second id) of what was reported, which is then forgotten; None if nothing was."""
        if not self.code[None]:
            return None
        first, l = divmod(int(self.pair[None]), PAIR_BASE)
        code, k = divmod(first, PAIR_BASE)
        self.clear()
        return code, k, l
