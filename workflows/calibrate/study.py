"""What a calibration is asked for: a file of parameters of one experiment with a table `[calibrate]`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from taichi_lsm.core.errors import InputError, shown
from workflows.calibrate.design import least_points
from workflows.calibrate.laboratory import laboratory_targets
from workflows.calibrate.loop import Problem
from workflows.calibrate.priors import Prior, points_at, priors_of
from workflows.calibrate.targets import Target, targets_of, with_model_errors
from workflows.common.parameter_files import CALIBRATE, content_of, read_study
from workflows.common.parameters import Params, merge
from workflows.common.toml_writer import to_toml
from workflows.sweep.factors import MOST_RUNS, Point

KEYS = ("priors", "targets", "laboratory", "model_error", "runs", "batch", "replicas", "seed")
OF_TARGETS = ("targets", "laboratory", "model_error", "runs", "batch", "seed")  # may change while the runs stay
RUNS, BATCH = 60, 8  # by default


@dataclass(frozen=True)
class Study:
    """A calibration of an experiment.

    Attributes
    ----------
    experiment, module
        Name and module of the experiment.
    base
        Parameters at the middle of the priors: all that does not vary.
    problem
        What is asked.
    text
        The file.
    """

    experiment: str
    module: ModuleType
    base: Params
    problem: Problem
    text: str

    def sweep_of(self, points: list[Point], first: int) -> str:
        """The file of a sweep with the runs at points; `first` is the number of those before it.

        Each run has a seed of its own: with one seed for all they would share a packing, and what is special about it
        would be taken for what the parameters do.
        """
        replicas = self.problem.replicas
        columns: dict[str, list[float]] = {
            name: [p[name] for p in points for _ in range(replicas)] for name in points[0]
        }
        seeds = [self.base.seed + first + i for i in range(len(points) * replicas)]
        rows = [f"{name} = {values!r}" for name, values in columns.items()] + [f"seed = {seeds!r}"]
        return to_toml(self.base, self.experiment) + "\n[sweep.together]\n" + "\n".join(rows) + "\n"


def study_of(path: Path, found: Mapping[str, ModuleType]) -> Study:
    """Read a calibration.

    Parameters
    ----------
    path
        A TOML file as `--config` takes it, which names its experiment, with a table `[calibrate]`.
    found
        Module of each experiment by its name.

    Raises
    ------
    InputError
        With the file, the key, its value, what is allowed and what to do.
    """
    experiment, table, _ = read_study(path, found, CALIBRATE, KEYS)
    module = found[experiment]
    try:
        priors = priors_of(table.get("priors"), module.Params)
        problem = _problem(table, priors, _targets(table, path.parent))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    (middle,) = points_at(priors, np.full((1, len(priors)), 0.5))
    others = {name: set(other.Params.model_fields) for name, other in found.items() if name != experiment}
    base = merge(module.Params, None, path, middle, experiment, others)
    module.check(base)
    if base.seed + problem.points * problem.replicas > 2**31:
        raise InputError(f"{path}: seed = {base.seed}: each run has a seed of its own from there on, must be smaller")
    return Study(experiment, module, base, problem, path.read_text(encoding="utf-8"))


def identity_of(path: Path) -> dict[str, Any]:
    """What the runs of a calibration depend on: all of its file but targets and budget."""
    content = content_of(path)
    table = content.get(CALIBRATE)
    kept = {k: v for k, v in table.items() if k not in OF_TARGETS} if isinstance(table, Mapping) else {}
    return content | {CALIBRATE: kept}


def _targets(table: Mapping[str, Any], folder: Path) -> tuple[Target, ...]:
    """Targets of the file, and those of a laboratory's series."""
    targets: tuple[Target, ...] = ()
    if "laboratory" in table:
        targets = laboratory_targets(table["laboratory"], folder)
    if "targets" in table or not targets:
        given = targets_of(table.get("targets"))
        names = {target.metric for target in given}
        if twice := [target.metric for target in targets if target.metric in names]:
            raise InputError(
                f"calibrate.targets.{twice[0]}: is measured by calibrate.laboratory too, remove one of them"
            )
        targets += given
    return with_model_errors(targets, table.get("model_error", {}))


def _problem(table: Mapping[str, Any], priors: tuple[Prior, ...], targets: tuple[Target, ...]) -> Problem:
    replicas = _whole(table, "replicas", 1, 1, 1000)
    runs = _whole(table, "runs", RUNS * replicas, least_points(len(priors)) * replicas, MOST_RUNS)
    batch = _whole(table, "batch", BATCH, 1, MOST_RUNS)
    return Problem(priors, targets, runs // replicas, batch, replicas, _whole(table, "seed", 1, 0, 2**31 - 1))


def _whole(table: Mapping[str, Any], key: str, default: int, least: int, most: int) -> int:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(f"calibrate.{key} = {shown(value)}: must be a whole number from {least} to {most}")
    return value
