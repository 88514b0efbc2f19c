"""Calls of functions in fresh processes: Taichi is started once per process, and what it took ends with it.

Whole runs, which have a folder and parameters, are carried out by `workflows.common.one_run` instead.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import ParamSpec, TypeVar

from taichi_lsm.core.errors import SimulationError
from workflows.common import signals

END_EVERY_S = 0.2

P = ParamSpec("P")
T = TypeVar("T")


class _FreshProcesses(ProcessPoolExecutor):
    """A pool whose processes leave Ctrl-C, which a terminal sends to all of them, to this one."""

    def submit(self, fn, /, *arguments, **options):
        # A process that starts here inherits what is blocked, and so does the thread that starts those after it.
        with signals.blocked({signal.SIGINT}):
            return super().submit(fn, *arguments, **options)


@contextmanager
def fresh_processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of `count` processes with a fresh one for every call: Taichi is started once per process.

    Raises
    ------
    SimulationError
        If a process was killed.
    """
    spawn = multiprocessing.get_context("spawn")  # Taichi hangs in a fork
    _start_silent_tracker()
    try:
        with _FreshProcesses(count, mp_context=spawn, initializer=_end_with_parent, max_tasks_per_child=1) as pool:
            try:
                yield pool
            except (signals.Interrupted, OSError):  # what runs is given up, or the pool would wait for all of it
                # Its thread and semaphores end here: a further signal while Python exits would leave them behind.
                with _ending_children():
                    pool.shutdown(wait=True, cancel_futures=True)
                raise
    except BrokenProcessPool as error:
        raise SimulationError("a process of the run was killed, perhaps for want of memory") from error


@contextmanager
def _ending_children() -> Iterator[None]:
    """Ask all child processes to end, again and again during the block.

    The thread of a pool may just be starting one, which waits for work under a lock that an ended one has left locked.
    """
    done = threading.Event()

    def end() -> None:
        while not done.is_set():
            for child in multiprocessing.active_children():
                child.terminate()
            done.wait(END_EVERY_S)

    with signals.blocked():  # the thread leaves them to the main one
        thread = threading.Thread(target=end, daemon=True)
        thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _start_silent_tracker() -> None:
    """Start the process of Python that removes the semaphores of a pool if this one is killed; it shall not warn."""
    sys.warnoptions.append("ignore:resource_tracker")  # options that it is started with
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove("ignore:resource_tracker")


def in_fresh_process(function: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
    """What a function returns in a process of its own, beside which this one only waits."""
    with fresh_processes(1) as pool:
        return pool.submit(function, *arguments, **options).result()


def _end_with_parent() -> None:
    """Make this process end, as if asked by SIGTERM, once the one that started it is gone, be it killed."""
    parent = multiprocessing.parent_process()

    def wait_for_it() -> None:
        if parent is not None:
            parent.join()
            os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait_for_it, daemon=True).start()
