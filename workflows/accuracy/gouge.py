"""Physical choices of a sheared layer: stiffness and inertial number, size, step, strain and seeds, by its friction."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.accuracy import Trial
from workflows.common.parallel_runs import Job, run_replicas
from workflows.common.parameter_files import CONFIG
from workflows.common.refusals import checked
from workflows.common.run_folder import clear
from workflows.shape_roughness import rate_of

if TYPE_CHECKING:
    from workflows.accuracy_cost import Params

LAYER = {"layer_thickness": 12.0, "length": 14.0, "inertial_number": 5e-3}  # whose settings are changed one at a time
PARAMETERS = {  # settings; the last one is the reference, the most accurate or, of the platens, the usual one
    "stiffness_number": (300.0, 1000.0, 3000.0, 10_000.0),
    "inertial_number": (1e-2, 5e-3, 2.5e-3, 1.25e-3),
    "layer_thickness": (8.0, 12.0, 18.0, 27.0),
    "length": (8.0, 14.0, 21.0, 30.0),
    "step_safety": (0.8, 0.4, 0.2, 0.1),
    "platen_roughness": (0.5, 2.0, 1.4, 1.0),
}
WINDOWS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # strains over which friction is averaged
Series = list[tuple[NDArray, NDArray]]  # strain and friction of the rows of several runs
QUANTITIES = ("friction", "dilation", "coordination", "stress fluctuation")


def layer(params: Any, shape: str, seed: int, **changes: float) -> shear_gouge.Params:
    """Parameters of one run."""
    return checked(shear_gouge.Params, **LAYER | {"shape": shape, "seed": seed, "strain": params.strain} | changes)


def jobs_of(params: Params, shape: str, parameters: Sequence[str], out: Path) -> dict[tuple[str, float, int], Job]:
    """{(parameter, setting, seed): job} of all runs; settings change fastest.

    Those of the base layer share its runs.
    """
    base = layer(params, shape, params.seed)
    jobs = {}
    for seed in seeds_of(params):
        for parameter in parameters:
            for setting in PARAMETERS[parameter][-params.most_settings :]:
                same = getattr(base, parameter) == setting
                label = f"{shape}-base-{seed}" if same else f"{shape}-{parameter}-{setting:g}-{seed}"
                changes = {} if same else {parameter: setting}
                of_run = layer(params, shape, seed, **changes)
                jobs[parameter, setting, seed] = (label, shear_gouge.__name__, of_run, Path(out) / label)
    return jobs


def run_missing(jobs: Sequence[Job], at_a_time: int) -> list[Path]:
    """As `run_replicas`, but complete runs of the same parameters that exist already are not repeated."""
    for _, _, of_run, folder in jobs:
        if (Path(folder) / CONFIG).is_file() and not shear_gouge.can_go_on(of_run, Path(folder)):
            clear(Path(folder))  # of an experiment that was overwritten
    run_replicas(jobs, at_a_time, resume=True)
    return [Path(job[3]) for job in jobs]


def measured(folder: Path, of_run: shear_gouge.Params) -> dict[str, float]:
    """{quantity: value of a run}, with its standard error of friction and its cost: seconds for a unit of strain."""
    dataset = lsm.open_run(folder / "run.nc")
    sheared = dataset.isel(time=dataset.stage.values == "shear")
    steady = sheared.isel(time=sheared.shear_strain.values >= of_run.steady_from)
    friction = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, of_run.steady_from)
    begin = float(dataset.layer_thickness.values[dataset.stage.values != "shear"][-1])
    first, last = sheared.isel(time=0), sheared.isel(time=-1)
    steps = float(last.time - first.time) / dataset.dt / float(last.shear_strain - first.shear_strain)
    return {
        "friction": friction.mean,
        "friction_se": friction.standard_error,
        "dilation": float(steady.layer_thickness.mean()) / begin - 1.0,
        "coordination": float(steady.coordination_number.mean()),
        "stress fluctuation": float(steady.shear_stress.std() / steady.normal_stress.mean()),
        "cost": steps / rate_of(folder) * lsm.open_run(folder / "grains.nc").sizes["grain"],
    }


def measure_parameters(
    params: Params, shape: str, parameters: Sequence[str], out: Path, usual: float | None
) -> tuple[list[Trial], dict[Any, Any], float]:
    """Trials of these parameters, {(parameter, setting, seed): measured}, usual.

    usual [s]: cost of the layer of discs, None if it is to be found here.
    """
    jobs = jobs_of(params, shape, parameters, out)
    run_missing(list({job[0]: job for job in jobs.values()}.values()), 1)  # they are timed
    found = {key: measured(Path(job[3]), job[2]) for key, job in jobs.items()}
    base = layer(params, shape, params.seed)
    cost = costs_of(found)
    if usual is None:
        usual = next(c for (parameter, s), c in cost.items() if s == getattr(base, parameter))
    trials = []
    for parameter in parameters:
        settings = PARAMETERS[parameter][-params.most_settings :]
        for quantity in QUANTITIES:
            of_last = [found[parameter, settings[-1], seed][quantity] for seed in seeds_of(params)]
            for setting in settings:
                of_parameter = cost[parameter, setting]
                for replica, seed in enumerate(seeds_of(params)):
                    error = abs(found[parameter, setting, seed][quantity] - float(np.mean(of_last)))
                    where = (f"{parameter}, {shape}", f"{setting:g}", setting, quantity, replica)
                    trials.append(Trial(*where, error, of_parameter, of_parameter / usual))
    return trials, found, usual


def costs_of(found: dict[Any, Any]) -> dict[tuple[str, float], float]:
    """{(parameter, setting): median over the seeds of the cost of a unit of strain [s]}."""
    keys = dict.fromkeys((parameter, setting) for parameter, setting, _ in found)
    return {key: float(np.median([m["cost"] for k, m in found.items() if k[:2] == key])) for key in keys}


def of_steps(params: Params, found: dict[Any, Any]) -> dict[str, dict[str, float]]:
    """Entries of time steps in the table for target errors: bias of the friction.

    The usual step counts as unbiased, as a quarter of it gives the same friction within the errors. The bias of the
    longer one is the difference from the shortest, or the standard error of this difference if that is larger.
    """
    base, seeds = shear_gouge.Params().step_safety, seeds_of(params)
    if ("step_safety", PARAMETERS["step_safety"][0], params.seed) not in found:
        return {"bias_of_step": {f"{base:g}": 0.0}}
    coarse, finest = PARAMETERS["step_safety"][0], PARAMETERS["step_safety"][-1]
    means = {s: np.array([found["step_safety", s, seed]["friction"] for seed in seeds]) for s in (coarse, finest)}
    apart = abs(float(means[coarse].mean() - means[finest].mean()))
    error = float(np.sqrt(sum(m.var(ddof=1) for m in means.values()) / len(seeds)))
    return {"bias_of_step": {f"{coarse:g}": max(apart, error), f"{base:g}": 0.0}}


def seeds_of(params: Params) -> range:
    """Seeds of the replicas."""
    return range(params.seed, params.seed + params.seeds)


def frictions(folder: Path, steady_from: float) -> tuple[NDArray, NDArray]:
    """(strain, friction) of the rows of steady shear of a run."""
    dataset = lsm.open_run(Path(folder) / "run.nc")
    sheared = dataset.isel(time=dataset.stage.values == "shear")
    chosen = sheared.shear_strain.values >= steady_from
    return sheared.shear_strain.values[chosen], sheared.friction.values[chosen]


def window_means(series: Series, width: float) -> list[NDArray]:
    """Means (k,) of friction over consecutive windows of this strain in each of several runs, as a list of arrays."""
    means = []
    for strain, friction in series:
        number = ((strain - strain[0]) / width).astype(int)
        whole = range(int((strain[-1] - strain[0]) / width + 1e-9))
        means.append(np.array([friction[number == i].mean() for i in whole]))
    return means


def spread(series: Series) -> dict[float, float]:
    """{strain: variance of the mean friction over a window of that strain}, of windows that fit twice into a run.

    The variance is about the mean of all runs: differences between seeds that no strain averages out are part of it.
    """
    grand = float(np.mean([friction.mean() for _, friction in series]))
    found = {}
    for width in WINDOWS:
        means = np.concatenate(window_means(series, width))
        if len(means) >= 2 * len(series):
            found[width] = float(np.mean((means - grand) ** 2))
    return found


def variance_law(series: Series) -> tuple[float, float]:
    """(variance between seeds b2, variance times strain a) so that a window of strain L has the variance b2 + a/L."""
    found = spread(series)
    width, variance = np.array(list(found)), np.array(list(found.values()))
    weight = np.sqrt(width) / variance  # of long windows there are few
    design = np.stack([np.ones_like(width), 1.0 / width], axis=1)
    from scipy.optimize import nnls  # imported when needed: `lsm --help` must answer at once

    (between, within), _ = nnls(design * weight[:, None], variance * weight)
    return float(between), float(within)


def measure_strain(params: Params, shape: str, out: Path, usual: float) -> tuple[list[Trial], dict[str, Any]]:
    """(trials of strain and seeds, row of the table for target errors) from long runs of the base layer.

    Errors are deviations of window means from the mean of all runs; windows of a run follow each other without a gap.
    """
    seeds = range(params.seed, params.seed + params.long_runs)
    base = {seed: layer(params, shape, seed, strain=params.long_strain) for seed in seeds}
    jobs = [(f"{shape}-long-{s}", shear_gouge.__name__, p, Path(out) / f"{shape}-long-{s}") for s, p in base.items()]
    folders = run_missing(jobs[:1], 1) + run_missing(jobs[1:], 2)  # the first alone, for its cost
    of_run = base[params.seed]
    series = [frictions(folder, of_run.steady_from) for folder in folders]
    cost = measured(folders[0], of_run)["cost"]
    grand = float(np.mean([friction.mean() for _, friction in series]))
    trials, quantity = [], "statistical error of friction"
    for width in spread(series):
        for replica, means in enumerate(window_means(series, width)):
            error = float(np.sqrt(np.mean((means - grand) ** 2)))
            where = (f"strain, {shape}", f"{width:g}", width, quantity, replica)
            trials.append(Trial(*where, error, cost * width, cost * width / usual))
    by_run = window_means(series, 1.0)
    at_once = np.stack([means[: min(map(len, by_run))] for means in by_run])  # (run, window)
    for count in (1, 2, 3, 6, 12):
        for replica in range(len(at_once) // count):
            together = at_once[replica * count : (replica + 1) * count].mean(axis=0)
            error = float(np.sqrt(np.mean((together - grand) ** 2)))
            where = (f"seeds, {shape}", f"{count}", count, quantity, replica)
            trials.append(Trial(*where, error, cost * count, cost * count / usual))
    return trials, row_of_table(of_run, folders, series)


def row_of_table(of_run: shear_gouge.Params, folders: Sequence[Path], series: Series) -> dict[str, Any]:
    """Variances of the layer `of_run`, from which target errors are planned."""
    between, within = variance_law(series)
    thickness, lengths = of_run.layer
    area = thickness * np.prod(lengths) / of_run.diameter ** (1 + len(lengths))
    return {
        "shape": of_run.shape,
        "dim": of_run.dim,
        "stiffness_number": of_run.stiffness_number,
        "inertial_number": of_run.inertial_number,
        "area": float(area),
        "between_seeds": between,
        "times_strain": within,
        "runs": len(folders),
        "strain": of_run.strain,
    }
