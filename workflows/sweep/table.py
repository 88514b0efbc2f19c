"""sweep.nc: one row for each run of a sweep, with what varied as coordinates and every metric as a variable."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import taichi_lsm as lsm
from workflows.common.metrics import read_summary
from workflows.common.one_run import COMPLETED, Outcome
from workflows.common.parameter_coordinates import RENAMED, columns_of, parameter_coordinates
from workflows.sweep.drive import folder_of
from workflows.sweep.plan import PlannedRun, SweepPlan

if TYPE_CHECKING:
    import xarray

FILE = "sweep.nc"
TEXTS = {
    "label": "number of the run, and name of its folder",
    "status": "how the run ended: complete, failed, refused or waiting",
    "note": "why there is no result",
    "path": "folder of the run, relative to this file",
}
WAITING = Outcome("waiting", "", math.nan)


def write_sweep(plan: SweepPlan, out: Path, ended: Mapping[str, Outcome], text: str, run_status: str) -> xarray.Dataset:
    """Write `out`/sweep.nc and return it.

    Parameters
    ----------
    plan, ended
        The runs, and how those ended that have.
    text
        The file of the sweep, which becomes the attribute config_toml.
    run_status
        "complete", "failed" or "interrupted".
    """
    known = next(run.params for run in plan.runs if run.params is not None)
    taken = {scalar.name for scalar in parameter_coordinates(known)} | set(TEXTS)
    summaries = {run.label: _metrics(run, out, ended, taken) for run in plan.runs}
    units = {name: entry["unit"] for metrics in summaries.values() for name, entry in metrics.items()}
    scalars = {run.label: {s.name: s for s in parameter_coordinates(run.params or known)} for run in plan.runs}
    shared = list(scalars[plan.runs[0].label].values())
    rows = []
    for run in plan.runs:
        end = ended.get(run.label, WAITING)
        row: dict[str, Any] = {"label": run.label, "status": end.status, "note": end.note, "path": f"runs/{run.label}"}
        row |= {name: _value(run, scalar) for name, scalar in scalars[run.label].items()}
        row |= {name: _number(summaries[run.label].get(name, {}).get("value")) for name in units}
        rows.append(row)
    numbers, texts = columns_of(shared)
    metrics = [lsm.Variable(name, ("run",), "f64", unit, name.replace("_", " ")) for name, unit in units.items()]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    title = f"Sweep of {len(rows)} runs of {plan.experiment}"
    summary = f"Varied: {', '.join(plan.varied) or 'nothing'}. One row per run, nan where it gave no result."
    attributes = lsm.file_attributes(title, summary, text, None, None, known.arch, known.precision)
    factors = [
        {
            "dim": RENAMED.get(f.dim, f.dim),
            "names": [RENAMED.get(name, name) for name in f.points[0]],
            "size": len(f.points),
            "log": [RENAMED.get(name, name) for name in f.log],
        }
        for f in plan.factors
    ]
    attributes |= {"experiment": plan.experiment, "factors": json.dumps(factors)}
    lsm.write_table(
        out / FILE,
        columns,
        [*numbers, *metrics],
        attributes,
        parameters=("label", *(scalar.name for scalar in shared)),
        text=TEXTS | texts,
        run_status=run_status,
    )
    return lsm.open_run(out / FILE)


def _metrics(run: PlannedRun, out: Path, ended: Mapping[str, Outcome], taken: set[str]) -> dict[str, dict[str, Any]]:
    """The metrics of a complete run, {} of any other; one called like a parameter is `measured_` in the file."""
    if ended.get(run.label, WAITING).status != COMPLETED:
        return {}
    found = (read_summary(folder_of(out, run)) or {}).get("metrics", {})
    names = {name: re.sub(r"\W", "_", name) for name in found}
    return {f"measured_{names[name]}" if names[name] in taken else names[name]: entry for name, entry in found.items()}


def _value(run: PlannedRun, scalar: Any) -> Any:
    """The value of a parameter; of a run that was refused what the file asks for, where it varies."""
    asked = {RENAMED.get(name, name): value for name, value in run.point.items()}.get(scalar.name)
    if run.params is not None or asked is None:
        return scalar.value
    return asked if isinstance(asked, type(scalar.value)) else scalar.value


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
