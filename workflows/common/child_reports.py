"""Reports from child processes, shown by the process that waits for them.

A process appends its reports to a file, one JSON object a line, and a thread of the waiting process reads them from
there: a file needs no connection that could outlive either side.
"""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workflows.common import signals
from workflows.common.reports import Progress, as_dict

READ_EVERY_S = 0.2


@dataclass(frozen=True)
class ReportFile:
    """Takes the reports of one part of an experiment, in any process.

    Attributes
    ----------
    path
        The file; "" drops the reports.
    label
        Of the part, added to each report.
    """

    path: str
    label: str = ""

    def __call__(self, report: Any) -> None:
        """Append a report, a mapping or a dataclass; numbers of NumPy become plain ones."""
        if self.path:
            line = json.dumps(as_dict(report) | {"label": self.label}, default=float) + "\n"
            with suppress(OSError), open(self.path, "a", encoding="utf-8") as file:  # a report is worth no run
                file.write(line)  # at once: lines of two processes do not mix


SILENT = ReportFile("")


class ChildReports:
    """Shows the reports of child processes, and those of this one, in the order in which they are made."""

    def __init__(self, path: Path | None, progress: Progress | None) -> None:
        self._path, self._progress = path, progress
        self._read = 0  # bytes
        self._last: dict[str, dict[str, Any]] = {}  # by label
        self._showing = threading.Lock()

    def of(self, label: str) -> ReportFile:
        """What a part of this label is given to report to."""
        return ReportFile("" if self._path is None else str(self._path), label)

    def show(self, report: dict[str, Any]) -> None:
        """Show a report of this process after all that its children have made."""
        with self._showing:
            self._show_new()
            if self._progress:
                self._progress(report)

    def show_end(self, label: str, state: str) -> None:
        """Show the last report of a part again, with the state in which it has ended."""
        self.show_new()
        self.show(self._last.get(label, {"label": label}) | {"state": state})

    def show_new(self) -> None:
        """Show what the children have reported since the last time."""
        with self._showing:
            self._show_new()

    def _show_new(self) -> None:
        if self._path is None or not self._progress:
            return
        for line in self._lines():
            if line.endswith(b"\n"):  # else it is still being written
                self._read += len(line)
                try:
                    report = json.loads(line)
                except ValueError:  # a full disk has cut it
                    continue
                self._last[report.get("label", "")] = report
                self._progress(report)

    def _lines(self) -> list[bytes]:
        """What is new in the file; nothing if somebody has removed it."""
        with suppress(OSError), open(self._path or "", "rb") as file:
            file.seek(self._read)
            return file.read().splitlines(keepends=True)
        return []


@contextmanager
def child_reports(progress: Progress | None) -> Iterator[ChildReports]:
    """Shows what child processes report while the block waits for them; None as progress is silent."""
    if progress is None:
        yield ChildReports(None, None)
        return
    with tempfile.TemporaryDirectory(prefix="lsm-") as folder:
        path = Path(folder) / "reports"
        path.touch()
        reports, ended = ChildReports(path, progress), threading.Event()
        thread = threading.Thread(target=_keep_showing, args=(reports, ended), name="lsm reports", daemon=True)
        try:
            with signals.blocked():  # the thread leaves them to the main one
                thread.start()
            yield reports
        finally:
            ended.set()
            if thread.is_alive():
                thread.join()


def _keep_showing(reports: ChildReports, ended: threading.Event) -> None:
    while not ended.wait(READ_EVERY_S):
        try:
            reports.show_new()
        except OSError:  # nobody reads: the next report of this process meets the same error
            return
