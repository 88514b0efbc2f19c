"""Files sweep.nc of sweeps that nobody has made: friction from a formula, for tests of what is read and drawn."""

import itertools
import json
import math

import numpy as np

import taichi_lsm as lsm
from tests.helpers.output_files import attributes

ERROR, SAMPLES = 0.01, 30.0  # of each run


def friction_of(row):
    """Friction that grows with that of the grains and falls with the inertial number; 0.1 more for angular grains."""
    angular = 0.1 * (row.get("shape") == "angular")
    rate = 0.02 * math.log10(row.get("target_inertial_number", 1e-3) / 1e-3)
    return 0.2 + 0.2 * row.get("particle_friction", 0.5) + angular - rate + 0.005 * (row.get("seed", 2) - 2)


def write_sweep_table(folder, factors, log=(), failed=(), unknown=(), error=True):
    """Write `folder`/sweep.nc.

    factors: (dim, [{name: value}]) each, the last varies fastest; log: names that were spaced by a factor; failed,
    unknown: rows that failed, and whose errors are nan; error: whether runs have errors at all.
    """
    rows = [
        {name: value for point in points for name, value in point.items()}
        for points in itertools.product(*(points for _, points in factors))
    ]
    count = len(rows)
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    texts = {name: name for name, values in columns.items() if isinstance(values[0], str)}
    numbers = [
        lsm.Variable(name, ("run",), "i32" if name == "seed" else "f64", "1", name)
        for name in columns
        if name not in texts
    ]
    given = [np.nan if i in failed else friction_of(row) for i, row in enumerate(rows)]
    metrics = {"seconds": [10.0] * count, "friction_mean": given}
    if error:
        metrics["friction_se"] = [np.nan if i in {*failed, *unknown} else ERROR for i in range(count)]
        metrics["friction_ess"] = [np.nan if i in {*failed, *unknown} else SAMPLES for i in range(count)]
    status = ["failed" if i in failed else "complete" for i in range(count)]
    named = [
        {"dim": dim, "names": list(points[0]), "size": len(points), "log": [n for n in points[0] if n in log]}
        for dim, points in factors
    ]
    lsm.write_table(
        folder / "sweep.nc",
        columns | metrics | {"status": status},
        [*numbers, *(lsm.Variable(name, ("run",), "f64", "1", name) for name in metrics)],
        attributes() | {"factors": json.dumps(named)},
        tuple(columns),
        texts | {"status": "how the run ended"},
    )


def grid(name, *values):
    """A factor of one parameter."""
    return name, [{name: value} for value in values]
