"""What a sheared layer costs, by the processor time of two runs of different strain.

`python -m workflows.accuracy.prices` measures it anew and writes it to the table from which target errors are planned.
Processor time is what an idle machine with warm kernels takes; it hardly depends on what else the machine does.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.accuracy.gouge import LAYER, run_missing
from workflows.common.metrics import read_summary
from workflows.common.refusals import checked
from workflows.gouge.target_error import TABLE

SIZE = {"layer_thickness": 20.0, "length": 28.0}  # between those of the presets: small layers cost more per grain
STRAINS = (1.5, 4.5)  # of the two runs


def cpu_seconds(folder: Path) -> float:
    """Processor time of the run in a folder [s]; nan if its summary has none."""
    summary = read_summary(folder) or {"metrics": {}}
    return float(summary["metrics"].get("cpu_seconds", {}).get("value", float("nan")))


def price(short: tuple[float, float], long: tuple[float, float], grains: int) -> dict[str, float]:
    """Start and shear of a layer, from (strain [1], processor time [s]) of a short and of a long run.

    Returns
    -------
    dict
        `seconds_per_grain_strain` [s] and `start_seconds` [s]: importing, packing, compiling, consolidation, pictures.
    """
    per_strain = (long[1] - short[1]) / (long[0] - short[0])
    return {"seconds_per_grain_strain": per_strain / grains, "start_seconds": short[1] - per_strain * short[0]}


def measure(shape: str, out: Path) -> dict[str, float]:
    """The price of a layer of these grains, at the inertial and stiffness number of the table."""
    runs = [checked(shear_gouge.Params, **LAYER | SIZE | {"shape": shape, "strain": strain}) for strain in STRAINS]
    jobs = [(f"{shape}-price-{p.strain:g}", shear_gouge.__name__, p, out / f"{shape}-price-{p.strain:g}") for p in runs]
    run_missing(
        [(f"{shape}-warm", shear_gouge.__name__, runs[0], out / f"{shape}-warm")], 1
    )  # stores the kernels on disk
    short, long = run_missing(jobs, 1)
    grains = int((lsm.open_run(short / "grains.nc").kind.values == 0).sum())
    return price((STRAINS[0], cpu_seconds(short)), (STRAINS[1], cpu_seconds(long)), grains)


def main() -> None:
    """Measure all rows of the table and write them; prints the prices."""
    path = lsm.data_path(TABLE)
    table: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix="lsm-") as out:
        for row in table["rows"]:
            row |= measure(row["shape"], Path(out))
            print(f"{row['shape']}: {row['start_seconds']:.3g} s, {row['seconds_per_grain_strain']:.3g} s per grain")
    path.write_text(json.dumps(table, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
