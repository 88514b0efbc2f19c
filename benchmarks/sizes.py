"""Time per grain and step against the number of grains, and memory per grain: `python -m benchmarks.sizes [--full]`.

Times the declared scenes with 1000 and 10 000 grains, and repeated along their
periodic axes up to 100 000 (--full: a million, which takes about 2 GB), on one thread. The same steps of every size are
timed in turn, neighbour searches included, beside LAMMPS up to 100 000 grains. Memory is measured in separate
processes: the difference in resident memory, and in its peak, between two scenes, divided by that in grains.
"""

import argparse
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from statistics import median
from typing import Any

from benchmarks import bounds, lammps, page, scenes
from benchmarks.ours import Worker
from benchmarks.run import WARM_UP

SPHERES = ("S3_1000", "S3_10000", "S3_100000", "S3_1000000")
DISCS = ("S2_1000", "S2_10000", "S2_100000", "S2_1000000")
SHAPED = {  # 512 grains of 20 faces, then spheres cut into 20 faces; discs cut into 30 arcs
    "20 faces": ("P8_500", "S3_2000/20", "S3_10000/20"),
    "30 arcs": ("S2_1000/30", "S2_10000/30"),
}
STEPS = 200  # per turn, the same for every size: grains then move equally far, and lists last equally long
FEWEST_GRAIN_STEPS = 1e6  # per turn, for small scenes to be timed long enough
PEER_UP_TO = 100_000
GROWTH = 2.5  # bound of the time per grain and step over that of the scene with 10 000 grains
BYTES = {"S3_10000 S3_1000000": 1200.0, "S3_2000/20 S3_50000/20": 2000.0}  # per grain, in double precision


def grow(tags: Sequence[str], turns: int) -> dict[str, dict[str, Any]]:
    """Time scenes of several sizes in turn.

    Returns
    -------
    dict
        A row per tag: "grains"; "ours_ns", "ours_cpu_ns" and "lammps_ns", our time on the wall clock and on the
        processor and that of LAMMPS [ns per grain and step]; "steps_per_rebuild", steps per neighbour search.
    """
    with ExitStack() as stack:
        workers = {tag: stack.enter_context(Worker(tag, "f64", 1, False)) for tag in tags}
        grains = {tag: worker.grains for tag, worker in workers.items()}
        steps = {tag: max(STEPS, int(FEWEST_GRAIN_STEPS / grains[tag])) for tag in tags}
        peers = {t: scenes.load(t) for t in tags if t[0] == "S" and "/" not in t and grains[t] <= PEER_UP_TO}
        peers = peers if lammps.find() else {}
        ours: dict[str, list[float]] = {t: [] for t in tags}
        processor: dict[str, list[float]] = {t: [] for t in tags}
        theirs: dict[str, list[float]] = {t: [] for t in tags}
        rebuilds = dict.fromkeys(tags, 0)
        for worker in workers.values():
            worker.ask(f"run {WARM_UP}")
        for turn in range(turns):
            for tag, worker in workers.items():
                per_grain = 1e9 / (steps[tag] * grains[tag])
                answer = worker.ask(f"run {steps[tag]}")
                ours[tag].append(answer["seconds"] * per_grain)
                processor[tag].append(answer["cpu_seconds"] * per_grain)
                rebuilds[tag] += answer["rebuilds"]
                if tag in peers:
                    other = lammps.run(peers[tag], 1, WARM_UP + turn * steps[tag], steps[tag])
                    theirs[tag].append(other["seconds"] * per_grain)
    return {
        tag: {
            "grains": grains[tag],
            "ours_ns": median(ours[tag]),
            "ours_cpu_ns": median(processor[tag]),
            "lammps_ns": median(theirs[tag]) if theirs[tag] else None,
            "steps_per_rebuild": steps[tag] * turns / max(1, rebuilds[tag]),
        }
        for tag in tags
    }


def growth_metrics(rows: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Time per grain and step of every size over that of the scene with 10 000 grains, with the bound."""
    one = next(row["ours_ns"] for row in rows.values() if row["grains"] == 10_000)
    larger = {tag: row for tag, row in rows.items() if row["grains"] > 10_000}
    return {f"growth_{tag}": bounds.metric(row["ours_ns"] / one, "1", GROWTH) for tag, row in larger.items()}


def bytes_per_grain(small: str, large: str) -> dict[str, float]:
    """Bytes that each additional grain adds to the resident memory and to its peak.

    Measured after a warm-up with neighbour searches, with the onset correction and the dissipation accounting of the
    default settings. The memory that compiling leaves behind differs from scene to scene, so that a first process
    fills the cache of kernels.

    Returns
    -------
    dict
        {"resident": bytes, "peak": bytes}.
    """
    answers = []
    for tag in (small, large):
        for _ in ("fill the cache", "measure"):
            with Worker(tag, "f64", 1, True) as worker:
                worker.ask(f"run {STEPS}")
                answer = worker.ask("memory"), worker.grains
        answers.append(answer)
    (low, few), (high, many) = answers
    return {name: (high[name] - low[name]) / (many - few) for name in low}


def memory_metrics(pairs: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Bytes per grain of pairs of tags "SMALL LARGE", resident and at the peak, with the bounds."""
    metrics = {}
    for pair in pairs:
        for name, value in bytes_per_grain(*pair.split()).items():
            metrics[f"memory_{name}_{pair.split()[1]}"] = bounds.metric(value, "bytes per grain", BYTES[pair])
    return metrics


def table(rows: dict[str, dict[str, Any]]) -> str:
    """Markdown table of the rows of `grow`."""
    lines = page.head("scene", "grains", "ours", "on the processor", "LAMMPS", "ratio", "steps per neighbour search")
    for tag, row in rows.items():
        peer = row["lammps_ns"]
        theirs = (f"{peer:.0f}", f"{row['ours_ns'] / peer:.2f}") if peer else ("-", "-")
        mine = (f"{row['ours_ns']:.0f}", f"{row['ours_cpu_ns']:.0f}")
        lines.append(page.row(tag, row["grains"], *mine, *theirs, f"{row['steps_per_rebuild']:.0f}"))
    return "\n".join(lines)


def measure(full: bool, turns: int) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]:
    """Rows by tag and metrics with bounds of all groups; `full` adds 100 000 grains and more, and memory."""
    count = 4 if full else 2
    rows, metrics = {}, {}
    for group in (SPHERES[:count], DISCS[:count], *SHAPED.values()):
        found = grow(group, turns)
        rows |= found
        if group in (SPHERES, DISCS):
            metrics |= growth_metrics(found)
    return rows, metrics | (memory_metrics(BYTES) if full else {})


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="up to a million grains, and memory")
    parser.add_argument("--turns", type=int, default=3, help="timed turns; medians are printed")
    args = parser.parse_args()
    rows, metrics = measure(args.full, args.turns)
    print(table(rows))
    if metrics:
        print(f"\n{bounds.table(metrics)}")


if __name__ == "__main__":
    main()
