"""SIGTERM and SIGINT as one exception, so that a workflow can flush its files before it ends."""

from __future__ import annotations

import signal
import time

# A terminal signals a whole process group and a parent passes the signal on as well: the same request
# arrives twice within milliseconds, and must not interrupt the flush that the first one started.
SAME_REQUEST_S = 2.0

HANDLED = (signal.SIGTERM, signal.SIGINT)


class Interrupted(BaseException):
    """The process was asked to end by signal `signum`; its exit code is 128 + signum.

    Not an Exception, so that `except Exception` in a workflow does not swallow it.
    """

    def __init__(self, signum: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(signum).name}")
        self.signum = int(signum)

    def __reduce__(self):
        return Interrupted, (self.signum,)


def install() -> dict:
    """Raise Interrupted on SIGTERM and SIGINT from now on; returns the previous handlers for `restore`.

    Only the main thread may call it (a rule of Python).
    """
    last = -SAME_REQUEST_S

    def handle(signum, frame):
        nonlocal last
        now = time.monotonic()
        if now - last >= SAME_REQUEST_S:
            last = now
            raise Interrupted(signum)

    return {signum: signal.signal(signum, handle) for signum in HANDLED}


def restore(previous: dict) -> None:
    """Undo `install`."""
    for signum, handler in previous.items():
        signal.signal(signum, handler)
