"""The progress of a run on one line: updated in a terminal, printed from time to time elsewhere.

Where a run makes no report for some seconds, as while kernels compile, the line tells for how long.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from workflows.common import signals
from workflows.common.reports import as_dict

LIVE_EVERY_S = 0.2
PLAIN_EVERY_S = 10.0
WAIT_S = 5.0  # without a report, before a line says for how long
LONG_WAIT_S = 30.0  # from which on such lines come as seldom in plain output
ENDED = ("done", "failed")  # states of a run that has ended


class ProgressLine:
    """Shows progress reports; call it with a dict or dataclass, and `close` it at the end.

    Notes
    -----
    A report has any of: stage (text), done and total (counts of what the stage makes), height and height_goal [m],
    strain [1], strain_total [1], friction [1], normal_stress [Pa], energy_residual [1], steps_per_second_grain [grain
    steps per second], eta [s], and, for one of several runs, label and state (texts) and whether it has `ended`. A
    report with a state, or of another stage than the last one, is always shown. Missing and NaN values are left out of
    the line. Any thread may call it.
    """

    def __init__(self, quiet: bool = False, console: Console | None = None, every: float | None = None) -> None:
        self._console = console or Console()
        self._quiet = quiet
        self._terminal = self._console.is_terminal
        self._every = every if every is not None else LIVE_EVERY_S if self._terminal else PLAIN_EVERY_S
        self._reports: dict[str, dict] = {}
        self._shown_at: dict[str, float] = {}
        self._stage: dict[str, str | None] = {}  # of each label, as last shown
        self._live: Live | None = None
        self._changing = threading.RLock()
        self._last: dict | None = None  # report of what is being done
        self._reported_at = self._printed_at = time.monotonic()
        self._closed = threading.Event()
        self._waiting: threading.Thread | None = None

    def __call__(self, report: Any) -> None:
        """Show a report, or drop it if one of the same label was shown less than the interval ago."""
        if self._quiet:
            return
        with self._changing:
            self._show(as_dict(report))
            if self._waiting is None:
                self._waiting = threading.Thread(target=self._tell_waits, name="lsm progress", daemon=True)
                with signals.blocked():  # the thread leaves them to the main one
                    self._waiting.start()

    def _show(self, report: dict) -> None:
        label = report.get("label", "")
        self._reports[label] = report
        self._last = report if not _has_ended(report) else _running(self._reports)
        now = self._reported_at = time.monotonic()
        begins = "stage" in report and report["stage"] != self._stage.get(label)
        if not ("state" in report or begins) and now - self._shown_at.get(label, -math.inf) < self._every:
            return
        self._shown_at[label], self._stage[label] = now, report.get("stage")
        self._printed_at = now
        if not self._terminal:
            print(format_line(report), file=self._console.file, flush=True)
            return
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False)
            self._live.start()
        self._draw()

    def _draw(self, *more: str) -> None:
        # Text, so that rich reads no markup in the labels.
        assert self._live is not None
        lines = [*map(format_line, self._reports.values()), *more]
        self._live.update(Group(*map(Text, lines)), refresh=True)

    def _tell_waits(self) -> None:
        """Until the end: where no report comes, say what is being done and for how long."""
        while not self._closed.wait(0.2 * WAIT_S):
            with self._changing:
                try:
                    self._tell_wait()
                except OSError:  # nobody reads: the next report meets the same error, where it can end the run
                    return

    def _tell_wait(self) -> None:
        now = time.monotonic()
        silent = now - self._reported_at
        every = WAIT_S if silent < LONG_WAIT_S or self._terminal else LONG_WAIT_S
        if silent < WAIT_S or self._closed.is_set() or (not self._terminal and now - self._printed_at < every):
            return
        self._printed_at = now
        text = waiting_line(self._last, silent)
        if self._live is not None:
            self._draw(text)
        elif not self._terminal:
            print(text, file=self._console.file, flush=True)

    def close(self) -> None:
        """Draw the last reports and end the live display."""
        self._closed.set()
        with self._changing:
            if self._live is not None:
                self._draw()
                self._live.stop()
                self._live = None

    def __enter__(self):
        return self

    def __exit__(self, *exc_info):
        self.close()


def _has_ended(report: dict) -> bool:
    return bool(report.get("ended")) or report.get("state") in ENDED


def _running(reports: Mapping[str, dict]) -> dict | None:
    """The report of a run that has not ended, of the one that began last; None if all have."""
    return next((report for report in reversed(list(reports.values())) if not _has_ended(report)), None)


def waiting_line(report: dict | None, silent: float) -> str:
    """What is being done, by the last report of it, and the time [s] without another one: `compiling | for 10 s`."""
    doing = {} if report is None else {key: report[key] for key in ("label", "stage", "done", "total") if key in report}
    if report is not None and "stage" not in report and "state" in report:
        doing["state"] = report["state"]
    return f"{format_line(doing) or 'still at work'} | for {silent:.0f} s"


def format_line(report: dict) -> str:
    """`strain 1.24/4.00 | mu 0.31 | sigma_n 5.00 MPa | ...` from the values that the report has."""
    value = {k: v for k, v in report.items() if not _missing(v)}
    parts = []
    if "stage" in value:
        count = f" {value['done']}/{value['total']}" if "total" in value else ""
        parts.append(f"{value['stage']}{count}")
    if "height" in value:
        parts.append(f"height {heights(value['height'], value.get('height_goal'))}")
    if "strain" in value:
        total = f"/{value['strain_total']:.2f}" if "strain_total" in value else ""
        parts.append(f"strain {value['strain']:.2f}{total}")
    if "share" in value:
        parts.append(f"{100 * value['share']:.0f} %")
    if "friction" in value:
        parts.append(f"mu {value['friction']:.2f}")
    if "normal_stress" in value:
        parts.append(f"sigma_n {scaled(value['normal_stress'], ('Pa', 'kPa', 'MPa', 'GPa'))}")
    if "energy_residual" in value:
        parts.append(f"energy residual {100 * value['energy_residual']:.1f} %")
    if "steps_per_second_grain" in value:
        parts.append(f"{value['steps_per_second_grain']:.1e} grain steps/s".replace("e+0", "e").replace("e+", "e"))
    if "eta" in value:
        parts.append(f"ETA {clock(value['eta'])}")
    if "state" in value:
        parts.insert(0, str(value["state"]))
    line = " | ".join(parts)
    return f"{value['label']}: {line}" if "label" in value else line


def _missing(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))


def heights(height: float, goal: float | None) -> str:
    """`1.80 of 1.30 mm`: both in the unit that suits the goal; `1.80 mm` without one."""
    size = height if goal is None else goal
    power = min(3, max(0, math.ceil(-math.log10(size) / 3.0))) if 0.0 < size < 1.0 else 0
    of_goal = "" if goal is None else f" of {goal * 1000**power:.3g}"
    return f"{height * 1000**power:.3g}{of_goal} {('m', 'mm', 'um', 'nm')[power]}"


def scaled(value: float, units: tuple[str, ...]) -> str:
    """A value with the unit prefix that brings it below 1000: 5e6 -> "5.00 MPa"."""
    power = 0
    while abs(value) >= 1000 and power < len(units) - 1:
        value, power = value / 1000, power + 1
    return f"{value:.2f} {units[power]}"


def clock(seconds: float) -> str:
    """mm:ss, or h:mm:ss from an hour on."""
    if not math.isfinite(seconds):
        return "--:--"
    minutes, second = divmod(round(max(seconds, 0)), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute:02d}:{second:02d}"
