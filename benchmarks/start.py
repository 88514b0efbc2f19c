"""How long until the first step? `python -m benchmarks.start`.

Seconds from the start of a Python process to the end of the first step of the shear experiment (`lsm shear-gouge`, the
sizes of its preset smoke), measured from outside: imports, making the scene, compiling, one step. Cold: Taichi's cache
of compiled kernels is an empty folder. Warm: the same folder, filled by the cold start. The user's own cache is not
touched: Taichi reads the folder from TI_OFFLINE_CACHE_FILE_PATH. The processor time of the process is given too, since
the wall clock also depends on the other programs of a busy machine.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import bounds, page
from benchmarks.ours import ROOT

FLAT, SOLID = ("2 sphere", "2 angular"), ("3 sphere", "3 angular")  # dimension and shape, as in `lsm shear-gouge`
BOUNDS = {"cold": 8.0, "warm": 2.0}  # s
CLAIMED = "2 sphere"  # the scene of `lsm shear-gouge` without options
FIRST_STEP = """
import sys, time
import taichi_lsm as lsm
from workflows import shear_gouge
params = shear_gouge.Params(dim=int(sys.argv[1]), shape=sys.argv[2], **shear_gouge.Params.presets["smoke"])
lsm.Simulation(shear_gouge.build(params)).run(1)
print("stepped", time.process_time(), flush=True)
"""


def seconds_to_first_step(scene: str, cache: str | Path) -> tuple[float, float]:
    """Time from the start of a fresh process to the end of its first step.

    Parameters
    ----------
    scene : str
        Dimension and shape, as in FLAT and SOLID.
    cache : path
        Folder of Taichi's compiled kernels.

    Returns
    -------
    tuple of float
        Seconds on the wall clock, seconds on the processor.

    Raises
    ------
    RuntimeError
        If the process did not make its first step.
    """
    command = [sys.executable, "-c", FIRST_STEP, *scene.split()]
    environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": str(cache)}
    began = time.perf_counter()
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None  # a pipe
        printed = process.stdout.readline()
        taken = time.perf_counter() - began
    word, *rest = printed.split() or [""]
    if word != "stepped" or process.returncode:  # the process has ended by now, which has written its cache
        raise RuntimeError(f"start of {scene}: ended with code {process.returncode} after {printed!r}")
    return taken, float(rest[0])


def measure(scenes: Sequence[str], turns: int) -> tuple[dict[str, dict[str, Any]], str]:
    """Metrics with their bounds, and a table: medians of `turns` cold starts, each followed by a warm one."""
    taken: dict[tuple[str, str], list] = {(scene, kind): [] for scene in scenes for kind in BOUNDS}
    for _ in range(turns):
        for scene in scenes:
            with tempfile.TemporaryDirectory() as cache:
                for kind in BOUNDS:
                    taken[scene, kind].append(seconds_to_first_step(scene, cache))
    metrics, rows = {}, []
    for (scene, kind), times in taken.items():
        wall, processor = (median(column) for column in zip(*times))
        name = f"start_{kind}_{scene.replace(' ', 'd_')}"
        metric = bounds.metric(wall, "s", BOUNDS[kind]) if scene == CLAIMED else {"value": wall, "unit": "s"}
        metrics[name] = metric | {"processor": processor}
        rows.append(page.row(name, f"{wall:.2f}", f"{processor:.2f}", metric.get("bound", ""), metric.get("holds", "")))
    return metrics, "\n".join([*page.head("start", "seconds", "on the processor", "at most", "holds"), *rows])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=3, help="cold starts of each scene; medians are printed")
    parser.add_argument("--full", action="store_true", help="in 3D too")
    args = parser.parse_args()
    print(measure(FLAT + SOLID if args.full else FLAT, args.turns)[1])


if __name__ == "__main__":
    main()
