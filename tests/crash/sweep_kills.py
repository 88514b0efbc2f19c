"""A sweep goes on whatever is killed: `python -m tests.crash.sweep_kills`.

A sweep of 24 small runs, one of which must fail, is made twice: on workers of its own, of which one is killed in its
midst; and on the scheduler and the workers that docs/sweeps.md starts, of which a worker is killed, and the scheduler
is stopped, which ends its workers, and all are started again. All other runs must be complete, without a trace of what
happened, and those that were under way equal the same run made alone, bit for bit. Prints a table; the exit code is 1
if anything was wrong.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil

import taichi_lsm as lsm
from tests.crash.random_kills import command, differences
from workflows.common.metrics import read_summary
from workflows.common.run_folder import is_complete

PAGE = Path(__file__).resolve().parents[2] / "docs" / "sweeps.md"
SMALL = {"layer_thickness": 8, "length": 8, "inertial_number": 0.01, "steady_from": 0.1, "checkpoint_seconds": 0.3}
GRAVITY = '{name = "gravity", acceleration = [0.0, -1e10]}'  # presses grains through each other: a guard ends the run
FILES = {"config.toml", "run.nc", "grains.nc", "run.png", "summary.json"}
TIMES = {"seconds", "cpu_seconds", "grain_steps_per_second"}  # metrics that tell of the machine
PATIENCE_S = 3600.0


def sweep_file(path: Path, runs: int, strain: float) -> Path:
    """A sweep of so many runs with seeds of their own, the last of which must fail."""
    columns = {
        "seed": list(range(1, runs + 1)),
        "friction": [round(0.1 + 0.02 * i, 2) for i in range(runs)],
    }
    lines = ['experiment = "shear-gouge"', *(f"{name} = {value}" for name, value in SMALL.items())]
    lines += [f"strain = {strain}", "[sweep.together]", *(f"{name} = {values}" for name, values in columns.items())]
    lines += [f"effects = [{', '.join(['[]'] * (runs - 1) + [f'[{GRAVITY}]'])}]"]
    path.write_text("\n".join(lines) + "\n")
    return path


def complete_in(out: Path) -> list[str]:
    """Labels of the runs that are complete."""
    return sorted(folder.name for folder in (out / "runs").glob("*") if is_complete(folder))


def under_way(out: Path) -> list[str]:
    """Labels of the runs to which a process writes."""
    return sorted(folder.name for folder in (out / "runs").glob("*") if lsm.holder_of(folder))


def wait_for(condition: Callable[[], bool], what: str, process: subprocess.Popen) -> None:
    """Wait until a condition holds; RuntimeError if it does not, or the process ends before."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if process.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"{what}: waited in vain, exit code {process.poll()}")
        time.sleep(0.2)


def kill_a_worker(above: subprocess.Popen) -> None:
    """SIGKILL to a worker below a process that carries out a run, which a process of its own is."""
    busy = [one for one in psutil.Process(above.pid).children() if one.children()]
    busy[0].send_signal(signal.SIGKILL)


class OnWorkersOfItsOwn:
    """A sweep on this machine, of which a worker is killed."""

    name = "workers of its own"

    def options(self) -> list[str]:
        """Of `lsm sweep`."""
        return ["-j", "2"]

    def disturb(self, sweep: subprocess.Popen, out: Path, runs: int) -> list[str]:
        """Kill a worker after a third of the runs; labels of those that were under way."""
        wait_for(lambda: len(complete_in(out)) >= runs // 3 and len(under_way(out)) > 1, "a third of the runs", sweep)
        labels = under_way(out)
        kill_a_worker(sweep)
        return labels

    def close(self) -> None:
        """Nothing is left."""


class OnAScheduler:
    """A sweep on a scheduler and workers as the page starts them: a worker is killed, the scheduler is restarted."""

    name = "scheduler and workers"

    def __init__(self, log: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        lines = re.findall(r"^    (dask (?:scheduler|worker) .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
        self.lines = [shlex.split(line.replace("8786", str(port))) for line in lines]
        self.log = open(log, "wb")  # noqa: SIM115  closed in `close`
        self.address = self.lines[1][2]
        self.scheduler, self.workers = self.started(self.lines[0]), self.started(self.lines[1])

    def started(self, words: list[str]) -> subprocess.Popen:
        """A process of the page, with the `dask` of this environment."""
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        here = {"PATH": path, "PYTHONPATH": str(PAGE.parents[1])}  # this version, be it installed or not
        return subprocess.Popen(words, stdout=self.log, stderr=self.log, env={**os.environ, **here})

    def options(self) -> list[str]:
        """Of `lsm sweep`."""
        return ["--scheduler", self.address]

    def disturb(self, sweep: subprocess.Popen, out: Path, runs: int) -> list[str]:
        """Kill a worker after a quarter of the runs, restart the scheduler after a half; labels as above."""
        wait_for(lambda: len(complete_in(out)) >= runs // 4 and len(under_way(out)) > 1, "a quarter of the runs", sweep)
        labels = under_way(out)
        kill_a_worker(self.workers)
        wait_for(lambda: len(complete_in(out)) >= runs // 2 and len(under_way(out)) > 1, "half of the runs", sweep)
        labels += under_way(out)
        self.scheduler.terminate()
        self.scheduler.wait()
        self.workers.wait(PATIENCE_S)  # a scheduler that is stopped ends its workers
        self.scheduler, self.workers = self.started(self.lines[0]), self.started(self.lines[1])
        return labels

    def close(self) -> None:
        """End the workers and the scheduler."""
        for process in (self.workers, self.scheduler):
            process.terminate()
            process.wait(60)
        self.log.close()


def problems_of(out: Path, runs: int, code: int) -> list[str]:
    """What is wrong with the files of a sweep that has come to its end."""
    problems = [f"exit code {code}"] * (code != 0)
    table = lsm.open_run(out / "sweep.nc")
    status, note = table.status.values.tolist(), table.note.values.tolist()
    if status != ["complete"] * (runs - 1) + ["failed"]:
        problems.append(f"status {status}, notes {[text for text in note if text]}")
    if not note[-1] or any(note[:-1]) or not np.isnan(table.friction_mean.values[-1]):
        problems.append(f"the run that fails: friction {table.friction_mean.values[-1]}, notes {note}")
    if not np.isfinite(table.friction_mean.values[:-1]).all():
        problems.append("a complete run has no friction")
    for label in complete_in(out):
        names = {path.name for path in (out / "runs" / label).iterdir()} - {".lock"}
        problems += [f"run {label} left {sorted(names ^ FILES)}"] * (names != FILES)
    return problems


def unequal_alone(out: Path, label: str, folder: Path) -> list[str]:
    """How a run differs from the same run made alone in `folder`."""
    words = command("shear-gouge", "--config", str(out / "points" / f"{label}.toml"), "--out", str(folder))
    subprocess.run(words, check=True, capture_output=True)
    one, other = (read_summary(path) or {"metrics": {}} for path in (out / "runs" / label, folder))
    names = (one["metrics"].keys() | other["metrics"].keys()) - TIMES
    different = [name for name in sorted(names) if one["metrics"].get(name) != other["metrics"].get(name)]
    different += differences(out / "runs" / label, folder)
    return [f"run {label} alone differs in {', '.join(different)}"] if different else []


def disturbed(mode: OnWorkersOfItsOwn | OnAScheduler, root: Path, runs: int, strain: float, alone: int) -> list[str]:
    """Make a sweep, disturb it, and tell what is wrong with it; prints a row of the table."""
    out, began = root / "out", time.monotonic()
    words = command("sweep", str(sweep_file(root / "sweep.toml", runs, strain)), "--out", str(out), *mode.options())
    words.remove("--quiet")
    with open(root / "sweep.log", "wb") as log:
        sweep = subprocess.Popen(words, stdout=log, stderr=log)
        try:
            labels = mode.disturb(sweep, out, runs)
            code = sweep.wait(PATIENCE_S)
        except RuntimeError as error:
            return [f"{error}\n{(root / 'sweep.log').read_text(errors='replace')}"]
        finally:
            if sweep.poll() is None:
                sweep.terminate()
                sweep.wait()
            mode.close()
    seconds, said = time.monotonic() - began, (root / "sweep.log").read_text(errors="replace")
    problems = problems_of(out, runs, code)
    chosen = list(dict.fromkeys([*labels, "01".zfill(len(str(runs)))]))[:alone]
    for label in chosen:
        problems += unequal_alone(out, label, root / f"alone-{label}")
    note = lsm.open_run(out / "sweep.nc").note.values[-1]
    again, lost = said.count("begun again"), said.count("is lost")
    row = (mode.name, runs, len(complete_in(out)), again, lost, ", ".join(chosen), f"{seconds:.0f} s", len(problems))
    print(f"| {' | '.join(map(str, row))} |", flush=True)
    print(f"run {runs} failed: {note}", flush=True)
    return problems + [said] * (len(problems) > 0)


def main() -> int:
    """Make both sweeps and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=24, help="of each sweep")
    parser.add_argument("--strain", type=float, default=0.4, help="of each run")
    parser.add_argument("--alone", type=int, default=3, help="runs of each sweep that are repeated alone")
    parser.add_argument("--modes", nargs="*", default=["local", "scheduler"], choices=["local", "scheduler"])
    given = parser.parse_args()
    titles = ("sweep on", "runs", "complete", "begun again", "scheduler lost", "equal alone", "time", "problems")
    print(f"| {' | '.join(titles)} |", "|---" * len(titles) + "|", sep="\n", flush=True)
    failed = False
    for name in given.modes:
        with tempfile.TemporaryDirectory(prefix="lsm-sweep-") as root:
            mode = OnWorkersOfItsOwn() if name == "local" else OnAScheduler(Path(root) / "dask.log")
            problems = disturbed(mode, Path(root), given.runs, given.strain, given.alone)
            print(*problems, sep="\n", flush=True)
            failed |= len(problems) > 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
