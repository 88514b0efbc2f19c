"""Metrics of summary.json with their standard errors and claims."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from workflows.common.metrics import FILE, failed_claims, read_summary, shown
from workflows.common.run_contents import MALFORMED
from workflows.report.parts import Section, Table, without_empty_columns

HEAD = ("metric", "value", "standard error", "95 % interval", "unit", "claimed", "holds", "note")
ERROR = "_se"  # at the end of the name of a standard error


def metrics(folder: Path) -> Section:
    """All metrics of a run; a standard error stands beside its mean."""
    section, summary = Section("metrics", "Metrics"), read_summary(folder)
    if summary is None:
        why = "cannot be read" if (folder / FILE).exists() else "is not there yet: a run writes it last"
        section.texts.append(f"{FILE} {why}.")
        return section
    try:
        section.tables.append(_table(summary["metrics"]))
        section.texts.extend(claims(summary))
    except MALFORMED:
        section.texts.append(f"{FILE} holds something else than metrics.")
    return section


def _table(entries: dict[str, Any]) -> Table:
    """All metrics but those that are the standard error of another one, which has them."""
    rows, failing = [], set()
    for name, entry in entries.items():
        if _mean_of(name, entries) is not None:
            continue
        if entry.get("holds") is False:
            failing.add(len(rows))
        rows.append(_row(name, entry, _error_of(name, entries)))
    return without_empty_columns(Table("Metrics of the run", HEAD, rows, frozenset(failing), frozenset({6, 7})))


def claims_not_met(folder: Path) -> list[str]:
    """The metrics of a run whose claim does not hold."""
    entries = (read_summary(folder) or {"metrics": {}})["metrics"]
    return [name for name, entry in entries.items() if isinstance(entry, dict) and entry.get("holds") is False]


def claims(summary: dict[str, Any]) -> list[str]:
    """How many of the claims hold, and those that do not, with what to change."""
    verdicts = [entry["holds"] for entry in summary["metrics"].values() if "holds" in entry]
    if not verdicts:
        return []
    text = f"{sum(map(bool, verdicts))} of {len(verdicts)} claimed bounds hold."
    return [text, *(line[0].upper() + line[1:] for line in failed_claims(summary))]


def _error_names(name: str) -> tuple[str, str]:
    """Names that the standard error of a metric may have: of friction_mean friction_se."""
    return f"{name}{ERROR}", f"{name.removesuffix('_mean')}{ERROR}"


def _error_of(name: str, entries: dict[str, Any]) -> dict[str, Any] | None:
    """The standard error of a metric, if there is one."""
    return next((entries[error] for error in _error_names(name) if error in entries), None)


def _mean_of(name: str, entries: dict[str, Any]) -> str | None:
    """The metric of which one is the standard error."""
    if not name.endswith(ERROR):
        return None
    return next((mean for mean in entries if mean != name and name in _error_names(mean)), None)


def _row(name: str, entry: dict[str, Any], error: dict[str, Any] | None) -> tuple[str, ...]:
    interval, unit = entry.get("interval"), entry["unit"]
    claimed = "holds" in entry
    notes = [entry.get("note", ""), (error or {}).get("note", "")]
    return (
        name,
        shown(entry["value"]),
        "" if error is None else shown(error["value"]),
        f"{shown(interval[0])} to {shown(interval[1])}" if interval else "",
        "" if unit == "1" else unit,
        shown(entry["bound"]) if claimed else "",
        ("yes" if entry["holds"] else "no") if claimed else "",
        "; ".join(dict.fromkeys(filter(None, notes))),
    )
