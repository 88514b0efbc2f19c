"""What a sheared layer costs, by the processor time of a few runs.

`python -m workflows.accuracy.prices` measures it anew. Every estimate of a layer (`workflows/gouge/layer_cost.py`), and
so every plan for a target error, rests on this table. Processor time is what an idle machine takes; it hardly depends
on what else the machine does.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.accuracy.commands import as_command
from workflows.accuracy.gouge import run_missing
from workflows.common.metrics import read_summary
from workflows.common.refusals import checked
from workflows.gouge.layer_cost import TABLE

KINDS = (("round", 2), ("angular", 2), ("round", 3), ("angular", 3))  # shape and dimension
SIZES = {  # in 2D between those of the presets, as small layers cost more per grain; in 3D of some hundreds of grains
    2: {"layer_thickness": 20.0, "length": 28.0},
    3: {"layer_thickness": 10.0, "length": 10.0, "width": 4.0},
}
# Strain and inertial number of a short run, of one that goes farther, and of a slow one with more steps for its strain.
RUNS = {
    2: {"short": (0.3, 2e-2), "far": (2.3, 2e-2), "slow": (0.3, 1e-3)},
    3: {"short": (0.3, 2e-2), "far": (1.3, 2e-2), "slow": (0.3, 4e-3)},
}
LAYER = {"steady_from": 0.1}


class Spent(NamedTuple):
    """Steps [1], shear strain [1] and processor time [s] of a run."""

    steps: float
    strain: float
    seconds: float


def cpu_seconds(folder: Path) -> float:
    """Processor time of the run in a folder [s]; nan if its summary has none."""
    summary = read_summary(folder) or {"metrics": {}}
    return float(summary["metrics"].get("cpu_seconds", {}).get("value", float("nan")))


def price(runs: Sequence[Spent], first: Spent, grains: int) -> dict[str, float]:
    """Price of a layer, from three runs that find their kernels on disk and a first one that compiles them.

    A run takes start + grains (grain_step steps + grain_strain strain): neighbour lists are rebuilt and samples are
    taken as the layer shears, however many steps that takes.

    Returns
    -------
    dict
        `grain_step_seconds` per grain and step [s], `grain_strain_seconds` per grain and unit of strain [s],
        `start_seconds` [s] of the first run: packing, compiling, pictures.
    """
    rows = [(grains * run.steps, grains * run.strain, 1.0) for run in runs]
    per_step, per_strain, _ = np.linalg.solve(np.array(rows), np.array([run.seconds for run in runs]))
    start = first.seconds - grains * (per_step * first.steps + per_strain * first.strain)
    return {
        "start_seconds": float(start),
        "grain_step_seconds": float(per_step),
        "grain_strain_seconds": float(per_strain),
    }


def measure(shape: str, dim: int, out: Path) -> dict[str, float]:
    """The price of a layer of these grains; the kernels must not have been compiled before."""
    runs = {
        name: checked(
            shear_gouge.Params, **LAYER, **SIZES[dim], shape=shape, dim=dim, strain=strain, inertial_number=inertial
        )
        for name, (strain, inertial) in RUNS[dim].items()
    }
    named = {"first": runs["short"], **runs}
    jobs = [(f"{shape}-{dim}-{n}", shear_gouge.__name__, p, out / f"{shape}-{dim}-{n}") for n, p in named.items()]
    spent, grains = [], 0
    for folder in run_missing(jobs, 1):
        run = lsm.open_run(folder / "run.nc")
        spent.append(Spent(float(run.time[-1]) / run.dt, float(run.shear_strain[-1]), cpu_seconds(folder)))
        grains = int((lsm.open_run(folder / "grains.nc").kind.values == 0).sum())
    return price(spent[1:], spent[0], grains)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure all rows of the table and write them; prints the prices."""
    parser = argparse.ArgumentParser(
        prog="python -m workflows.accuracy.prices",
        description="Measures what sheared layers cost, round and angular in 2D and 3D, in about ten minutes, and "
        f"writes it to {TABLE}, from which the times of runs and plans for target errors are foreseen.",
    )
    parser.add_argument(
        "--to", type=Path, default=lsm.data_path(TABLE), metavar="FILE", help="file to write; default: %(default)s"
    )
    path = parser.parse_args(argv).to
    if not os.access(path.parent, os.W_OK):
        raise lsm.InputError(f"--to {path}: cannot be written, must be a file in a folder that can be written to")
    rows = []
    with tempfile.TemporaryDirectory(prefix="lsm-") as out:
        os.environ["TI_OFFLINE_CACHE_FILE_PATH"] = str(Path(out) / "kernels")  # empty: first runs compile
        for shape, dim in KINDS:
            found = {name: float(f"{value:.3g}") for name, value in measure(shape, dim, Path(out)).items()}
            rows.append({"shape": shape, "dim": dim, **found})
            print(", ".join(f"{name} {value}" for name, value in rows[-1].items()), flush=True)
    table = {"made_by": "python -m workflows.accuracy.prices", "rows": rows}
    path.write_text(json.dumps(table, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    as_command(main)
