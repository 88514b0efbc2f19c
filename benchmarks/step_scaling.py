"""How the slip distance and the relaxation time of velocity steps go with thickness, normal stress and velocity.

    lsm sweep data/velocity_step_scaling.toml --out out/scaling
    python -m benchmarks.step_scaling out/scaling

Prints D_c and D_c/(r V) of every layer and the exponents of power laws in thickness h, normal stress P and velocity V,
of the layers whose D_c is known, each by its error, beside those of Hatano (2009), arXiv:0906.3764: a
relaxation time that grows as h and falls as P^(-1/2), and a slip distance that grows as V.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm

NAMES = ("thickness h", "normal stress P", "velocity V")
EXPECTED = {"relaxation time": (1.0, -0.5, 0.0), "slip distance": (1.0, -0.5, 1.0)}


def power_law(conditions: NDArray, values: NDArray, errors: NDArray) -> tuple[NDArray, NDArray]:
    """(exponents (k,), standard errors (k,)) of values (n,) with errors (n,) ~ product of conditions (n, k) to them.

    Weighted least squares of the logarithms; the errors are widened where the values scatter more than theirs.
    """
    weight = values / errors
    x = np.column_stack([np.log(conditions), np.ones(len(values))]) * weight[:, None]
    y = np.log(values) * weight
    found, *_ = np.linalg.lstsq(x, y, rcond=None)
    scatter = float(((y - x @ found) ** 2).sum()) / (len(y) - x.shape[1])
    deviations = np.sqrt(np.diag(np.linalg.inv(x.T @ x)) * max(1.0, scatter))
    return found[:-1], deviations[:-1]


def main(folder: Path) -> None:
    """Print the table and the exponents of a sweep of velocity-steps."""
    table = lsm.open_run(folder / "sweep.nc")
    table = table.isel(run=(table.status == "complete").values)
    stress, number = table.target_normal_stress.values, table.target_inertial_number.values
    diameter = 0.5 * (table.smallest_diameter + table.largest_diameter).values
    inertial = diameter * np.sqrt(table.density.values / stress)
    thickness = table.target_thickness_in_diameters.values
    velocity = number * thickness * diameter / inertial
    distance = table.slip_distance.values
    relaxation = table.relaxation_time.values * inertial
    error = table.slip_distance_se.values / distance
    print("   h/d    P [MPa]        I     D_c/d    D_c/(r V t_i)     better law, share of the resampled stacks")
    for i in np.lexsort((number, stress, thickness)):
        times = f"{relaxation[i] / inertial[i]:8.3g}"
        known = (
            f"{times} +- {error[i] * relaxation[i] / inertial[i]:.2g}" if np.isfinite(error[i]) else f"{times} unknown"
        )
        print(
            f"{thickness[i]:6.3g} {1e-6 * stress[i]:9.3g} {number[i]:9.2g} {distance[i] / diameter[i]:9.3g} "
            f"{known:>20} {table.law_share.values[i]:12.2f}"
        )
    known = np.isfinite(error)
    conditions = np.column_stack([thickness, stress, velocity])[known]
    for name, values in (("relaxation time", relaxation[known]), ("slip distance", distance[known])):
        exponents, errors = power_law(conditions, values, error[known] * values)
        print(f"{name}, {len(values)} of {len(known)} layers:")
        for condition, value, deviation, expected in zip(NAMES, exponents, errors, EXPECTED[name], strict=True):
            print(f"  exponent of the {condition}: {value:.2f} +- {deviation:.2f}, Hatano (2009): {expected:g}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
