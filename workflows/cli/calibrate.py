"""`lsm calibrate`: finds the parameters that give what was measured, with their uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Annotated

import numpy as np
from cyclopts import Parameter

import taichi_lsm as lsm
from workflows.calibrate.design import first_design
from workflows.calibrate.loop import Calibration, calibrate
from workflows.calibrate.posterior_file import DRAWS, errors_of, write_posterior
from workflows.calibrate.priors import shares_of
from workflows.calibrate.result import metrics_of
from workflows.calibrate.samples import Sample, sample_of
from workflows.calibrate.study import Study, identity_of, study_of
from workflows.calibrate.verdicts import verdicts
from workflows.cli.execution import complain, exit_code_of
from workflows.cli.sweep import Sweep
from workflows.common.exit_codes import COMPLETE
from workflows.common.libraries import library
from workflows.common.metrics import read_summary, write_summary
from workflows.common.one_run import COMPLETED, Limits, Outcome
from workflows.common.parameter_coordinates import unit_and_name
from workflows.common.run_folder import check_study_folder
from workflows.common.stopwatch import Stopwatch
from workflows.plots.calibration import Axis, Compared, edges_of, plot_calibration
from workflows.sweep.drive import folder_of
from workflows.sweep.factors import Point
from workflows.sweep.plan import PlannedRun

COPY = "calibrate.toml"  # the file of the calibration, in its folder
BATCHES = "batches"  # folder of the sweeps


def calibrate_command(found: Mapping[str, ModuleType]) -> Callable[..., int]:
    """The command, for experiments by their name."""

    def calibrate(
        file: Annotated[Path, Parameter(name="FILE", help="TOML file of an experiment with a table [calibrate]")],
        /,
        *,
        out: Annotated[Path, Parameter(name="--out", help="folder to write, or that of this one, to go on")] = Path(
            "out/calibrate"
        ),
        jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="runs at a time on this machine [1]")] = 2,
        scheduler: Annotated[
            str | None, Parameter(name="--scheduler", help="address of a Dask scheduler, whose workers make the runs")
        ] = None,
        quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
    ) -> int:
        """Find the parameters of an experiment that give measured values; writes posterior.nc and a picture."""
        if jobs < 1:
            return complain([f"--jobs {jobs}: must be >= 1."])
        return exit_code_of(
            lambda: CalibrationFolder(found, file, out, quiet).run(scheduler, jobs), f"lsm calibrate {file} --out {out}"
        )

    return calibrate


class CalibrationFolder:
    """A calibration in its folder, or the rest of one that was stopped.

    Parameters
    ----------
    found
        Module of each experiment by its name.
    file, out
        What is asked, see `study_of`; the folder.
    quiet
        Print errors only.

    Raises
    ------
    InputError
        If the file or the folder cannot be used, or a library is missing.
    """

    def __init__(self, found: Mapping[str, ModuleType], file: Path, out: Path, quiet: bool) -> None:
        self.watch, self.found, self.out, self.quiet = Stopwatch(), found, out, quiet
        for name in ("sklearn.gaussian_process", "arviz_base"):  # before hours of runs
            library(name, "calibrate")
        self.study, self.runs = study_of(file, found), 0
        copy = out / COPY
        same = copy.is_file() and identity_of(copy) == identity_of(file)
        check_study_folder(out, copy, "calibration", same, "; only its targets and runs may change")

    def run(self, scheduler: str | None, jobs: int) -> int:
        """Carry out what is left, and write all files; returns the exit code."""
        study, out = self.study, self.out
        out.mkdir(parents=True, exist_ok=True)
        with lsm.locked(out):
            (out / COPY).write_text(study.text, encoding="utf-8")
            (out / BATCHES).mkdir(exist_ok=True)

            def simulate(number: int, points: Callable[[], list[Point]]) -> list[Sample]:
                return self.made(number, points, scheduler, jobs)

            result = calibrate(study.problem, simulate, self.announce)
            self.write(result)
        targets, priors = study.problem.targets, study.problem.priors
        complain([f"{line}." for line in verdicts(result.emulators, result.posterior, targets, priors)])
        return COMPLETE

    def announce(self, what: str) -> None:
        """Print a line."""
        if not self.quiet:
            print(f"calibrate: {what}", flush=True)

    def made(self, number: int, points: Callable[[], list[Point]], scheduler: str | None, jobs: int) -> list[Sample]:
        """The runs of one batch, a sweep of its own; the points of one that was begun are those of its file."""
        folder = self.out / BATCHES / f"{number:02d}"
        file = self.out / BATCHES / f"{number:02d}.toml"
        if not file.is_file():
            with lsm.replacing(file) as new:
                new.write_text(self.study.sweep_of(points(), self.runs), encoding="utf-8")
        sweep = Sweep(self.found, file, folder, self.quiet, None)
        sweep.run(scheduler, jobs, retries=3, limits=Limits())
        self.runs += len(sweep.plan.runs)
        names = [prior.name for prior in self.study.problem.priors]
        return [_sample(run, folder, names, sweep.ended.get(run.label)) for run in sweep.plan.runs]

    def write(self, found: Calibration) -> None:
        """Write posterior.nc, the picture and summary.json."""
        write_posterior(self.study, found, self.out)
        draw(self.study, found, self.out / f"calibration.{self.study.base.format}")
        metrics = metrics_of(self.study, found) | self.watch.metrics()
        write_summary(self.out, "calibrate", self.study.base.preset_name, metrics, quiet=self.quiet)


def _sample(run: PlannedRun, folder: Path, names: Sequence[str], end: Outcome | None) -> Sample:
    """What a run of a sweep gave."""
    point = {name: run.point[name] for name in names}
    if end is None or end.status != COMPLETED:
        return Sample(point, note=end.note if end else "not made")
    return sample_of(point, (read_summary(folder_of(folder, run)) or {}).get("metrics", {}))


def draw(study: Study, found: Calibration, path: Path) -> None:
    """Draw the picture of a calibration."""
    problem, posterior, emulators = study.problem, found.posterior, found.emulators
    used = [sample for sample in found.samples if sample.has(problem.metrics)]
    runs = shares_of(problem.priors, [sample.point for sample in used])
    axes = []
    for i, prior in enumerate(problem.priors):
        edges = edges_of(posterior.shares[:, i], posterior.weights)
        unit, _ = unit_and_name(type(study.base), prior.name)
        label = f"{'particle ' * (prior.name == 'friction')}{prior.name.replace('_', ' ')} [{unit}]"
        values = prior.at(posterior.shares[:, i])
        axes.append(Axis(label, prior.log, prior.at(edges), np.diff(edges), values, prior.at(runs[:, i])))
    everywhere = emulators.predict(first_design(DRAWS, len(problem.priors), problem.seed))
    drawn, errors = posterior.draws(DRAWS, problem.seed), errors_of(emulators, problem.targets)
    units = {name: unit for sample in used for name, unit in sample.units.items()}
    compared = [
        Compared(
            f"{target.metric.replace('_', ' ')} [{units.get(target.metric, '1')}]",
            target.value,
            errors[target.metric],
            posterior.predicted.mean[drawn, i],
            everywhere.mean[:, i],
        )
        for i, target in enumerate(problem.targets)
    ]
    plot_calibration(path, axes, posterior.weights, compared)
