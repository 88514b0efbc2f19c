"""A calibration: runs everywhere, then runs where they tell most, until the budget is spent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from numpy.typing import NDArray

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.calibrate.design import first_design, first_size, next_points
from workflows.calibrate.emulator import Emulators, emulators_of
from workflows.calibrate.posterior import POINTS, Posterior, posterior_of
from workflows.calibrate.priors import Prior, points_at, shares_of
from workflows.calibrate.samples import Sample
from workflows.calibrate.targets import Target
from workflows.common.parameter_problems import nearest
from workflows.sweep.factors import Point


@dataclass(frozen=True)
class Problem:
    """What is asked of a calibration.

    Attributes
    ----------
    priors, targets
        What is known of the parameters, and what they are to give.
    points
        Parameters at which runs are made, all batches together.
    batch, replicas
        Points of a batch after the first; runs at each point.
    seed
        Of designs and draws.
    resolution
        Points that fill the prior, of which the posterior is made: a power of two.
    """

    priors: tuple[Prior, ...]
    targets: tuple[Target, ...]
    points: int
    batch: int = 8
    replicas: int = 1
    seed: int = 1
    resolution: int = POINTS

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics that have targets."""
        return tuple(target.metric for target in self.targets)


@dataclass(frozen=True)
class Calibration:
    """What a calibration has found.

    Attributes
    ----------
    samples
        All runs, those that gave nothing with the reason.
    emulators, posterior
        Of those that gave all targets.
    """

    samples: tuple[Sample, ...]
    emulators: Emulators
    posterior: Posterior


# Runs batch number n (from 1 on) at points; all the runs that were made of it.
Simulate = Callable[[int, Callable[[], list[Point]]], list[Sample]]


def calibrate(problem: Problem, simulate: Simulate, tell: Callable[[str], None] = lambda text: None) -> Calibration:
    """Carry out a calibration.

    Parameters
    ----------
    problem
        What is asked.
    simulate
        Takes the number of a batch and a function that gives its points, which is only called if the batch is new;
        returns its runs.
    tell
        Takes a line after each batch.

    Raises
    ------
    InputError
        If a library is missing, or no run gives a metric that has a target.
    SimulationError
        If too few runs give all targets.
    """
    samples: list[Sample] = []
    found: Calibration | None = None
    number, made = 0, 0
    while made < problem.points:
        number += 1
        size = first_size(problem.points, len(problem.priors)) if number == 1 else problem.batch
        size = min(size, problem.points - made)
        before = found

        def points(size: int = size, number: int = number, before: Calibration | None = before) -> list[Point]:
            return points_at(problem.priors, _design(problem, before, size, number))

        batch = simulate(number, points)
        samples += batch
        made += max(1, len(batch) // problem.replicas)  # which may differ from `size` if the batch was made before
        found = learned(problem, samples)
        tell(_line(problem, found, number, made))
    if found is None:
        raise SimulationError("calibrate: no runs were asked for")
    return found


def _design(problem: Problem, before: Calibration | None, size: int, number: int) -> NDArray:
    """Points (size, d) of a batch in the unit cube."""
    if before is None:
        return first_design(size, len(problem.priors), problem.seed)
    seed = problem.seed + number
    return next_points(before.emulators, before.posterior, problem.targets, size, problem.replicas, seed)


def learned(problem: Problem, samples: Sequence[Sample]) -> Calibration:
    """Emulators and posterior from the runs so far; runs that gave not all targets are left out."""
    whole = [sample for sample in samples if sample.has(problem.metrics)]
    known = sorted({name for sample in samples for name in sample.metrics})
    for metric in problem.metrics:
        if known and metric not in known:
            raise InputError(
                f"calibrate.targets.{metric}: no run gave it, must be one of {', '.join(known)}."
                f"{nearest(metric, known)}"
            )
    shares = shares_of(problem.priors, [sample.point for sample in whole])
    emulators = emulators_of(shares, whole, problem.metrics, problem.seed)
    posterior = posterior_of(emulators, problem.targets, len(problem.priors), problem.seed, problem.resolution)
    return Calibration(tuple(samples), emulators, posterior)


def _line(problem: Problem, found: Calibration, number: int, made: int) -> str:
    """What is known after a batch."""
    lost = sum(not sample.has(problem.metrics) for sample in found.samples)
    parts = []
    for i, prior in enumerate(problem.priors):
        values = prior.at(found.posterior.shares[:, i])
        mean, deviation = found.posterior.mean_and_deviation(values)
        parts.append(f"{prior.name} {mean:.3g} +- {deviation:.2g}")
    told = f", {lost} runs gave nothing" if lost else ""
    return f"batch {number}, {made} of {problem.points} points{told}: {', '.join(parts)}"
