"""Time per grain and step, ours beside LAMMPS: `python -m benchmarks.run [--quick]`.

Every turn times LAMMPS and each of our configurations one after the other, over the same steps of the same
scene, so that a busy machine slows all of them. Compare figures of one run only. Medians over the turns are
printed.
Writes benchmarks/results.json.
"""

import argparse
import json
import os
from contextlib import ExitStack
from pathlib import Path
from statistics import median

from benchmarks import lammps, scenes
from benchmarks.ours import Worker

RESULTS = Path(__file__).parent / "results.json"
WARM_UP = 200  # steps before the first turn
GRAIN_STEPS = 4e6  # per timed turn
# Between the two codes after the warm-up. Later, motions part as in any chaotic system and figures fluctuate.
MARGINS = {"contacts_per_grain": 0.03, "pressure": 0.01, "translational_energy": 0.05}


def steps_of(state):
    """Steps per timed turn."""
    return int(GRAIN_STEPS / len(state.x))


def measure_scene(tag, threads, precisions, turns):
    """Rows of the results, {name: row}, of one scene on `threads` threads."""
    state = scenes.load(tag)
    steps, grains = steps_of(state), len(state.x)
    choices = [(p, extras) for p in precisions for extras in (False, True)]
    ours = {choice: [] for choice in choices}
    theirs = []
    with ExitStack() as stack:
        workers = {c: stack.enter_context(Worker(tag, c[0], threads, c[1])) for c in choices}
        early = lammps.run(state, threads, 0, WARM_UP)
        for worker in workers.values():
            worker.ask(f"run {WARM_UP}")
        figures = {c: worker.ask("measure") for c, worker in workers.items()}
        for turn in range(turns):
            theirs.append(lammps.run(state, threads, WARM_UP + turn * steps, steps))
            for choice, worker in workers.items():
                ours[choice].append(worker.ask(f"run {steps}"))
        late = {c: worker.ask("measure") for c, worker in workers.items()}
    size = {"grains": grains, "steps": steps, "turns": turns}
    clocks = ("seconds", "cpu_seconds") if threads == 1 else ("seconds",)
    rows = {}
    for p in precisions:
        entry = agreement(figures[p, False], early) | size
        entry["ours_end"] = late[p, False]
        entry["lammps_end"] = {name: theirs[-1][name] for name in late[p, False]}
        for clock in clocks:
            mine, extras, other = (
                [turn[clock] * 1e9 / (steps * grains) for turn in turns_of]
                for turns_of in (ours[p, False], ours[p, True], theirs)
            )
            entry |= times(mine, extras, other, "" if clock == "seconds" else "cpu_")
        rows[f"{tag}_{p}_{threads}t"] = entry
    return rows


def times(ours, with_extras, theirs, clock=""):
    """Medians, minima and ratios ours / LAMMPS of times [ns per grain and step], one per turn.

    clock: "" for the wall clock, "cpu_" for processor time, which hardly feels what else the machine does.
    """
    return {
        f"ours_{clock}ns": median(ours),
        f"lammps_{clock}ns": median(theirs),
        f"{clock}ratio": median(ours) / median(theirs),
        f"ours_extras_{clock}ns": median(with_extras),
        f"{clock}ratio_extras": median(with_extras) / median(theirs),
        f"ours_{clock}ns_min": min(ours),
        f"lammps_{clock}ns_min": min(theirs),
        f"{clock}ratio_min": min(ours) / min(theirs),
        f"{clock}ratio_turns": [a / b for a, b in zip(ours, theirs)],
    }


def agreement(figures, other):
    """The same figures of both codes at one step, and whether they agree within the margins."""
    return {
        "ours": figures,
        "lammps": {name: other[name] for name in figures},
        "agree": all(abs(figures[name] / other[name] - 1.0) < margin for name, margin in MARGINS.items()),
    }


def table(results):
    """Markdown table of the results."""
    lines = [
        "| scene | ours | LAMMPS | ratio | of minima | with extras | processor | contacts | pressure |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, r in results.items():
        a, b = r["ours"], r["lammps"]
        processor = f"{r['cpu_ratio']:.2f}" if "cpu_ratio" in r else "-"
        contacts = f"{r['ours_end']['contacts_per_grain']:.2f} / {r['lammps_end']['contacts_per_grain']:.2f}"
        lines.append(
            f"| {name} | {r['ours_ns']:.0f} | {r['lammps_ns']:.0f} | {r['ratio']:.2f} | {r['ratio_min']:.2f} "
            f"| {r['ratio_extras']:.2f} | {processor} | {contacts} "
            f"| {a['pressure']:.4g} / {b['pressure']:.4g}{'' if r['agree'] else ' (!)'} |"
        )
    return "\n".join(lines)


def main():
    """Run the benchmark as the options say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="10000 grains, 1 thread, f64, 3 turns")
    parser.add_argument("--turns", type=int, default=None, help="turns per scene (default 5, quick 3)")
    parser.add_argument("--scenes", nargs="+", choices=scenes.TAGS, default=None, help="only these scenes")
    parser.add_argument("--threads", nargs="+", type=int, default=None, help="threads (default 1 2, quick 1)")
    parser.add_argument("--install-lammps", action="store_true", help="apt-get install lammps first, as root")
    args = parser.parse_args()
    if lammps.find() is None and args.install_lammps:
        lammps.install()
    if lammps.find() is None:
        raise SystemExit(f"{lammps.HOW_TO_INSTALL}, or run again with --install-lammps as root.")
    tags = args.scenes or (["S2_10000", "S3_10000"] if args.quick else scenes.TAGS)
    threads = args.threads or ([1] if args.quick else [n for n in (1, 2) if n <= (os.cpu_count() or 1)])
    precisions = ["f64"] if args.quick else ["f64", "f32"]
    turns = args.turns or (3 if args.quick else 5)
    results = {}
    for tag in tags:
        for n in threads:
            print(f"{tag}, {n} thread{'s'[: n > 1]} ...", flush=True)
            results |= measure_scene(tag, n, precisions, turns)
            RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="ascii")
    print("\nns per grain and step, medians of the turns; ratio = ours / LAMMPS, below 1 we are faster.")
    print("With extras: ours also books dissipated energy and corrects the onset of contacts.")
    print("Processor: the ratio of processor times, which hardly feels what else the machine does.")
    print("Contacts per grain after the last turn and pressure after the warm-up, ours / LAMMPS; (!) if the")
    print("figures after the warm-up do not agree.\n")
    print(table(results))


if __name__ == "__main__":
    main()
