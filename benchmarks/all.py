"""All benchmarks: `python -m benchmarks.all` (`make bench`) and `--full` (`make bench-full`).

Writes benchmarks/results.json after every part, prints Markdown tables, and puts each of them between its markers of a
page (see `page`). The core takes at most 20 minutes on two cores; --full adds 32 bits, a million grains and many
patches, and takes an hour or more.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

from benchmarks import bounds, effects, empty, output_cost, page, run, scenes, shapes, sizes, start
from benchmarks.ours import ROOT

TURNS = 3  # of every part
LARGE = ("S2_100000", "S3_100000")
# What a part returns: results by name, and the blocks of the page by the name of their markers.
Part = tuple[dict[str, dict[str, Any]], dict[str, str]]


def time_beside_lammps(full: bool) -> Part:
    """Time per step beside LAMMPS.

    Small scenes, for which our code uses one thread, are timed on one thread only, in 64 bits; with `full` all scenes
    are timed on one and two threads, and in 32 bits too.
    """
    results = {}
    for tag in (*run.TAGS, *(LARGE if full else ())):
        precisions = ["f64", "f32"] if full and tag in scenes.TAGS else ["f64"]
        for threads in run.threads_here() if full or tag.endswith("_10000") else [1]:
            print(f"  {tag}, {threads}t", flush=True)
            results |= run.measure_scene(tag, threads, precisions, TURNS)
    return results, {"compare": f"{run.LEGEND}\n{run.table(results)}"}


def time_sizes(full: bool) -> Part:
    """Growth of the time with the number of grains, and memory."""
    rows, metrics = sizes.measure(full, TURNS)
    named = {f"size_{tag}": row for tag, row in rows.items()}
    claimed = f"\n\n{bounds.table(metrics)}" if metrics else ""
    return named | metrics, {"sizes": sizes.table(rows) + claimed}


def time_patches(full: bool) -> Part:
    """Cost of the number of patches per grain."""
    groups = shapes.measure(full, TURNS)
    return {f"shape_{row['tag']}": row for rows in groups for row in rows}, {"shapes": shapes.table(groups)}


def time_empty_domain(full: bool) -> Part:
    """Cost of an empty domain."""
    metrics, _ = empty.measure(empty.SCENES, TURNS)
    return metrics, {"empty": bounds.table(metrics)}


def time_start(full: bool) -> Part:
    """Seconds to the first step; with `full` once in 3D too, where a cold start takes minutes."""
    metrics, table = start.measure(start.FLAT, TURNS)
    if full:
        more, solid = start.measure(start.SOLID, 1)
        metrics, table = metrics | more, f"{table}\n\n{solid}"
    return metrics, {"start": table}


def time_output(full: bool) -> Part:
    """Cost of diagnostics and files."""
    metrics, seconds = output_cost.measure(output_cost.SHAPES)
    return metrics, {"output": f"{output_cost.table(seconds)}\n\n{bounds.table(metrics)}"}


def time_effects(full: bool) -> Part:
    """Cost of every effect; with `full` also in scenes of 100 000 grains on two threads."""
    rows = effects.costs(TURNS)
    metrics = effects.ratios(TURNS, effects.SIZES if full else effects.SIZES[:1])
    named = {f"effect_{name}": row for name, row in rows.items()}
    return named | metrics, {"effects": f"{effects.table(rows)}\n\n{bounds.table(metrics)}"}


PARTS: dict[str, Callable[[bool], Part]] = {
    "compare": time_beside_lammps,
    "sizes": time_sizes,
    "empty": time_empty_domain,
    "start": time_start,
    "output": time_output,
    "shapes": time_patches,
    "effects": time_effects,
}


def main() -> None:
    """Run the requested parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="the long parts too")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="only these")
    parser.add_argument("--table", default=ROOT / "docs" / "performance.md", help="page with markers for the tables")
    parser.add_argument("--install-lammps", action="store_true", help="apt-get install lammps first, as root")
    args = parser.parse_args()
    run.find_lammps(args.install_lammps)
    results = {}
    for name in args.parts:
        began = time.perf_counter()
        print(f"{name} ...", flush=True)
        found, blocks = PARTS[name](args.full)
        results |= found
        run.save(results)
        written = page.write(args.table, blocks)
        for block in blocks.values():
            print(f"\n{block}\n")
        where = f", written to {args.table}" if written else ""
        print(f"{name}: {time.perf_counter() - began:.0f} s{where}", flush=True)
    broken = [name for name, row in results.items() if row.get("holds") is False]
    print(f"Bounds that do not hold: {', '.join(broken) or 'none'}")


if __name__ == "__main__":
    main()
