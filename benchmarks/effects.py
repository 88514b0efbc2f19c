"""What each effect costs: `python -m benchmarks.effects [--save]`.

The spheres of S3_1000 are run with sets of effects that differ by one effect each (`effect_sets`). Every set runs in a
process of its own, with steps so short that nothing moves: all sets evaluate the same contacts, where a scene without
friction would soon be a different one. All are timed in turn, on one thread of the processor. The tables give the time
per grain and step, the fields, and the bytes of a grain and of a listed pair, and for every effect what it adds to the
scene without it. --save writes data/effect_costs.json, which `lsm list --effects` shows.
"""

import argparse
import json
import platform
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import bounds, page
from benchmarks.effect_sets import EFFECT_SETS
from benchmarks.ours import Worker

SAVED = Path(__file__).parent.parent / "data" / "effect_costs.json"
STEPS = 2000  # per turn
FEWER = {"frictionless_over_frictional": 0.65, "discs_over_spheres": 0.5}  # at most
SIZES = (("10000", 1), ("100000", 2))  # grains, threads


def in_turn(tags: Sequence[str], turns: int, threads: int = 1) -> dict[str, tuple[float, dict[str, int]]]:
    """Time several scenes in turn.

    Parameters
    ----------
    tags : sequence of str
        Declared scenes, see `scenes.declared`.
    turns : int
        Timed turns.
    threads : int
        Threads of each process. Times are processor times on one thread, else those of the wall clock.

    Returns
    -------
    dict
        Tag: (median time [ns per grain and step], fields and bytes as in `ours.size`).
    """
    with ExitStack() as stack:
        workers = {tag: stack.enter_context(Worker(tag, "f64", threads, True)) for tag in tags}
        times: dict[str, list[float]] = {tag: [] for tag in tags}
        for worker in workers.values():
            worker.ask("run 200")
        for _ in range(turns):
            for tag, worker in workers.items():
                steps = max(200, STEPS * 1000 // worker.grains)
                answer = worker.ask(f"run {steps}")
                seconds = answer["cpu_seconds" if threads == 1 else "seconds"]
                times[tag].append(seconds / (steps * worker.grains) * 1e9)
        sizes = {tag: worker.ask("size") for tag, worker in workers.items()}
    return {tag: (median(times[tag]), sizes[tag]) for tag in tags}


def costs(turns: int) -> dict[str, dict[str, float]]:
    """Time [ns per grain and step], fields and bytes of every set of effects, and what its last effect adds to them."""
    measured = in_turn([f"S3_1000:{name}" for name in EFFECT_SETS], turns)
    result = {}
    for name, (_, without) in EFFECT_SETS.items():
        ns, size = measured[f"S3_1000:{name}"]
        base_ns, base = measured[f"S3_1000:{without}"] if without else (0.0, dict.fromkeys(size, 0))
        added = {f"added_{key}": size[key] - base[key] for key in ("fields", "bytes_per_grain", "bytes_per_pair")}
        result[name] = {"ns": ns, **size, "added_ns": ns - base_ns, **added}
    return result


def machine() -> str:
    """Name of the processor, as far as the system states it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="ascii", errors="replace").splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"


def table(rows: dict[str, dict[str, float]]) -> str:
    """Markdown table of `costs`."""
    lines = page.head(
        "effect", "ns per grain and step", "fields", "bytes per grain", "per pair", "adds ns", "adds bytes"
    )
    for name, row in rows.items():
        bytes_added = f"{row['added_bytes_per_grain']} + {row['added_bytes_per_pair']}"
        numbers = (row["fields"], row["bytes_per_grain"], row["bytes_per_pair"])
        lines.append(page.row(name, f"{row['ns']:.1f}", *numbers, f"{row['added_ns']:.1f}", bytes_added))
    return "\n".join(lines)


def ratios(turns: int, sizes: Sequence[tuple[str, int]]) -> dict[str, dict[str, Any]]:
    """Metrics of what leaving effects out gains, with their bounds, in scenes of `sizes` (grains, threads)."""
    metrics = {}
    for grains, threads in sizes:
        tags = [f"S3_{grains}:linear_elastic", f"S2_{grains}:coulomb_friction", f"S3_{grains}:coulomb_friction"]
        *cheap, expensive = (ns for ns, _ in in_turn(tags, turns, threads).values())
        for (name, most), ns in zip(FEWER.items(), cheap, strict=True):
            metrics[f"{name}_{grains}_{threads}t"] = bounds.metric(ns / expensive, "1", most)
    return metrics


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=5, help="timed turns; medians are printed")
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name}")
    args = parser.parse_args()
    rows = costs(args.turns)
    print(table(rows))
    if args.save:
        added = {name: {k: row[k] for k in row if k.startswith("added")} for name, row in rows.items()}
        about = {"scene": "S3_1000, double precision, one thread", "machine": machine()}
        SAVED.write_text(json.dumps({"about": about, "effects": added}, indent=1) + "\n", encoding="ascii")
    print(f"\n{bounds.table(ratios(args.turns, SIZES))}")


if __name__ == "__main__":
    main()
