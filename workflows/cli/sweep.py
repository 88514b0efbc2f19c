"""`lsm sweep`: carries out the runs that a file asks for, and puts what they gave into one table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Annotated, Literal

from cyclopts import Parameter

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.cli.execution import complain, exit_code_of
from workflows.cli.sweep_progress import SweepProgress
from workflows.common.exit_codes import COMPLETE, FAILED
from workflows.common.metrics import Metric, write_summary
from workflows.common.one_run import COMPLETED, Limits, Outcome
from workflows.common.run_folder import check_study_folder
from workflows.common.stopwatch import Stopwatch
from workflows.common.toml_writer import to_toml
from workflows.sweep.drive import config_of, counts, drive, folder_of
from workflows.sweep.plan import SweepPlan, plan_of
from workflows.sweep.table import write_sweep

COPY = "sweep.toml"  # the file of the sweep, in its folder: the same file goes on there


def sweep_command(found: Mapping[str, ModuleType]) -> Callable[..., int]:
    """The command, for experiments by their name."""

    def sweep(
        file: Annotated[Path, Parameter(name="FILE", help="TOML file of an experiment with a table [sweep]")],
        /,
        *,
        out: Annotated[Path, Parameter(name="--out", help="folder to write, or that of this sweep, to go on")] = Path(
            "out/sweep"
        ),
        jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="runs at a time on this machine [1]")] = 2,
        scheduler: Annotated[
            str | None, Parameter(name="--scheduler", help="address of a Dask scheduler, whose workers make the runs")
        ] = None,
        retries: Annotated[int, Parameter(name="--retries", help="times that a killed run is begun again [1]")] = 3,
        time_limit: Annotated[float | None, Parameter(name="--time-limit", help="for each run [s]")] = None,
        memory_limit: Annotated[float | None, Parameter(name="--memory-limit", help="for each run [GB]")] = None,
        kind: Annotated[
            Literal["png", "pdf", "svg"] | None,
            Parameter(name="--format", help="of the picture; by default that of the runs"),
        ] = None,
        quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
    ) -> int:
        """Carry out many runs of one experiment, which vary as a file says; writes sweep.nc and sweep.png."""
        whole = (("--jobs", jobs, 1), ("--retries", retries, 0))
        given = (("--time-limit", time_limit), ("--memory-limit", memory_limit))
        wrong = [f"{name} {value}: must be >= {least}." for name, value, least in whole if value < least]
        wrong += [f"{name} {value:g}: must be > 0." for name, value in given if value is not None and not value > 0.0]
        if wrong:
            return complain(wrong)
        limits = Limits(time_limit, None if memory_limit is None else 1e9 * memory_limit)
        return exit_code_of(
            lambda: Sweep(found, file, out, quiet, kind).run(scheduler, jobs, retries, limits),
            f"lsm sweep {file} --out {out}",
        )

    return sweep


class Sweep:
    """A sweep in its folder, or the rest of one that was stopped.

    Parameters
    ----------
    found
        Module of each experiment by its name.
    file, out
        What runs are wanted, see `plan_of`; the folder of the sweep.
    quiet
        Print errors only.
    kind
        Format of the picture; None is that of the runs.

    Raises
    ------
    InputError
        If the file or the folder cannot be used.
    """

    def __init__(self, found: Mapping[str, ModuleType], file: Path, out: Path, quiet: bool, kind: str | None) -> None:
        self.watch, self.out, self.quiet = Stopwatch(), out, quiet
        self.plan = plan_of(file, found)
        self.text = file.read_text(encoding="utf-8")
        self.kind = kind or next(run.params.format for run in self.plan.runs if run.params is not None)
        self.ended: dict[str, Outcome] = {}
        copy = out / COPY
        same = copy.is_file() and copy.read_bytes() == self.text.encode()
        check_study_folder(out, copy, "sweep", same)

    def run(self, scheduler: str | None, jobs: int, retries: int, limits: Limits) -> int:
        """Carry out what is left, see `drive`; returns the exit code."""
        plan, out = self.plan, self.out
        out.mkdir(parents=True, exist_ok=True)
        with lsm.locked(out):
            (out / COPY).write_text(self.text, encoding="utf-8")
            _write_configs(plan, out)
            status = "interrupted"
            try:
                with SweepProgress(plan, out, self.quiet) as progress:
                    drive(plan, out, scheduler, jobs, retries, limits, self.ended, progress)
                status = "complete"
            finally:
                self.write(status)
        ends = sorted(self.ended.items())
        complain([f"run {label} {end.status}: {end.note}" for label, end in ends if end.status != COMPLETED])
        return COMPLETE if any(end.status == COMPLETED for _, end in ends) else FAILED

    def write(self, status: str) -> None:
        """Write sweep.nc and summary.json."""
        write_sweep(self.plan, self.out, self.ended, self.text, status)
        if status == "complete":
            self.draw()
        numbers = {"runs": len(self.plan.runs), **counts(self.ended)}
        metrics = {name: Metric(count, "1") for name, count in numbers.items()} | self.watch.metrics()
        write_summary(self.out, "sweep", None, metrics, quiet=self.quiet, run_status=status)

    def draw(self) -> None:
        """Draw the picture, if there is anything to draw."""
        from workflows.plots.sweep_figure import plot_sweep  # takes long to load

        try:
            plot_sweep(self.out, self.kind)
        except InputError as error:
            if not self.quiet:
                print(f"sweep: no picture: {error}", flush=True)


def _write_configs(plan: SweepPlan, out: Path) -> None:
    """A file of parameters for each run, with which it can be made alone."""
    (out / "points").mkdir(exist_ok=True)
    (out / "runs").mkdir(exist_ok=True)
    for run in plan.runs:
        if run.params is not None:
            with lsm.replacing(config_of(out, run)) as new:
                new.write_text(to_toml(run.params, plan.experiment), encoding="utf-8")
            folder_of(out, run).mkdir(exist_ok=True)
