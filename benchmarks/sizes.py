"""Does a step cost the same per grain whatever their number, and what memory does a grain take?

`python -m benchmarks.sizes [--full]` times the declared scenes with 1000 and 10 000 grains, and repeated along their
periodic axes up to 100 000 (--full: a million, which takes about 2 GB), on one thread. The same steps of every size are
timed in turn, neighbour searches included, with LAMMPS beside up to 100 000. Memory is measured in processes of their
own: how much higher the resident memory and its peak are in the larger scene, per grain more.
"""

import argparse
from contextlib import ExitStack
from statistics import median

from benchmarks import bounds, lammps, page, scenes
from benchmarks.ours import Worker
from benchmarks.run import WARM_UP

SPHERES = ("S3_1000", "S3_10000", "S3_100000", "S3_1000000")
DISCS = ("S2_1000", "S2_10000", "S2_100000", "S2_1000000")
SHAPED = {  # 512 grains of 20 faces, then spheres cut into 20 faces; discs cut into 30 arcs
    "20 faces": ("P8_500", "S3_2000/20", "S3_10000/20"),
    "30 arcs": ("S2_1000/30", "S2_10000/30"),
}
STEPS = 200  # per turn, the same of every size: grains then go the same way, and lists live as long
FEWEST_GRAIN_STEPS = 1e6  # per turn, for small scenes to be timed long enough
PEER_UP_TO = 100_000
GROWTH = 2.5  # bound of the time per grain and step over that of the scene with 10 000 grains
BYTES = {"S3_10000 S3_1000000": 1200.0, "S3_2000/20 S3_50000/20": 2000.0}  # per grain, in double precision


def grow(tags, turns):
    """One row per tag, timed in turn: grains, ours by the clock and on the processor and LAMMPS [ns per grain
    and step], steps per neighbour search."""
    with ExitStack() as stack:
        workers = {tag: stack.enter_context(Worker(tag, "f64", 1, False)) for tag in tags}
        grains = {tag: worker.grains for tag, worker in workers.items()}
        steps = {tag: max(STEPS, int(FEWEST_GRAIN_STEPS / grains[tag])) for tag in tags}
        peers = {t: scenes.load(t) for t in tags if t[0] == "S" and "/" not in t and grains[t] <= PEER_UP_TO}
        peers = peers if lammps.find() else {}
        ours, theirs, rebuilds = {t: [] for t in tags}, {t: [] for t in tags}, dict.fromkeys(tags, 0)
        processor = {t: [] for t in tags}
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


def growth_figures(rows):
    """Time per grain and step of every size over that of the scene with 10 000 grains, with the bound."""
    one = next(row["ours_ns"] for row in rows.values() if row["grains"] == 10_000)
    larger = {tag: row for tag, row in rows.items() if row["grains"] > 10_000}
    return {f"growth_{tag}": bounds.figure(row["ours_ns"] / one, "1", GROWTH) for tag, row in larger.items()}


def bytes_per_grain(small, large):
    """Bytes that each grain more adds to the resident memory and to its peak, after a warm-up with neighbour searches:
    {"resident": bytes, "peak": bytes}. With the onset correction and the ledger, as runs have them by default.

    What compiling leaves behind differs from scene to scene, so that a first process fills the cache of kernels.
    """
    found = []
    for tag in (small, large):
        for _ in ("fill the cache", "measure"):
            with Worker(tag, "f64", 1, True) as worker:
                worker.ask(f"run {STEPS}")
                answer = worker.ask("memory"), worker.grains
        found.append(answer)
    (low, few), (high, many) = found
    return {name: (high[name] - low[name]) / (many - few) for name in low}


def memory_figures(pairs):
    """Bytes per grain of pairs of tags "SMALL LARGE", with the bounds: of what a run holds and of its peak."""
    metrics = {}
    for pair in pairs:
        for name, value in bytes_per_grain(*pair.split()).items():
            metrics[f"memory_{name}_{pair.split()[1]}"] = bounds.figure(value, "bytes per grain", BYTES[pair])
    return metrics


def table(rows):
    """Markdown table of the rows of `grow`."""
    lines = page.head("scene", "grains", "ours", "on the processor", "LAMMPS", "ratio", "steps per neighbour search")
    for tag, row in rows.items():
        peer = row["lammps_ns"]
        theirs = (f"{peer:.0f}", f"{row['ours_ns'] / peer:.2f}") if peer else ("-", "-")
        mine = (f"{row['ours_ns']:.0f}", f"{row['ours_cpu_ns']:.0f}")
        lines.append(page.row(tag, row["grains"], *mine, *theirs, f"{row['steps_per_rebuild']:.0f}"))
    return "\n".join(lines)


def measure(full, turns):
    """(rows by tag, figures with bounds) of all groups; `full` adds scenes of 100 000 grains and more, and memory."""
    count = 4 if full else 2
    rows, metrics = {}, {}
    for group in (SPHERES[:count], DISCS[:count], *SHAPED.values()):
        found = grow(group, turns)
        rows |= found
        if group in (SPHERES, DISCS):
            metrics |= growth_figures(found)
    return rows, metrics | (memory_figures(BYTES) if full else {})


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", action="store_true", help="up to a million grains, and memory")
    parser.add_argument("--turns", type=int, default=3, help="timed turns; medians are printed")
    args = parser.parse_args()
    rows, metrics = measure(args.full, args.turns)
    print(table(rows))
    if metrics:
        print(f"\n{bounds.table(metrics)}")


if __name__ == "__main__":
    main()
