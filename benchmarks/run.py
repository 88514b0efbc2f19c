"""Time per grain and step, ours beside LAMMPS: `python -m benchmarks.run [--quick]`.

Every turn times LAMMPS and each of our configurations one after the other, over the same steps of the same
scene, so that a busy machine slows all of them. Only numbers of one run may be compared. Medians over the turns are
printed, and written to benchmarks/results.json. Without LAMMPS our code is timed alone, and the table says so.
"""

import argparse
import json
import os
import subprocess
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import clumps, lammps, lammps_clumps, page, scenes
from benchmarks.ours import Worker

RESULTS = Path(__file__).parent / "results.json"
TAGS = (*scenes.TAGS, *clumps.TAGS)
WARM_UP = 200  # steps before the first turn
GRAIN_STEPS = {"S": 4e6, "P": 1e6}  # per timed turn; a clump takes LAMMPS ten times as long as a sphere
# Relative differences between the two codes after the warm-up. Later the motions diverge, as in any chaotic system.
MARGINS = {
    "S": {"contacts_per_grain": 0.03, "pressure": 0.01, "translational_energy": 0.05},
    "P": {"normal_stress": 0.1, "mass": 1e-9},  # the grains differ: equal load is what is required
}
BOUNDS = {  # of the ratio, where one is claimed
    "S2_1000_f64_1t": 1.0,
    "S2_10000_f64_1t": 0.75,
    "S2_10000_f64_2t": 0.95,
    "S3_1000_f64_1t": 1.0,
    "S3_10000_f64_1t": 0.75,
    "S3_10000_f64_2t": 0.85,
    "P8_500_f64_1t": 1.0,
    "P30_500_f64_1t": 0.25,
}


def steps_of(state: scenes.State | clumps.Clumps) -> int:
    """Steps per timed turn."""
    return int(GRAIN_STEPS[state.tag[0]] / len(state.x))


def peer_of(tag: str) -> tuple[Any, Callable[..., dict[str, float]]]:
    """Stored state of a tag, and the function that runs LAMMPS from it."""
    if tag in clumps.TAGS:
        return clumps.load(tag), lammps_clumps.run
    return scenes.load(tag), lammps.run


def measure_scene(tag: str, threads: int, precisions: Sequence[str], turns: int) -> dict[str, dict[str, Any]]:
    """Time one scene in both codes.

    Parameters
    ----------
    tag : str
        One of TAGS or of the larger scenes.
    threads : int
        Threads of our code, and processes of LAMMPS.
    precisions : sequence of str
        "f64", "f32" or both.
    turns : int
        Timed turns.

    Returns
    -------
    dict
        Rows of the results by name; without LAMMPS they hold only our times.
    """
    state, peer = peer_of(tag)
    peer = peer if lammps.find() else None
    steps, grains = steps_of(state), len(state.x)
    choices = [(p, extras) for p in precisions for extras in (False, True)]
    ours: dict[tuple[str, bool], list] = {choice: [] for choice in choices}
    theirs: list[dict[str, float]] = []
    early: dict[str, float] = {}
    with ExitStack() as stack:
        workers = {c: stack.enter_context(Worker(tag, c[0], threads, c[1])) for c in choices}
        if peer:
            early = peer(state, threads, 0, WARM_UP)
        for worker in workers.values():
            worker.ask(f"run {WARM_UP}")
        metrics = {c: worker.ask("measure") for c, worker in workers.items()}
        for turn in range(turns):
            if peer:
                theirs.append(peer(state, threads, WARM_UP + turn * steps, steps))
            for choice, worker in workers.items():
                ours[choice].append(worker.ask(f"run {steps}"))
        late = {c: worker.ask("measure") for c, worker in workers.items()}
    size = {"grains": grains, "steps": steps, "turns": turns}
    clocks = ("seconds", "cpu_seconds") if threads == 1 else ("seconds",)
    rows: dict[str, dict[str, Any]] = {}
    for p in precisions:
        name = f"{tag}_{p}_{threads}t"
        entry: dict[str, Any] = {"ours": metrics[p, False], "ours_end": late[p, False]} | size
        if peer:
            entry |= agreement(metrics[p, False], early, MARGINS[tag[0]]) | {"lammps_end": _without_clocks(theirs[-1])}
        for clock in clocks:
            mine, extras, other = (
                [turn[clock] * 1e9 / (steps * grains) for turn in turns_of]
                for turns_of in (ours[p, False], ours[p, True], theirs)
            )
            entry |= times(mine, extras, other, "" if clock == "seconds" else "cpu_")
        if name in BOUNDS and peer:
            entry |= {"bound": BOUNDS[name], "holds": entry["ratio"] <= BOUNDS[name] and entry["agree"]}
        rows[name] = entry
    return rows


def _without_clocks(turn: dict[str, float]) -> dict[str, float]:
    """Metrics that LAMMPS printed, without its clocks."""
    return {name: value for name, value in turn.items() if not name.endswith("seconds")}


def times(
    ours: Sequence[float], with_extras: Sequence[float], theirs: Sequence[float], clock: str = ""
) -> dict[str, Any]:
    """Medians, minima and ratios ours / LAMMPS of times.

    Parameters
    ----------
    ours, with_extras : sequence of float
        Our times without and with extras [ns per grain and step], one per turn.
    theirs : sequence of float
        Those of LAMMPS; if it is empty, only our times are returned.
    clock : str
        "" for the wall clock, "cpu_" for processor time, which other programs on the machine hardly change.
    """
    mine = {
        f"ours_{clock}ns": median(ours),
        f"ours_extras_{clock}ns": median(with_extras),
        f"ours_{clock}ns_min": min(ours),
    }
    if not theirs:
        return mine
    return mine | {
        f"lammps_{clock}ns": median(theirs),
        f"{clock}ratio": median(ours) / median(theirs),
        f"{clock}ratio_extras": median(with_extras) / median(theirs),
        f"lammps_{clock}ns_min": min(theirs),
        f"{clock}ratio_min": min(ours) / min(theirs),
        f"{clock}ratio_turns": [a / b for a, b in zip(ours, theirs)],
    }


def agreement(metrics: dict[str, float], other: dict[str, float], margins: dict[str, float]) -> dict[str, Any]:
    """Metrics of both codes at one step, and whether they agree within the relative margins."""
    return {
        "ours": metrics,
        "lammps": _without_clocks(other),
        "agree": all(abs(metrics[name] / other[name] - 1.0) < margin for name, margin in margins.items()),
    }


def table(results: dict[str, dict[str, Any]]) -> str:
    """Markdown table of the results; a row without LAMMPS has dashes."""
    lines = [
        "| scene | ours | LAMMPS | ratio | of minima | with extras | processor | contacts | pressure | bound |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, r in results.items():
        both = "lammps_ns" in r
        load = "normal_stress" if "normal_stress" in r["ours"] else "pressure"
        contacts, pressure = f"{r['ours_end']['contacts_per_grain']:.2f}", f"{r['ours'][load]:.4g}"
        peer = ["-"] * 5
        if both:
            contacts += f" / {r['lammps_end']['contacts_per_grain']:.2f}"
            pressure += f" / {r['lammps'][load]:.4g}{'' if r['agree'] else ' (!)'}"
            peer = [f"{r['lammps_ns']:.0f}", f"{r['ratio']:.2f}", f"{r['ratio_min']:.2f}", f"{r['ratio_extras']:.2f}"]
            peer.append(f"{r['cpu_ratio']:.2f}" if "cpu_ratio" in r else "-")
        bound = f"{r['bound']:g} {'holds' if r['holds'] else 'FAILS'}" if "bound" in r else ""
        lines.append(page.row(name, f"{r['ours_ns']:.0f}", *peer, contacts, pressure, bound))
    return "\n".join(lines)


def find_lammps(install: bool) -> bool:
    """Whether LAMMPS is installed; prints how to install it if it is not.

    A failed installation is printed and not raised, since our own times need no LAMMPS.

    Parameters
    ----------
    install : bool
        Install the Debian package first if LAMMPS is missing (as root).
    """
    if lammps.find() is None and install:
        try:
            lammps.install()
        except (SystemExit, OSError, subprocess.SubprocessError) as error:
            print(f"LAMMPS could not be installed: {error}", flush=True)
    if lammps.find() is None:
        print(f"{lammps.HOW_TO_INSTALL}\nOurs is timed alone.", flush=True)
    return lammps.find() is not None


def save(results: dict[str, dict[str, Any]]) -> None:
    """Write benchmarks/results.json."""
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="ascii")


def threads_here() -> list[int]:
    """Numbers of threads to time: 1, and 2 where this process may use two processors."""
    return [n for n in (1, 2) if n <= len(os.sched_getaffinity(0))]


LEGEND = """\
ns per grain and step, medians of the turns; ratio = ours / LAMMPS, below 1 our code is faster.
With extras: ours also tracks dissipated energy and corrects the onset of contacts.
Processor: the ratio of processor times, which other programs on the machine hardly change.
Contacts per grain after the last turn and pressure after the warm-up, ours / LAMMPS; (!) if the
metrics after the warm-up do not agree. P8, P30: ours has grains of 20 faces, LAMMPS rigid clumps; a pair
of clumps counts as one contact, and the load is the normal stress at the walls.
"""


def main() -> None:
    """Run the benchmark with the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="10000 grains, 1 thread, f64, 3 turns")
    parser.add_argument("--turns", type=int, default=None, help="turns per scene (default 5, quick 3)")
    parser.add_argument("--scenes", nargs="+", choices=TAGS, default=None, help="only these scenes")
    parser.add_argument("--threads", nargs="+", type=int, default=None, help="threads (default 1 2, quick 1)")
    parser.add_argument("--precision", nargs="+", choices=("f64", "f32"), default=None, help="default both, quick f64")
    parser.add_argument("--install-lammps", action="store_true", help="apt-get install lammps first, as root")
    args = parser.parse_args()
    find_lammps(args.install_lammps)
    tags = args.scenes or (["S2_10000", "S3_10000"] if args.quick else TAGS)
    threads = args.threads or ([1] if args.quick else threads_here())
    precisions = args.precision or (["f64"] if args.quick else ["f64", "f32"])
    turns = args.turns or (3 if args.quick else 5)
    results = {}
    for tag in tags:
        for n in threads:
            print(f"{tag}, {n} thread{'s'[: n > 1]} ...", flush=True)
            results |= measure_scene(tag, n, precisions, turns)
            save(results)
    print(f"\n{LEGEND}\n{table(results)}")


if __name__ == "__main__":
    main()
