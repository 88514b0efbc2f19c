"""What does a sweep cost beside its runs? `python -m benchmarks.sweep_cost`, of which `--short` takes a minute.

Runs are those of an experiment that only sleeps for a moment. Time: sweeps of few and of more runs, one at a time,
whose difference is what a run takes in a sweep; compared with the same runs as single commands `lsm`. Memory: a sweep
of 1000 runs, each of which is made within its worker in place of a process, so that what is left is the planning, the
scheduler, the events and the files.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil

from benchmarks.ours import ROOT
from workflows.common.discovery import find_workflows
from workflows.common.metrics import Metric, write_summary
from workflows.sweep.plan import plan_of

MOMENT_S = 0.2
FEW, MORE = 2, 8  # runs of the two sweeps whose times are compared
OVERHEAD_S, MEMORY_BYTES, PLAN_S = 2.0, 1e9, 5.0  # bounds: per run, of the driver, of a plan
METRICS = 20  # of each run, as a sheared layer has
PLUGIN = f'''"""Sleeps for a moment."""

import time

from pydantic import Field

from benchmarks.sweep_cost import write_metrics
from workflows.common.parameters import Params as BaseParams
from workflows.common.run_cost import RunCost


class Params(BaseParams):
    """Of a moment."""

    load: float = Field(default=1.0, ge=0, description="what varies [1]")


def check(params):
    """Refuses nothing."""


def estimate(params):
    """A moment."""
    return RunCost(1.0, 1.0, 1e8)


def run(params, out, progress=None, existing="refuse"):
    """Sleep, and write metrics."""
    time.sleep({MOMENT_S})
    write_metrics(out, params.load)
'''


def write_metrics(out: Path | str, load: float) -> None:
    """The summary of a run."""
    write_summary(out, "moment", None, {f"metric_{i}": Metric(load + i, "1") for i in range(METRICS)}, quiet=True)


def stand_in(topic: str, label: str, experiment: str, config: str, out: str, limits: Any) -> Any:
    """In place of `carry_out_told`: a run without a process, which leaves the same files."""
    from distributed import get_worker

    from workflows.common.one_run import COMPLETED, Outcome

    get_worker().log_event(topic, label)
    write_metrics(out, float(label))
    return Outcome(COMPLETED, "", MOMENT_S)


def drive(file: str, out: str) -> None:
    """A sweep whose runs need no process; prints the greatest resident memory of this one [bytes]."""
    from workflows.cli.main import main
    from workflows.sweep import drive as sweep_drive

    sweep_drive.carry_out_told = stand_in
    code = main(["sweep", file, "--out", out, "-j", "2"])
    print(f"peak {1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}", flush=True)
    sys.exit(code)


def sweep_file(folder: Path, runs: int) -> Path:
    """A file of so many runs."""
    path = folder / f"{runs}.toml"
    loads = [float(i) for i in range(runs)]
    path.write_text(f'experiment = "moment"\n[sweep.grid]\nload = {loads}\n')
    return path


def plan_seconds(folder: Path, runs: int) -> float:
    """Processor time in which so many runs of a sheared layer are planned [s]."""
    path = folder / "plan.toml"
    values = f"{{from = 0.1, to = 0.9, count = {runs // 2}}}"
    text = f'experiment = "shear-gouge"\n[sweep.grid]\nshape = ["round", "angular"]\nfriction = {values}\n'
    path.write_text(text)
    found, began = find_workflows(), time.process_time()
    plan_of(path, found)
    return time.process_time() - began


def timed(words: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Wall-clock and processor time of a command and of what it starts [s]."""
    before, began = os.times(), time.perf_counter()
    subprocess.run([sys.executable, *words], cwd=ROOT, env=environment, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - began, cpu


def time_per_run(folder: Path, environment: dict[str, str]) -> dict[str, tuple[float, float]]:
    """Wall-clock and processor time of a run, in a sweep and alone [s]."""
    lsm, found = ["-m", "workflows.cli.main"], {}
    for runs in (1, FEW, MORE):  # the first one finds nothing in the caches of the disk
        file, out = sweep_file(folder, runs), folder / f"out{runs}"
        found[runs] = timed([*lsm, "sweep", str(file), "--out", str(out), "-j", "1", "--quiet"], environment)
    in_sweep = tuple((more - few) / (MORE - FEW) for few, more in zip(found[FEW], found[MORE], strict=True))
    words = [*lsm, "moment", "--config", str(folder / f"out{FEW}" / "points" / "1.toml"), "--quiet", "--out"]
    alone = [timed([*words, str(folder / f"alone{i}")], environment) for i in range(FEW)]
    wall, cpu = (sum(column) / FEW for column in zip(*alone, strict=True))
    return {"in a sweep": (in_sweep[0], in_sweep[1]), "alone": (wall, cpu)}


def memory_of(folder: Path, runs: int, environment: dict[str, str]) -> dict[str, float]:
    """Greatest resident memory of the driver and of the largest worker [bytes], and the time [s], of a sweep."""
    words = ["-m", "benchmarks.sweep_cost", "--drive", str(sweep_file(folder, runs)), str(folder / f"memory{runs}")]
    began, workers = time.perf_counter(), 0
    process = subprocess.Popen([sys.executable, *words], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    watched = psutil.Process(process.pid)
    lines: list[str] = []
    assert process.stdout is not None
    for line in process.stdout:  # one for each run that ends
        lines.append(line)
        if len(lines) % 20 == 0:
            workers = max([workers, *(one.memory_info().rss for one in watched.children())])
    if process.wait() != 0:
        raise SystemExit(f"the sweep failed: {''.join(lines[-20:])}")
    return {"driver": float(lines[-1].split()[1]), "worker": float(workers), "seconds": time.perf_counter() - began}


def main() -> int:
    """Measure and print a table; exit code 1 if a bound is not kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000, help="of the sweep whose memory is measured")
    parser.add_argument("--short", action="store_true", help="100 of them, and no times")
    parser.add_argument("--drive", nargs=2, metavar=("FILE", "OUT"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.drive:
        drive(*given.drive)
    runs, kept = 100 if given.short else given.runs, True
    with tempfile.TemporaryDirectory(prefix="lsm-sweep-cost-") as name:
        folder = Path(name)
        (folder / "workflows").mkdir()
        (folder / "workflows" / "moment.py").write_text(PLUGIN)
        environment = {**os.environ, "LSM_PLUGINS": name}
        print("| what | measured | bound |\n|---|---|---|", flush=True)
        planned = plan_seconds(folder, runs)
        kept &= planned <= PLAN_S
        print(f"| plan of {runs} runs of shear-gouge | {planned:.1f} s of a processor | {PLAN_S:g} s |", flush=True)
        memory = memory_of(folder, runs, environment)
        kept &= memory["driver"] <= MEMORY_BYTES
        print(f"| memory of the driver, {runs} runs | {memory['driver'] / 1e6:.0f} MB | {MEMORY_BYTES / 1e6:.0f} MB |")
        print(f"| memory of a worker | {memory['worker'] / 1e6:.0f} MB | |")
        print(f"| time of such a sweep | {memory['seconds']:.0f} s | |", flush=True)
        if not given.short:
            times = time_per_run(folder, environment)
            for place, (wall, cpu) in times.items():
                print(f"| a run {place} | {wall:.2f} s, {cpu:.2f} s of a processor | |")
            more = times["in a sweep"][0] - times["alone"][0]
            kept &= more <= OVERHEAD_S
            print(f"| more in a sweep | {more:.2f} s | {OVERHEAD_S:g} s |")
        print(f"\nload of the machine {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    return int(not kept)


if __name__ == "__main__":
    sys.exit(main())
