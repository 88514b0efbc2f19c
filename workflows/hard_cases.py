"""Cases that break codes like this one, each with a measure and the bound that it must respect, in f64 and in f32.

The cases are defined in `workflows/hard`, a file for each kind. Every file runs in a process of its own for each
precision, two at a time. A case that fails makes the command fail; cases that single precision cannot fulfil are
excepted, with the reason.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

import taichi_lsm as lsm
from workflows.common.child_reports import SILENT, child_reports
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import Params as BaseParams
from workflows.common.parameters import nearest
from workflows.common.reports import Progress
from workflows.common.run_cost import PROCESS_BYTES, RunCost, of_replicas
from workflows.common.run_folder import Existing
from workflows.common.run_table import Rows, write_runs
from workflows.hard import Bench, cases_of, modules
from workflows.plots.hard_cases import plot_cases
from workflows.protocol.finished_parts import FinishedParts, folder_of_parts

if TYPE_CHECKING:
    import xarray

# Steps and time of a case [s], the mean over all of them, with compiling; and the start of a process [s].
OF_CASE = {"full": (6e5, 8.0), "short": (1.5e4, 1.9)}
PROCESS = 2.0
STATUS = ("passed", "failed", "excepted")
TEXTS = {
    "case": "name of the case",
    "kind": "file of workflows/hard that defines the case",
    "title": "what the case is",
    "why": "what makes it hard",
    "precision": "floating-point type of contacts and forces",
    "measure": "what the value is",
    "unit": "unit of value and bound",
    "reason": "why the case is not claimed in this precision, or how it failed; else empty",
}


class Params(BaseParams):
    """Selection of the cases, and length of their runs."""

    # No options: cases have their own random numbers, and run on one thread of the CPU.
    seed: ClassVar[int] = 1  # pyright: ignore[reportIncompatibleVariableOverride]  as said above
    arch: ClassVar[str] = "cpu"  # pyright: ignore[reportIncompatibleVariableOverride]  likewise
    threads: ClassVar[int] = 1  # pyright: ignore[reportIncompatibleVariableOverride]  likewise

    precision: Literal["both", "f64", "f32"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]  one more
        default="both", description="floating-point types to run the cases in"
    )
    runs: Literal["full", "short"] = Field(default="full", description="full runs, or the same cases with fewer steps")
    kinds: list[str] = Field(default=[], description="kinds of cases, the files of workflows/hard; empty: all of them")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {"runs": "short", "kinds": ["steps"]},
        "demo": {"runs": "short"},
        "standard": {},
        "reference": {},
    }


def check(params: Params) -> None:
    """Refuse unknown kinds with InputError."""
    unknown = sorted(set(params.kinds) - set(modules()))
    if unknown:
        raise lsm.InputError(
            f"--kinds {','.join(unknown)}: must be some of {', '.join(modules())}.{nearest(unknown[0], modules())}"
        )


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of all cases, two processes at a time."""
    steps, seconds = OF_CASE[params.runs]
    cases = [len(cases_of(kind)) for kind in params.kinds or modules() for _ in precisions_of(params)]
    return of_replicas([RunCost(steps * n, PROCESS + seconds * n, PROCESS_BYTES) for n in cases], 2)


def precisions_of(params: Params) -> tuple[str, ...]:
    """Floating-point types in which the cases run."""
    return ("f64", "f32") if params.precision == "both" else (params.precision,)


def run_kind(kind: str, precision: str, short: bool, report: Progress = SILENT) -> Rows:
    """Rows, one dict per case, of all cases of a file; to be called in a process of its own.

    `report` takes a report at the beginning of each case.
    """
    bench, rows, cases = Bench(precision, short), [], cases_of(kind)
    for number, case in enumerate(cases, start=1):
        report({"stage": case.title, "done": number, "total": len(cases)})
        began, reason = time.perf_counter(), case.excepted if precision == "f32" else ""
        try:
            value = float(case.run(bench))
        except (lsm.SimulationError, lsm.InputError) as error:
            value, reason = math.inf, reason or str(error)
        if math.isnan(value):
            value, reason = math.inf, reason or "the measure is not a number"
        bound = case.bound_in(precision)
        status = "passed" if value <= bound else "failed"
        if precision == "f32" and case.excepted:
            status = "excepted"
        row = {"case": case.name, "kind": kind, "title": case.title, "why": case.why}
        row |= {"precision": precision, "measure": case.measure}
        row |= {"unit": case.unit, "value": value, "bound": bound, "margin": margin(value, bound)}
        row |= {"status": STATUS.index(status), "reason": reason, "seconds": time.perf_counter() - began}
        rows.append(row)
    return rows


def margin(value: float, bound: float) -> float:
    """Bound over value [1]; infinite for a value of 0, 0 for an infinite value."""
    return math.inf if value == 0.0 else bound / value


def measure(params: Params, parts: FinishedParts, progress: Progress | None = None) -> Rows:
    """Rows of all cases in all precisions, by file, two processes at a time."""
    kinds, rows = params.kinds or modules(), []
    jobs = [(kind, precision) for kind in reversed(kinds) for precision in precisions_of(params)]
    with child_reports(progress) as reports:
        calls = {}
        for kind, precision in jobs:
            label = f"{kind} {precision}"
            calls[label] = (run_kind, kind, precision, params.runs == "short", reports.of(label))
        reports.show({"stage": f"starting {len(calls)} processes, two at a time"})
        with parts.made_in_processes(calls) as made:
            for label, own in made:
                rows += own
                failed = sum(row["status"] == STATUS.index("failed") for row in own)
                reports.show({"label": label, "state": f"{len(own)} cases, {failed} failed", "ended": True})
    order = {kind: i for i, kind in enumerate(kinds)}
    return sorted(rows, key=lambda row: order[row["kind"]])  # stable: cases stay in the order of the text


def analyse(rows: Rows) -> dict[str, Metric]:
    """Metrics of the rows; cases are counted once, whatever the number of precisions."""
    names = dict.fromkeys(row["case"] for row in rows)
    states = {name: {STATUS[row["status"]] for row in rows if row["case"] == name} for name in names}
    failed = sum("failed" in s for s in states.values())
    return {
        "cases": Metric(len(names), "1"),
        "passed": Metric(sum("failed" not in s for s in states.values()), "1"),
        "failed": Metric(failed, "1", 0, failed == 0, remedy="hard_cases.md says which cases failed and by how much"),
        "excepted": Metric(sum("excepted" in s for s in states.values()), "1"),
        "least_margin": _least_margin([row for row in rows if STATUS[row["status"]] != "excepted"]),
    }


def _least_margin(judged: Rows) -> Metric:
    """The least bound over value, of the case that comes nearest to its bound."""
    tightest = min(judged, key=lambda row: row["margin"])
    note = f"bound over value of the tightest case: {tightest['title']} ({tightest['precision']})"
    return Metric(tightest["margin"], "1", note=note)


def table_text(rows: Rows) -> str:
    """Markdown: for each file of cases a table of why each is hard, its measure, and value and margin by precision."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own = [row for row in rows if row["kind"] == kind]
        precisions = list(dict.fromkeys(row["precision"] for row in own))
        head = ["case", "measure", "bound", *(f"{p}, times it fits into the bound" for p in precisions)]
        lines += [f"### {kind.capitalize()}", "", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
        for name in dict.fromkeys(row["case"] for row in own):
            of_case = {row["precision"]: row for row in own if row["case"] == name}
            first = next(iter(of_case.values()))
            bounds = list(dict.fromkeys(f"{row['bound']:g}" for row in of_case.values()))
            unit = "" if first["unit"] == "1" else f" {first['unit']}"
            cells = [f"**{first['title']}.** {first['why']}", first["measure"], ", f32: ".join(bounds) + unit]
            lines.append("| " + " | ".join(cells + [_outcome(of_case.get(p)) for p in precisions]) + " |")
        lines.append("")
    return "\n".join(lines)


def plain_lines(rows: Rows) -> Iterator[str]:
    """A header, and one line for a case in one precision: title, value, bound, verdict, and what is measured."""
    widest = max(len(row["title"]) for row in rows)
    yield f"{'case':{widest}}  in   {'value':>9}    {'bound':9} {'verdict':8}  measured [unit]"
    for row in rows:
        numbers = f"{row['value']:9.3g} <= {row['bound']:<9.3g} {STATUS[row['status']]:8}"
        reason = f": {row['reason']}" if row["reason"] else ""
        yield f"{row['title']:{widest}}  {row['precision']}  {numbers}  {row['measure']} [{row['unit']}]{reason}"


def _outcome(row):
    """Value, margin and verdict of a row, in words; "-" for no row."""
    if row is None:
        return "-"
    value = "exact" if row["value"] == 0.0 else f"{row['value']:.2g}, {row['margin']:.2g} times"
    verdict = {"passed": "", "failed": "; **failed**", "excepted": "; excepted"}[STATUS[row["status"]]]
    return value + verdict + (f": {row['reason']}" if row["reason"] else "")


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Run the cases; writes hard_cases.nc, hard_cases.md, hard_cases.png and summary.json, returns hard_cases.nc.

    Raises SimulationError, when all is written, if a case failed.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed, or goes on.
    Raises InputError for a folder or a run in it that does not suit.
    """
    check(params)
    with folder_of_parts(params, "hard-cases", out, existing) as (folder, parts):
        return _run(params, folder, parts, progress)


def _run(params: Params, out: Path, parts: FinishedParts, progress: Progress | None) -> xarray.Dataset:
    """The experiment in its folder."""
    rows = measure(params, parts, progress)
    numbers = [
        lsm.Variable("value", ("run",), "f64", "1", "measured value, in the unit of the case"),
        lsm.Variable("bound", ("run",), "f64", "1", "greatest value allowed, in the unit of the case"),
        lsm.Variable("margin", ("run",), "f64", "1", "bound over value, infinite for a value of 0"),
        lsm.Variable("status", ("run",), "i32", "1", "whether the value respects the bound"),
        lsm.Variable("seconds", ("run",), "f64", "s", "wall-clock time of the case, with compiling"),
    ]
    flags = {"status": {"flag_values": list(range(len(STATUS))), "flag_meanings": " ".join(STATUS)}}
    title, summary = "Hard cases", "Cases that break codes of their kind, each with a measure and its bound."
    options = {"parameters": ("case", "precision"), "text": TEXTS, "extra_attributes": flags}
    table = write_runs(out / "hard_cases.nc", rows, numbers, params, title, summary, **options)
    (out / "hard_cases.md").write_text(table_text(rows), encoding="utf-8")
    plot_cases(out / f"hard_cases.{params.format}", rows)
    metrics = analyse(rows)
    metrics |= parts.watch.metrics()
    if progress:
        print("\n".join(plain_lines(rows)))
    failed = [f"{row['title']} ({row['precision']})" for row in rows if STATUS[row["status"]] == "failed"]
    status = "failed" if failed else "complete"
    write_summary(out, "hard-cases", params.preset_name, metrics, quiet=progress is None, run_status=status)
    if failed:
        raise lsm.SimulationError(f"{len(failed)} hard cases failed: {'; '.join(failed)}")
    parts.clear()
    return table
