"""SIGKILL at random instants: `make validate-crash`, or `python -m tests.crash.random_kills --kills 200`.

Short runs of every kind of state are killed at random, resumed, killed again, until they are complete. After every kill
all files must open, and have at least the rows of the last checkpoint; the complete run must equal one that was never
killed, bit for bit in every variable of every file. Prints a table; the exit code is 1 if anything differed.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import netCDF4
import numpy as np

import taichi_lsm as lsm

SMALL = ["--layer-thickness", "8", "--length", "8", "--inertial-number", "0.01", "--checkpoint-seconds", "0.3"]
SMALL += ["--steady-from", "0.1"]
CASES = {
    "2D discs": ["--strain", "3"],
    "2D angular": ["--shape", "angular", "--strain", "1.5"],
    "2D with contacts": ["--strain", "2", "--contacts", "every=0.02,stages", "--snapshots", "every=0.02"],
    "2D bonded": ["--shape", "angular", "--breakable", "--pieces", "3", "--bond-strength", "2", "--strain", "0.4"],
    "2D on a spring": ["--load-stiffness-ratio", "0.1", "--strain", "3"],
    "3D spheres": ["--dim", "3", "--width", "4", "--strain", "0.6"],
}
FILES = ("run.nc", "grains.nc", "contacts.nc")
COUNTED = {"run.nc": "rows", "grains.nc": "snapshots", "contacts.nc": "moments"}  # names in a checkpoint


@dataclass
class Count:
    """What happened to the runs of one case."""

    kills: int = 0
    runs: int = 0
    never_killed_s: float = math.inf  # time of the last run that came to its end before it was killed [s]
    lost_most: float = 0.0  # greatest time of a process, with its start, that a kill took back [s]
    problems: list[str] = field(default_factory=list)


def command(*words: str) -> list[str]:
    """The command line of `lsm` in this environment."""
    return [sys.executable, "-m", "workflows.cli.main", *words, "--quiet"]


def contents(path: Path) -> dict[str, bytes]:
    """Bytes of every variable of a file, none of one that is not there."""
    found = {}
    if not path.exists():
        return found
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        for name, variable in file.variables.items():
            values = np.asarray(variable[:])
            found[name] = repr(values.tolist()).encode() if values.dtype == object else values.tobytes()
    return found


def differences(folder: Path, reference: Path) -> list[str]:
    """Variables of the files of two runs that are not equal."""
    different = []
    for name in FILES:
        mine, theirs = contents(folder / name), contents(reference / name)
        different += [f"{name}:{v}" for v in sorted(mine.keys() | theirs.keys()) if mine.get(v) != theirs.get(v)]
    return [name for name in different if not name.endswith(".nc:run")]  # the name of the folder


def check_files(folder: Path) -> tuple[list[str], float]:
    """(what is wrong with the files that a kill left, when the last checkpoint was written or 0 [s])."""
    problems, rows = [], dict.fromkeys(FILES, 0)
    for name in FILES:
        if (folder / name).exists():
            try:
                rows[name] = int(np.isfinite(lsm.open_run(folder / name).time).sum())
            except lsm.InputError as error:
                problems.append(str(error))
    for path in folder.glob("checkpoint*.nc"):
        try:
            with netCDF4.Dataset(path) as file:
                state = json.loads(file.run_state)
        except OSError as error:
            problems.append(f"{path}: {error}")
            continue
        if any(rows[name] < state[counted] for name, counted in COUNTED.items()):
            problems.append(f"{path}: counts {[state[name] for name in COUNTED.values()]}, the files have {rows}")
    last = folder / "checkpoint.nc"
    return problems, last.stat().st_mtime if last.exists() else 0.0


def check_complete(folder: Path, reference: Path) -> list[str]:
    """What is wrong with a run that has come to its end."""
    different = differences(folder, reference)
    problems = [f"{folder}: differs in {', '.join(different)}"] if different else []
    return problems + [f"{path}: was left" for path in folder.glob("*checkpoint*")]


def run_until_complete(
    begin: list[str], folder: Path, reference: Path, count: Count, after: Callable[[], float]
) -> None:
    """Begin a run, kill it, resume it, until it is complete or a problem is found; `after` draws the times [s]."""
    words, found, patience = begin, len(count.problems), 1.0
    while len(count.problems) == found:
        began = time.time()
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        try:
            _, errors = process.communicate(timeout=patience * after())
        except subprocess.TimeoutExpired:
            process.kill()
            killed_at = time.time()
            process.communicate()
            problems, kept_at = check_files(folder)
            lost = killed_at - max(kept_at, began)  # of what this process has done
            count.kills, count.lost_most = count.kills + 1, max(count.lost_most, lost)
            count.problems += problems
            # On a machine that has become busier a process may never come to its first checkpoint.
            patience = 1.0 if kept_at > began else 1.3 * patience
            words = command("resume", str(folder)) if (folder / "config.toml").exists() else begin
            continue
        ended = process.returncode == 0
        count.problems += check_complete(folder, reference) if ended else [f"exit code {process.returncode}: {errors}"]
        if words is begin:
            count.never_killed_s = time.time() - began
        return


def run_case(name: str, options: list[str], kills: int, root: Path, rng: random.Random) -> Count:
    """Kill runs of one case so many times."""
    count, took, reference = Count(), 0.0, root / f"{name}-reference"
    for folder in (root / f"{name}-compiles", reference):  # the second finds its kernels on the disk, as all others do
        began = time.monotonic()
        subprocess.run(command("shear-gouge", *SMALL, *options, "--out", str(folder)), check=True, capture_output=True)
        took = time.monotonic() - began
    while count.kills < kills:
        took = min(took, count.never_killed_s)  # on a machine that has become idle
        folder = root / f"{name}-{count.runs}"
        begin = command("shear-gouge", *SMALL, *options, "--out", str(folder))
        run_until_complete(begin, folder, reference, count, lambda took=took: rng.uniform(0.3, 0.8) * took)
        count.runs += 1
    return count


def main() -> int:
    """Kill runs of all cases and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200, help="number of kills, of all cases together")
    parser.add_argument("--seed", type=int, default=1, help="seed of the instants")
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES), help="kinds of runs")
    given = parser.parse_args()
    rng, failed = random.Random(given.seed), False
    print("| runs of | kills | complete runs | longest loss | problems |\n|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory(prefix="lsm-crash-") as root:
        for name in given.cases:
            count = run_case(name, CASES[name], -(-given.kills // len(given.cases)), Path(root), rng)
            row = (name, count.kills, count.runs, f"{count.lost_most:.1f} s", len(count.problems))
            print(f"| {' | '.join(map(str, row))} |", *count.problems, sep="\n", flush=True)
            failed |= len(count.problems) > 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
