"""Errors that kernels report: a kernel cannot raise, so the run stops after the step in which one was reported."""

from ..core.runtime import ti

PAIR_BASE = 2**30  # more than any id
OVERLAP, WALL = 1, 2  # codes


@ti.data_oriented
class ErrorFlags:
    """The worst error of a launch and the persistent ids of its two grains, or of its grain and wall.

    Notes
    -----
    Of all errors reported the one with the highest code and ids is kept: an atomic maximum, so that the message does
    not depend on the order of the threads.
    """

    def __init__(self) -> None:
        self.code = ti.field(ti.i32, ())
        self.pair = ti.field(ti.i64, ())  # (code * PAIR_BASE + first id) * PAIR_BASE + second

    @ti.func
    def report(self, code: ti.template(), first_id, second_id):
        """Report an error of the pair; kept if code and ids are the highest so far."""
        ti.atomic_max(self.code[None], code)
        ti.atomic_max(self.pair[None], (((ti.cast(code, ti.i64) << 30) + first_id) << 30) + second_id)

    def clear(self) -> None:
        """Forget what was reported."""
        self.code[None] = 0
        self.pair[None] = 0

    def pop(self) -> tuple[int, int, int] | None:
        """Return (code, first id, second id) of what was reported and clear it; None if nothing was."""
        if not self.code[None]:
            return None
        rest, second_id = divmod(int(self.pair[None]), PAIR_BASE)
        code, first_id = divmod(rest, PAIR_BASE)
        self.clear()
        return code, first_id, second_id
