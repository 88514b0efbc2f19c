"""`lsm sweep`: carries out the runs that a file asks for, and puts what they gave into one table."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError, SimulationError
from workflows.cli.execution import complain
from workflows.cli.exit_codes import COMPLETE, FAILED
from workflows.common import signals
from workflows.common.metrics import Metric, write_summary
from workflows.common.parallel_runs import reason_of
from workflows.common.run_folder import check_folder
from workflows.common.stopwatch import Stopwatch
from workflows.common.toml_writer import to_toml
from workflows.sweep.drive import config_of, counts, drive, folder_of
from workflows.sweep.one_run import COMPLETED, Limits, Outcome
from workflows.sweep.plan import PlannedRun, SweepPlan, plan_of
from workflows.sweep.table import write_sweep

COPY = "sweep.toml"  # the file of the sweep, in its folder: the same file goes on there


def sweep(
    found: Mapping[str, ModuleType],
    file: Path,
    out: Path,
    scheduler: str | None,
    jobs: int,
    retries: int,
    limits: Limits,
    quiet: bool,
) -> int:
    """Carry out a sweep, or the rest of one that was stopped; returns the exit code.

    Parameters
    ----------
    found
        Module of each experiment by its name.
    file, out
        What runs are wanted, see `plan_of`; the folder of the sweep.
    scheduler, jobs, retries, limits
        See `drive`.
    quiet
        Print errors only.
    """
    watch = Stopwatch()
    try:
        plan = plan_of(file, found)
        text = file.read_text(encoding="utf-8")
        _require_folder(out, text)
    except InputError as error:
        return complain([str(error)])
    out.mkdir(parents=True, exist_ok=True)
    ended: dict[str, Outcome] = {}

    def announce(what: str) -> None:
        if not quiet:
            print(f"sweep: {what}", flush=True)

    def report(run: PlannedRun, status: str, outcome: Outcome) -> None:
        ended[run.label] = outcome
        varied = ", ".join(f"{name} {value}" for name, value in run.point.items())
        why = f": {outcome.note.splitlines()[0]}" if outcome.note else ""
        announce(f"{len(ended)}/{len(plan.runs)} run {run.label} ({varied}) {status}, {outcome.seconds:.0f} s{why}")

    try:
        with lsm.locked(out):
            (out / COPY).write_text(text, encoding="utf-8")
            _write_configs(plan, out)
            announce(f"{len(plan.runs)} runs of {plan.experiment}, in {out}")
            status = "interrupted"
            try:
                ended |= drive(plan, out, scheduler, jobs, retries, limits, report, announce)
                status = "complete"
            finally:
                table = write_sweep(plan, out, ended, text, status)
                number = counts(ended)
                metrics = {name: Metric(count, "1") for name, count in {"runs": len(plan.runs), **number}.items()}
                write_summary(out, "sweep", None, metrics | watch.metrics(), quiet=quiet, run_status=status)
    except InputError as error:
        return complain([str(error)])
    except (SimulationError, OSError) as error:
        complain([reason_of(error)])
        return FAILED
    except signals.Interrupted:
        complain([f"complete runs are kept; to go on: the same command, lsm sweep {file} --out {out}"])
        raise
    ends = sorted(ended.items())
    complain([f"run {label} {end.status}: {end.note}" for label, end in ends if end.status != COMPLETED])
    return COMPLETE if bool((table.status == COMPLETED).any()) else FAILED


def _require_folder(out: Path, text: str) -> None:
    """Refuse a folder that holds anything but this sweep."""
    copy = out / COPY
    if not copy.is_file():
        check_folder(out, "refuse", "--out", "it holds this sweep")
    elif copy.read_text(encoding="utf-8") != text:
        raise InputError(f"--out {out}: holds another sweep, whose file is {copy}; choose another folder")
    else:
        check_folder(out, "resume", "--out")


def _write_configs(plan: SweepPlan, out: Path) -> None:
    """A file of parameters for each run, with which it can be made alone."""
    (out / "points").mkdir(exist_ok=True)
    (out / "runs").mkdir(exist_ok=True)
    for run in plan.runs:
        if run.params is not None:
            path = config_of(out, run)
            new = path.with_suffix(".part")
            new.write_text(to_toml(run.params, plan.experiment), encoding="utf-8")
            os.replace(new, path)
            folder_of(out, run).mkdir(exist_ok=True)
