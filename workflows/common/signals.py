"""SIGTERM, SIGINT and SIGHUP as one exception, so that a workflow can flush its files before it ends."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

# A terminal signals a whole process group and a parent passes the signal on as well: the same request
# arrives twice within milliseconds, and must not interrupt the flush that the first one started.
SAME_REQUEST_S = 2.0

# SIGHUP, of a terminal that is closed, does not exist on Windows.
HANDLED = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGINT", "SIGHUP") if hasattr(signal, name))


def obeyed() -> list[int]:
    """Those that the process does not ignore, as it does SIGHUP below nohup."""
    return [int(signum) for signum in HANDLED if signal.getsignal(signum) is not signal.SIG_IGN]


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
    """Raise Interrupted on the signals HANDLED from now on; returns the previous handlers for `restore`.

    Only the main thread may call it (a rule of Python).
    """
    last = -SAME_REQUEST_S

    def handle(signum, frame):
        nonlocal last
        now = time.monotonic()
        if now - last >= SAME_REQUEST_S:
            last = now
            raise Interrupted(signum)

    return {signum: signal.signal(signum, handle) for signum in obeyed()}


@contextmanager
def blocked(signums: Collection[int] = HANDLED) -> Iterator[None]:
    """Let these signals wait until the end of the block.

    A thread that starts in the block never gets them: they wake the main thread. A process that starts in the block
    gets them once it says so, as by `unblock`.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows has no signal masks
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signums)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock() -> None:
    """Get the signals HANDLED, also if the thread that started this process left them to another one."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, HANDLED)


def restore(previous: dict) -> None:
    """Undo `install`."""
    for signum, handler in previous.items():
        signal.signal(signum, handler)


@dataclass
class Pending:
    """A signal that waits.

    Attributes
    ----------
    signum
        Its number, None before one came.
    previous
        The handlers that it waits for.
    """

    signum: int | None = None
    previous: dict[int, Any] = field(default_factory=dict)

    def deliver(self) -> None:
        """Hand the signal to the handler that it was held back from: in `lsm` that raises Interrupted."""
        restore(self.previous)
        signum, self.signum = self.signum, None
        if signum is not None:
            signal.raise_signal(signum)


@contextmanager
def held() -> Iterator[Pending]:
    """Hold these signals back inside, so that a run can end where its state is whole: it asks `Pending.signum`.

    A second signal, not of the same request, is delivered at once; one that still waits at the end, there. Outside the
    main thread signals cannot be held back.
    """
    pending, first = Pending(), 0.0

    def note(signum, frame):
        nonlocal first
        now = time.monotonic()
        if pending.signum is None:
            pending.signum, first = int(signum), now
        elif now - first >= SAME_REQUEST_S:
            pending.deliver()

    if threading.current_thread() is threading.main_thread():
        pending.previous = {signum: signal.signal(signum, note) for signum in obeyed()}
    try:
        yield pending
    finally:
        restore(pending.previous)
    pending.deliver()
