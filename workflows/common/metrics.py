"""Metrics of a run, as summary.json and as a printed table."""

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

FILE = "summary.json"


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
    """

    value: float | int | None
    unit: str
    bound: float | int | str | None = None
    holds: bool | None = None

    def __post_init__(self) -> None:
        if (self.bound is None) != (self.holds is None):
            raise ValueError(f"Metric: bound {self.bound!r} and holds {self.holds!r} must be given together")

    def as_dict(self) -> dict:
        """The JSON form; values that JSON has no number for (NaN, infinity) become null."""
        entry = {"value": _number(self.value), "unit": self.unit}
        if self.holds is not None:
            entry |= {"bound": _number(self.bound), "holds": bool(self.holds)}
        return entry


def number(metric: Metric) -> float:
    """The value of a metric; nan if it could not be computed."""
    return math.nan if metric.value is None else float(metric.value)


def _number(value: Any) -> float | int | str | None:
    if hasattr(value, "item"):  # a NumPy or xarray scalar
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_summary(
    out: str | os.PathLike[str], workflow: str, preset: str | None, metrics: dict[str, Metric], quiet: bool = False
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
    """
    entries = {name: metric.as_dict() for name, metric in metrics.items()}
    summary = {"workflow": workflow, "preset": preset, "metrics": entries}
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
        table = Table("metric", "value", "unit", "claimed", "", title=title)
        for row in rows:
            table.add_row(*row)
        console.print(table)
        return
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(4)]
    print(title, file=console.file)
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, [*widths, 0], strict=True))
        print("  ".join(cells).rstrip(), file=console.file, flush=True)


def _cells(entry: dict) -> tuple[str, str, str, str]:
    claimed = "" if "holds" not in entry else _shown(entry["bound"])
    verdict = "" if "holds" not in entry else "holds" if entry["holds"] else "FAILS"
    return _shown(entry["value"]), "" if entry["unit"] == "1" else entry["unit"], claimed, verdict


def _shown(value: float | int | str | None) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
