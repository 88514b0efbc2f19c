"""Experiments that step a drive up and down again and again: their parameters, stages, stacks and the file of these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import taichi_lsm as lsm
from workflows.common.run_table import write_result
from workflows.gouge.layer_metrics import sheared_rows
from workflows.gouge.layer_parameters import LayerParams
from workflows.protocol.stage_tables import Interval, Sample, StageTable, Until

if TYPE_CHECKING:
    import xarray

FILE = "cycles.nc"
RUN_IN, UP, DOWN = "run-in", "up", "down"
FIRST_ROW = 0.5  # [t_i] after a step; then each row is so many times as long as the one before, up to
GROWTH = 1.1
LEAST_TIME = 8.0  # of a stage [t_i]: a step itself takes one or two
ROWS = 40  # of equal slip in a stage
BEFORE = 1.0 / 3.0  # of the slip of a stage, of which rows before a step are stacked
SETTLED = 0.5  # of the slip of a stage, from which on it counts as steady
GRID = (16, 48)  # points of a stack before and after the step


class StepParams(LayerParams):
    """A layer that is run in, and of which one drive is then stepped up and down again, cycle by cycle."""

    run_in: float = Field(default=1.0, ge=0.01, le=1e3, description="shear strain before the first step [1]")
    cycles: int = Field(
        default=30, ge=2, le=5000, description="number of steps up and down; errors are known from 8 on [1]"
    )
    step_slip: float = Field(default=3.0, ge=0.1, le=1e4, description="slip after each step [mean diameters]")

    @property
    def fastest(self) -> float:
        """Velocity of the fastest stage over V [1]."""
        return 1.0

    def problems_of_shear(self) -> Iterator[str]:
        """Slips within which no response to a step can be seen."""
        thickness = self.layer[0] / self.diameter
        least = LEAST_TIME * self.fastest * self.inertial_number * thickness
        if self.step_slip < least:
            yield (
                f"--step-slip {self.step_slip:g}: must be >= {least:.3g} at this velocity, so that a stage takes "
                f"{LEAST_TIME:g} inertial times; raise it, or lower --inertial-number {self.inertial_number:g}"
            )

    def step_tables(self, up: Mapping[str, Any], down: Mapping[str, Any]) -> list[StageTable]:
        """Run-in, and the two stages of a cycle, in which these keys of a stage change."""
        until = Until(slip=self.step_slip)
        sample = Sample(time=FIRST_ROW, growth=GROWTH, most=Interval(slip=self.step_slip / ROWS))
        more = {"repeat": self.cycles, "repeat_from": UP}
        return [
            StageTable(name=RUN_IN, velocity=1.0, until=Until(strain=self.run_in)),
            StageTable(name=UP, until=until, sample=sample, **up),
            StageTable(name=DOWN, until=until, sample=sample, **down, **more),
        ]


def stacks_of(dataset: xarray.Dataset, params: StepParams) -> dict[str, xarray.Dataset]:
    """The cycles of run.nc by the stage that begins with the step, both on the same slips; see `lsm.stack_cycles`.

    The slip is that of the platen, or of the load point where a spring pulls it.
    """
    run = sheared_rows(dataset)
    length = params.step_slip * params.diameter
    before = BEFORE * length
    first, slowest = np.geomspace(length / ROWS / 4.0, length, GRID[1]), np.linspace(-before, 0.0, GRID[0], False)
    grid = np.concatenate([slowest, first])
    of = "load_point" if params.spring else "platen"
    stacks = {stage: lsm.statistics.stack_cycles(run, stage, before, grid, of) for stage in (UP, DOWN)}
    common = np.intersect1d(*(stack.slip_since_step.values for stack in stacks.values()))  # slips that both have
    return {stage: stack.sel(slip_since_step=common) for stage, stack in stacks.items()}


def velocities_of(dataset: xarray.Dataset) -> dict[str, float]:
    """Velocity of the drive in each of the two stages [m s-1]: the median over its rows, most of them after a ramp."""
    run = sheared_rows(dataset)
    return {stage: float(np.median(run.load_point_velocity.values[run.stage.values == stage])) for stage in (UP, DOWN)}


def steady_changes(stacks: Mapping[str, xarray.Dataset], name: str, params: StepParams) -> NDArray:
    """(cycle,) change of a steady series by a step up: mean of that of the step up, and less that of the step down."""
    settled = SETTLED * params.step_slip * params.diameter
    changes = []
    for stage, sign in ((UP, 1.0), (DOWN, -1.0)):
        slip, values = stacks[stage].slip_since_step.values, stacks[stage][name].values
        width = np.gradient(slip)
        before, after = slip < 0.0, slip >= settled
        change = np.average(values[:, after], 1, width[after]) - np.average(values[:, before], 1, width[before])
        changes.append(sign * change)
    return np.mean(changes, axis=0)


def mean_over_cycles(changes: NDArray) -> lsm.statistics.Estimate:
    """Mean of changes (cycle,), whose error knows that neighbours are not independent.

    The end of a stage down lies after one step and before the next, and counts in two cycles. The variance of the mean
    is 1 + 2 rho times that of independent cycles, rho the correlation of neighbours, which that of n values tells too
    low by 1/n; it is never taken for less.
    """
    found, left = lsm.statistics.combine_replicas(changes), changes - np.mean(changes)
    if np.isnan(found.standard_error):
        return found
    neighbours = float(left[1:] @ left[:-1] / (left @ left)) + 1.0 / len(changes)
    return found._replace(standard_error=found.standard_error * float(np.sqrt(max(1.0, 1.0 + 2.0 * neighbours))))


def write_cycles(out: Path, stacks: Mapping[str, xarray.Dataset], params: LayerParams, title: str) -> None:
    """Write cycles.nc: a group for each stage, in which every series is along cycle and slip_since_step."""
    import xarray

    tree = xarray.DataTree.from_dict({f"/{stage}": stack for stage, stack in stacks.items()})
    summary = f"Series of run.nc after each step, one group for each kind: {', '.join(stacks)}."
    write_result(out / FILE, tree, params, title, summary)


def mean_and_error(stack: xarray.Dataset, name: str) -> tuple[NDArray, NDArray]:
    """(mean, standard error) over the cycles of a series of a stack, along its slips; nan for one cycle."""
    values = stack[name].values
    count = len(values)
    error = values.std(axis=0, ddof=1) / np.sqrt(count) if count > 1 else np.full(values.shape[1], np.nan)
    return values.mean(axis=0), error
