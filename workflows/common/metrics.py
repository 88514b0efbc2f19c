"""Metrics of a run, as summary.json and as a printed table."""

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from taichi_lsm.statistics import Estimate, Resampled

FILE = "summary.json"
WIDE = 110  # characters of a terminal in which notes have a column of their own
COLUMNS = ("metric", "value", "95 % interval", "unit", "claimed", "", "note")


@dataclass(frozen=True)
class Metric:
    """One number that a run yields, with the bound that is claimed for it.

    Attributes
    ----------
    value
        Value in `unit`; None if it could not be computed.
    unit
        Unit, "1" for a pure number.
    bound, holds
        Given together, and only where a bound is claimed: the bound (a number in `unit`, or words), and whether the
        value respects it.
    interval
        (least, greatest) of the 95 % interval of a mean, in `unit`.
    note
        What the value is where its name does not say it, or why it is unknown.
    remedy
        What it means if the claim does not hold, and what to change.
    """

    value: float | int | None
    unit: str
    bound: float | int | str | None = None
    holds: bool | None = None
    interval: tuple[float, float] | None = None
    note: str | None = None
    remedy: str | None = None

    def __post_init__(self) -> None:
        if (self.bound is None) != (self.holds is None):
            raise ValueError(f"Metric: bound {self.bound!r} and holds {self.holds!r} must be given together")

    def as_dict(self) -> dict:
        """The JSON form; values that JSON has no number for (NaN, infinity) become null."""
        entry: dict[str, Any] = {"value": _number(self.value), "unit": self.unit}
        if self.holds is not None:
            entry |= {"bound": _number(self.bound), "holds": bool(self.holds)}
        if self.interval is not None:
            entry["interval"] = [_number(end) for end in self.interval]
        if self.note:
            entry["note"] = self.note
        if self.holds is not None and not self.holds and self.remedy:
            entry["remedy"] = self.remedy
        return entry


def metrics_of_estimate(mean: str, error: str, estimate: "Estimate | None") -> dict[str, Metric]:
    """The metrics `mean`, with its 95 % interval, and `error`, its standard error, of a pure number.

    Where the error is unknown its note says why; None in place of the estimate makes both unknown.
    """
    if estimate is None:
        return {name: Metric(None, "1", note="no complete run") for name in (mean, error)}
    unknown = math.isnan(estimate.standard_error)
    found = Metric(estimate.mean, "1", interval=None if unknown else estimate.interval)
    note = f"unknown: {estimate.unknown}" if unknown else None
    return {mean: found, error: Metric(estimate.standard_error, "1", note=note)}


def metrics_of_value(name: str, found: "Estimate | Resampled", unit: str, note: str | None = None) -> dict[str, Metric]:
    """The metric `name`, with its 95 % interval, and `name`_se, its standard error, in a unit; note: what it is.

    Where the error is unknown its note says why.
    """
    unknown = math.isnan(found.standard_error)
    why = f"unknown: {found.unknown}" if unknown else None
    return {
        name: Metric(found[0], unit, interval=None if unknown else found.interval, note=note),
        f"{name}_se": Metric(found.standard_error, unit, note=why),
    }


def failed_claims(summary: dict[str, Any]) -> list[str]:
    """One line for each claim of a summary that does not hold: value, claim, what it means and what to change."""
    lines = []
    if summary.get("run_status", "complete") == "interrupted":
        return lines  # nothing can be said of runs that have not ended
    for name, entry in summary["metrics"].items():
        if entry.get("holds") is False:
            unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
            value = shown(entry["value"]) + (unit if entry["value"] is not None else "")
            bound = shown(entry["bound"]) + (unit if not isinstance(entry["bound"], str) else "")
            remedy = entry.get("remedy") or "the run is not as good as the experiment promises"
            lines.append(f"claim not met: {name} is {value}, claimed {bound}: {remedy}.")
    return lines


def read_summary(out: str | os.PathLike[str]) -> dict[str, Any] | None:
    """The summary in the folder `out`; None if there is none that can be read."""
    try:
        summary = json.loads((Path(out) / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return summary if isinstance(summary, dict) and isinstance(summary.get("metrics"), dict) else None


def number(metric: Metric) -> float:
    """The value of a metric; nan if it could not be computed."""
    return math.nan if metric.value is None else float(metric.value)


def _number(value: Any) -> float | int | str | None:
    if hasattr(value, "item"):  # a NumPy or xarray scalar
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_summary(
    out: str | os.PathLike[str],
    workflow: str,
    preset: str | None,
    metrics: dict[str, Metric],
    quiet: bool = False,
    run_status: str = "complete",
) -> dict[str, Any]:
    """Write `out`/summary.json and print its table; returns the summary.

    Parameters
    ----------
    out
        Folder of the run.
    workflow, preset
        Name of the command; `params.preset_name`.
    metrics
        Name -> metric, in the order of the table.
    quiet
        Write only (a workflow passes `progress is None`).
    run_status
        "complete", or how an experiment of many runs ended that tells what it has.
    """
    entries = {name: metric.as_dict() for name, metric in metrics.items()}
    summary = {"workflow": workflow, "preset": preset, "run_status": run_status, "metrics": entries}
    path = Path(out) / FILE
    partial = path.with_name(FILE + ".partial")
    partial.write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    os.replace(partial, path)  # the file is the old or the new one at any time, never half of one
    if not quiet:
        print_summary(summary)
    return summary


def print_summary(summary: dict, console: Console | None = None) -> None:
    """Print the metrics: a rich table in a terminal, else one plain aligned line each."""
    console = console or Console()
    rows = [(name, *_cells(entry)) for name, entry in summary["metrics"].items()]
    title = summary["workflow"] + (f", preset {summary['preset']}" if summary["preset"] else "")
    if console.is_terminal:
        used = [column for column, name in enumerate(COLUMNS) if name == "unit" or any(row[column] for row in rows)]
        narrow = console.width < WIDE
        used = [column for column in used if not (narrow and COLUMNS[column] == "note")]
        table = Table(title=title)
        for column in used:
            table.add_column(COLUMNS[column], overflow="fold", no_wrap=COLUMNS[column] == "metric")
        for row in rows:
            table.add_row(*(row[column] for column in used))
        console.print(table)
        for row in rows:
            if narrow and row[-1]:
                console.print(f"{row[0]}: {row[-1]}", markup=False, highlight=False)
        return
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(len(COLUMNS) - 1)]
    print(title, file=console.file)
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, [*widths, 0], strict=True) if width or cell)
        print("  ".join(cells).rstrip(), file=console.file, flush=True)


def _cells(entry: dict) -> tuple[str, ...]:
    """Value, interval, unit, claim, verdict and note of a metric, "" where it has none."""
    interval = entry.get("interval")
    between = f"{shown(interval[0])} to {shown(interval[1])}" if interval else ""
    claimed = "" if "holds" not in entry else shown(entry["bound"])
    verdict = "" if "holds" not in entry else "holds" if entry["holds"] else "FAILS"
    unit = "" if entry["unit"] == "1" else entry["unit"]
    return shown(entry["value"]), between, unit, claimed, verdict, entry.get("note", "")


def shown(value: float | int | str | None, form: str = ".4g") -> str:
    """A value as tables and titles show it, a float in this form; "unknown" for None and for what is not a number."""
    if value is None or value != value:
        return "unknown"
    return format(value, form) if isinstance(value, float) else str(value)
