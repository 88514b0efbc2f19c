"""The runs of a sweep, from a file of parameters of one experiment with a table `[sweep]`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from taichi_lsm.core.errors import InputError, shown
from workflows.common.parameter_files import SWEEP, read_for, read_study
from workflows.common.parameter_types import members
from workflows.common.parameters import Params, merge_read
from workflows.sweep.factors import MOST_RUNS, Factor, Point, combined, factors_of

KEYS = ("grid", "together", "sample", "replicas")


@dataclass(frozen=True)
class PlannedRun:
    """One run of a sweep.

    Attributes
    ----------
    label
        Its number, and the name of its folder in `runs`.
    point
        What varies: value by parameter, with the seed if there are replicas.
    params
        Of the run; None if they are refused.
    refusal
        Why they are refused, else "".
    """

    label: str
    point: Point
    params: Params | None
    refusal: str = ""


@dataclass(frozen=True)
class SweepPlan:
    """What a file asks for.

    Attributes
    ----------
    experiment, module
        Name and module of the experiment.
    factors
        What varies; replicas come last.
    runs
        Every combination of the factors, of which the last varies fastest.
    """

    experiment: str
    module: ModuleType
    factors: tuple[Factor, ...]
    runs: tuple[PlannedRun, ...]

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that vary, in their order."""
        return tuple(name for factor in self.factors for name in factor.points[0])


def plan_of(path: Path, found: Mapping[str, ModuleType]) -> SweepPlan:
    """Read what runs a file asks for.

    Parameters
    ----------
    path
        A TOML file as `--config` takes it, which names its experiment, with a table `[sweep]`: see `factors_of`, and
        `replicas`, the number of runs of each point, with the seeds that follow `seed`.
    found
        Module of each experiment by its name.

    Returns
    -------
    SweepPlan
        Runs whose parameters contradict each other are in it with the reason.

    Raises
    ------
    InputError
        If the file cannot be used, or no run can be made; with the key, its value, what is allowed and what to do.
    """
    experiment, table, content = read_study(path, found, SWEEP, KEYS, f"such as [{SWEEP}.grid]")
    module = found[experiment]
    fields = module.Params.model_fields
    whole = frozenset(name for name in fields if _is_whole(fields[name].annotation))
    try:
        factors = factors_of(table, whole)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    others = {name: set(other.Params.model_fields) for name, other in found.items() if name != experiment}
    planner = _Planner(path, content, experiment, module, others)
    replicas, most = table.get("replicas", 1), MOST_RUNS // math.prod(len(factor.points) for factor in factors)
    if isinstance(replicas, bool) or not isinstance(replicas, int) or not 1 <= replicas <= most:
        raise InputError(f"{path}: sweep.replicas = {shown(replicas)}: must be a whole number from 1 to {most}")
    if replicas > 1:
        if any("seed" in factor.points[0] for factor in factors):
            raise InputError(f"{path}: sweep.replicas = {replicas}: gives the seeds, which vary already; remove one")
        first = planner.merged({}).seed
        factors.append(Factor("seed", [{"seed": first + r} for r in range(replicas)]))
    points = combined(factors)
    width = len(str(len(points)))
    runs = [planner.planned(f"{i + 1:0{width}d}", point) for i, point in enumerate(points)]
    if all(run.params is None for run in runs):
        raise InputError(runs[0].refusal)
    return SweepPlan(experiment, module, tuple(factors), tuple(runs))


class _Planner:
    """Makes and checks the parameters of the runs of a file, which is read once."""

    def __init__(
        self,
        path: Path,
        content: Mapping[str, Any],
        experiment: str,
        module: ModuleType,
        others: Mapping[str, set[str]],
    ) -> None:
        self.path, self.experiment, self.module = path, experiment, module
        self.mistakes: list[str] = []
        self.of_file = read_for(path, experiment, module.Params.model_fields, others, self.mistakes, content)
        self.accepted: set[str] = set()  # parameters without their seeds

    def merged(self, point: Point) -> Params:
        """The parameters of the file at a point; ParameterError as `merge`."""
        return merge_read(self.module.Params, None, self.of_file, str(self.path), point, self.experiment, self.mistakes)

    def planned(self, label: str, point: Point) -> PlannedRun:
        """The run at a point, with the reason if it is refused.

        Where parameters were accepted, other seeds of them are not checked: a check may pack grains for a second, and
        each run repeats it for itself. Where they were refused, another seed may do.
        """
        try:
            params = self.merged(point)
            without_seed = params.model_dump_json(exclude={"seed"})
            if without_seed not in self.accepted:
                self.module.check(params)
                self.accepted.add(without_seed)
        except InputError as error:
            return PlannedRun(label, point, None, str(error))
        return PlannedRun(label, point, params)


def _is_whole(annotation: Any) -> bool:
    """Whether a parameter takes whole numbers and no others."""
    return int in members(annotation) and float not in members(annotation)
