"""Time that a run took: on the clock, and of the processors."""

import os
import time

from workflows.common.metrics import Metric


class Stopwatch:
    """Wall-clock and processor time since it was made, and before that: of a run that goes on."""

    def __init__(self) -> None:
        self._clock, self._processor = time.perf_counter(), _processor_seconds()

    def add(self, seconds: float, cpu_seconds: float) -> None:
        """Count also the wall-clock and processor time [s] that another process took for the same run."""
        self._clock -= seconds
        self._processor -= cpu_seconds

    @property
    def seconds(self) -> float:
        """Wall-clock time [s]: what a user waits, with compiling, and with waiting for a busy processor."""
        return time.perf_counter() - self._clock

    @property
    def cpu_seconds(self) -> float:
        """Processor time [s] of this process, all threads, and of those that it started and that have ended.

        Two runs of 10 s side by side take 20 s of it; where it is much less than the wall-clock time of one run, other
        programs had the processor. Windows does not count the processes that were started.
        """
        return _processor_seconds() - self._processor

    def metrics(self, resumed: bool = False) -> dict[str, Metric]:
        """Both times, as they stand in summary.json; resumed: what was spent before the run went on is not in them."""
        since = "; since it was resumed" if resumed else ""
        return {
            "seconds": Metric(self.seconds, "s", note=f"wall-clock time of the run, with compiling{since}"),
            "cpu_seconds": Metric(
                self.cpu_seconds, "s", note=f"processor time, all threads and processes together{since}"
            ),
        }


def _processor_seconds() -> float:
    """User and system time of this process and of its ended children [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
