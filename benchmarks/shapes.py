"""What a shape costs: time per grain and step beside discs and spheres: `python -m benchmarks.shapes [--full]`.

Grains of the declared scenes are cut into arcs (2D) or faces (3D), so that the contacts are those of the discs or
spheres: only the search over patches is added. Each turn times every configuration over the same number of steps, one
after the other and each in a process of its own, on one thread. With --full, grains are cut into up to 300 arcs and
100 faces, and a consolidated layer of angular grains is timed beside one of discs or spheres, per grain and per
contact, since angular grains have more contacts.
"""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from statistics import median
from typing import Any

from benchmarks.ours import Worker

CUT = {"S2_1000": (1, 10, 30, 100), "S3_1000": (1, 20)}  # patches per grain; 1 is the disc or sphere
CUT_FULL = {"S2_1000": (1, 10, 30, 100, 300), "S3_1000": (1, 20, 100)}
GRAIN_STEPS = 4e5  # per timed turn
WARM_UP = 200  # steps before the first turn
LAYERS = ("sphere", "angular")  # shapes of the consolidated layers


def rows_of(tags: Sequence[str], turns: int) -> list[dict[str, Any]]:
    """Time several scenes in turn.

    Returns
    -------
    list of dict
        A row per tag: "tag", "ns" (median time [ns per grain and step]) and "contacts" (per grain). `table` compares
        all rows with the first one.
    """
    with ExitStack() as stack:
        workers = {tag: stack.enter_context(Worker(tag, "f64", 1, False)) for tag in tags}
        grains = {tag: worker.grains for tag, worker in workers.items()}
        taken: dict[str, list[float]] = {tag: [] for tag in tags}
        for worker in workers.values():
            worker.ask(f"run {WARM_UP}")
        for _ in range(turns):
            for tag, worker in workers.items():
                steps = max(1, int(GRAIN_STEPS / grains[tag]))
                taken[tag].append(worker.ask(f"run {steps}")["seconds"] / (steps * grains[tag]) * 1e9)
        contacts = {tag: worker.ask("measure")["contacts_per_grain"] for tag, worker in workers.items()}
    return [{"tag": tag, "ns": median(taken[tag]), "contacts": contacts[tag]} for tag in tags]


def table(groups: Sequence[list[dict[str, Any]]]) -> str:
    """Markdown table of groups of rows; ratios to the first row of each group."""
    lines = [
        "| scene | ns per grain and step | contacts per grain | ratio per grain | ratio per contact |",
        "|---|---|---|---|---|",
    ]
    for rows in groups:
        one = rows[0]
        for row in rows:
            per_grain = row["ns"] / one["ns"]
            per_contact = per_grain * one["contacts"] / row["contacts"]
            lines.append(
                f"| {row['tag']} | {row['ns']:.0f} | {row['contacts']:.2f} | {per_grain:.2f} | {per_contact:.2f} |"
            )
    return "\n".join(lines)


def measure(full: bool, turns: int, dims: Sequence[int] = (2, 3)) -> list[list[dict[str, Any]]]:
    """Groups of rows for `table`: cut discs and spheres; with `full` more patches and consolidated layers."""
    groups = []
    for tag, patches in (CUT_FULL if full else CUT).items():
        dim = int(tag[1])
        if dim in dims:
            groups.append(rows_of([tag if n == 1 else f"{tag}/{n}" for n in patches], turns))
            if full:
                groups.append(rows_of([f"layer{dim}/{shape}" for shape in LAYERS], turns))
    return groups


def main() -> None:
    """Time all shapes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=5, help="timed turns; medians are printed")
    parser.add_argument("--dim", type=int, nargs="+", choices=(2, 3), default=(2, 3), help="dimensions")
    parser.add_argument("--full", action="store_true", help="up to 300 arcs and 100 faces, and packed layers")
    args = parser.parse_args()
    print(table(measure(args.full, args.turns, args.dim)))


if __name__ == "__main__":
    main()
