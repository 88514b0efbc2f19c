"""Are planted parameters found? `python -m benchmarks.calibration` prints the answer, from some 84 runs of layers.

A design of runs of angular grains in 2D over particle friction and corner radius gives emulators. Then runs with other
seeds, at parameters that are drawn from the prior, are taken for measurements: their parameters are to lie within the
joint region of 95 % of what `lsm calibrate` infers. The runs are two sweeps, which go on where they were stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import binom

from workflows.calibrate.design import first_design
from workflows.calibrate.emulator import Emulators, emulators_of
from workflows.calibrate.posterior import log_likelihood_of, posterior_of
from workflows.calibrate.priors import Prior, points_at, shares_of
from workflows.calibrate.result import interval_of
from workflows.calibrate.samples import Sample, sample_of
from workflows.calibrate.targets import Target
from workflows.cli.main import main as lsm_command
from workflows.common.discovery import find_workflows
from workflows.common.metrics import read_summary
from workflows.common.run_folder import is_complete
from workflows.sweep.drive import folder_of
from workflows.sweep.factors import Point
from workflows.sweep.plan import plan_of

PRIORS = (Prior("friction", 0.1, 0.9), Prior("corner_radius", 0.02, 0.2, log=True))
METRICS = ("friction_mean", "porosity", "coordination_number", "sliding_fraction")
BASE = 'experiment = "shear-gouge"\npreset = "smoke"\nshape = "angular"\nstrain = 3.0\n'
DESIGN, TARGETS = 64, 20  # runs
FIRST_SEED = {"design": 1, "targets": 1001}
LEVEL, LEAST = 0.95, 17  # of the region, and of 20 targets within it


def sweep_file(points: Sequence[Point], first_seed: int) -> str:
    """The file of a sweep with a run at each point, each with a seed of its own."""
    columns = {name: [point[name] for point in points] for name in points[0]}
    columns |= {"seed": [first_seed + i for i in range(len(points))]}
    return BASE + "\n[sweep.together]\n" + "".join(f"{name} = {values!r}\n" for name, values in columns.items())


def run_sweep(out: Path, name: str, points: Sequence[Point], jobs: int, only_evaluate: bool) -> list[Sample]:
    """The runs of a sweep in `out`/name that are complete, made where they are not."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{name}.toml"
    file.write_text(sweep_file(points, FIRST_SEED[name]), encoding="utf-8")
    if not only_evaluate:
        lsm_command(["sweep", str(file), "--out", str(out / name), "--jobs", str(jobs)])
    samples = []
    for run in plan_of(file, find_workflows()).runs:
        folder = folder_of(out / name, run)
        if is_complete(folder):
            point = {prior.name: run.point[prior.name] for prior in PRIORS}
            samples.append(sample_of(point, (read_summary(folder) or {})["metrics"]))
    return samples


def targets_of_run(sample: Sample) -> tuple[Target, ...]:
    """The metrics of one run as targets, friction with the error that the run knows of itself."""
    errors = {name: sample.error(name) for name in METRICS}
    return tuple(
        Target(name, sample.metrics[name], errors[name] if np.isfinite(errors[name]) else None, runs=1)
        for name in METRICS
    )


def report(emulators: Emulators, samples: Sequence[Sample]) -> int:
    """Print what is inferred for each target; returns how many planted points lie within their region."""
    print("planted friction and corner radius, probability of what is likelier, 95 % intervals")
    inside = 0
    for number, sample in enumerate(samples, start=1):
        targets = targets_of_run(sample)
        posterior = posterior_of(emulators, targets, len(PRIORS), 1)
        (likelihood,) = log_likelihood_of(emulators.predict(shares_of(PRIORS, [sample.point])), emulators, targets)
        mass = posterior.mass_above(likelihood)
        inside += mass <= LEVEL
        ends = [interval_of(prior.at(posterior.shares[:, i]), posterior.weights) for i, prior in enumerate(PRIORS)]
        within = "within" if mass <= LEVEL else "OUTSIDE"
        intervals = ", ".join(f"{low:.3f} to {high:.3f}" for low, high in ends)
        planted = ", ".join(f"{value:.3f}" for value in sample.point.values())
        print(f"{number:3}  {planted}  {mass:.3f}  {within:7}  {intervals}", flush=True)
    return inside


def main(arguments: Sequence[str] | None = None) -> None:
    """Make what runs are missing, and print the coverage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/calibration"), help="folder of the two sweeps")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--evaluate", action="store_true", help="make no runs: tell what those that are there give")
    given = parser.parse_args(arguments)
    points = {
        "design": points_at(PRIORS, first_design(DESIGN, len(PRIORS), 1)),
        "targets": points_at(PRIORS, np.random.default_rng(2026).random((TARGETS, len(PRIORS)))),
    }
    found = {name: run_sweep(given.out, name, these, given.jobs, given.evaluate) for name, these in points.items()}
    runs = [sample for sample in found["design"] if sample.has(METRICS)]
    planted = [sample for sample in found["targets"] if sample.has(METRICS)]
    emulators = emulators_of(shares_of(PRIORS, [sample.point for sample in runs]), runs, METRICS, 1)
    print(f"{len(runs)} runs of the design; of each metric: scatter between seeds, its share of the deviation of all")
    for i, metric in enumerate(METRICS):
        share, check = emulators.scatter[i] / emulators.width[i], np.sqrt(np.mean(emulators.residuals[:, i] ** 2))
        print(f"  {metric:20} {emulators.scatter[i]:.4f} {share:.2f}, left-out runs missed by {check:.2f} deviations")
    with np.printoptions(precision=2, suppress=True):
        print(f"correlation of what differs between seeds:\n{emulators.correlation}")
    inside = report(emulators, planted)
    chance = binom.cdf(inside, len(planted), LEVEL)
    print(f"{inside} of {len(planted)} within the joint region of 95 %; so few or fewer by chance: {chance:.2f}")
    if len(planted) == TARGETS:
        print(f"at least {LEAST} of {TARGETS} are wanted: {'holds' if inside >= LEAST else 'FAILS'}")


if __name__ == "__main__":
    main()
