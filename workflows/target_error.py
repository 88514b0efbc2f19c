"""How much strain and how many seeds a wanted error of the friction needs, from measured variances."""

import json
from dataclasses import dataclass

import numpy as np

import taichi_lsm as lsm

TABLE = "friction_errors.json"
NORMAL = 1.96  # standard errors in the half-width of a 95 % interval
CAUTION = 1.25  # times wider than measured: the table was measured with few seeds; found by the back-test
STRAINS = np.round(np.geomspace(0.3, 40.0, 40), 2)  # of steady shear, to choose from
MOST_SEEDS = 32
STEP_SAFETY = 0.4


@dataclass(frozen=True)
class Plan:
    """What is run: `seeds` runs to the strain `strain`; expected_error: half-width of the 95 % interval of the mean
    friction; expected_seconds: on one core for each of two runs at a time."""

    step_safety: float
    strain: float
    seeds: int
    expected_error: float
    expected_seconds: float


def table_of(shape, dim):
    """The row of the measured table for this shape and dimension; InputError if there is none."""
    rows = json.loads(lsm.data_path(TABLE).read_text(encoding="utf-8"))["rows"]
    for row in rows:
        if row["shape"] == shape and row["dim"] == dim:
            return row
    known = ", ".join(f"--shape {row['shape']} --dim {row['dim']}" for row in rows)
    raise lsm.InputError(f"--target-error: the errors of --shape {shape} --dim {dim} are not measured, only of {known}")


def half_width(row, params, steady, seeds):
    """Half-width of the 95 % interval of the mean over `seeds` runs of the steady strain `steady`, for this layer.

    The variance falls with the area of the layer: far parts of it fluctuate independently.
    """
    thickness, lengths = params.layer
    area = thickness * np.prod(lengths) / params.diameter ** (1 + len(lengths))
    variance = (row["between_seeds"] + row["times_strain"] / steady) * row["area"] / area
    return CAUTION * (NORMAL * np.sqrt(variance / seeds) + row["bias_of_step"])


def seconds(row, params, steady, seeds):
    """Seconds of `seeds` runs, two at a time: a start, consolidation and shear."""
    thickness, lengths = params.layer
    grains = row["grains_per_area"] * thickness * np.prod(lengths) / params.diameter ** (1 + len(lengths))
    stiff = np.sqrt(params.stiffness_number / row["stiffness_number"]) * row["inertial_number"] / params.inertial_number
    run = row["start_seconds"] + row["seconds_per_grain_strain"] * stiff * grains * (params.steady_from + steady)
    return run * np.ceil(seeds / 2)


def plan(params, target_error):
    """The cheapest Plan whose 95 % half-width is at most `target_error` [1]; InputError if none of them is."""
    row = table_of(params.shape, params.dim)
    best = None
    for seeds in range(1, MOST_SEEDS + 1):
        for steady in STRAINS:
            error = half_width(row, params, steady, seeds)
            if error <= target_error:
                cost = seconds(row, params, steady, seeds)
                if best is None or cost < best.expected_seconds:
                    strain = round(params.steady_from + float(steady), 2)
                    best = Plan(STEP_SAFETY, strain, seeds, float(error), float(cost))
                break
    if best is None:
        least = half_width(row, params, STRAINS[-1], MOST_SEEDS)
        raise lsm.InputError(
            f"--target-error {target_error:g}: must be >= {least:.2g}, what {MOST_SEEDS} runs to a strain of "
            f"{STRAINS[-1]:g} give; a larger layer has smaller errors"
        )
    return best


def reached(row, params, means, errors):
    """Half-width of the 95 % interval that runs with these means and standard errors have reached.

    Few seeds tell little about their own scatter: the table's variance between seeds is added to that within runs, and
    the scatter that is seen is taken where it is larger.
    """
    count = len(means)
    thickness, lengths = params.layer
    area = thickness * np.prod(lengths) / params.diameter ** (1 + len(lengths))
    within = float(np.mean(np.square(errors))) + row["between_seeds"] * row["area"] / area
    seen = float(np.var(means, ddof=1)) if count > 2 else 0.0
    return float(NORMAL * np.sqrt(max(within, seen) / count) + row["bias_of_step"])
