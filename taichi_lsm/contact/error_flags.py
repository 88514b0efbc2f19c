"""Errors that kernels report: a kernel cannot raise, so the run stops after the step in which one was reported."""

from typing import Any

from ..core.allocation import write
from ..core.runtime import ti

PAIR_BASE = 2**30  # more than any id
OVERLAP, WALL = 1, 2  # codes


@ti.data_oriented
class ErrorFlags:
    """The worst error of a launch and the persistent ids of its two grains, or of its grain and wall.

    Notes
    -----
    Of all errors reported the one with the highest code and ids is kept: an atomic maximum, so that the message does
    not depend on the order of the threads. What no guard asks for is not reported, and stops no launch.
    """

    def __init__(self) -> None:
        self.wanted = ti.field(ti.i32, 3)  # by code
        self.code = ti.field(ti.i32, ())
        self.pair = ti.field(ti.i64, ())  # (code * PAIR_BASE + first id) * PAIR_BASE + second

    def want(self, guards: Any) -> None:
        """Choose what is reported, by the `Guards` of a scene."""
        write(self.wanted, [0, int(guards.overlap is not None), int(guards.wall is not None)])

    @ti.func
    def report(self, code: ti.template(), first_id, second_id):
        """Report an error of the pair, if a guard wants it; kept if code and ids are the highest so far."""
        if self.wanted[code] == 1:
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
