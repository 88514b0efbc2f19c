"""What memory alone would allow: `python -m benchmarks.roofline`.

Counts the bytes that a step of a declared scene must move at least, from the schema of what it stores, and divides them
by the bandwidth that this machine reaches on a triad of arrays far larger than its caches, on one core. A scene that
fits into the caches may be faster than that; one that does not cannot be. The table gives the measured time beside it.
"""

import argparse
import time
from collections.abc import Iterable, Sequence
from statistics import median

import numpy as np

from benchmarks import page, scenes
from benchmarks.ours import Worker

TAGS = ("S2_10000", "S3_10000")
STEPS = 400  # per turn
TRIAD = 20_000_000  # numbers of each of the three arrays: 480 MB together
# Rows of the schema that a step reads (1) or reads and writes (2), once per grain, listed pair and contact.
GRAIN = {
    "position": 2,
    "velocity": 2,
    "angular_velocity": 2,
    "inverse_mass": 1,
    "inverse_inertia": 1,
    "radius": 1,
    "force": 2,
    "torque": 2,
    "built_position": 1,
    "platen_index": 1,
}
PAIR = {"first_slot": 1, "second_slot": 1, "status": 1}
CONTACT = {"history": 2, "pair_force": 2, "pair_torque": 2, "status": 1}


def triad_bandwidth(turns: int = 5) -> float:
    """Bandwidth [bytes per second] of a = b + c, two arrays read and one written, in the fastest of `turns`."""
    b, c = np.ones(TRIAD), np.ones(TRIAD)
    a = np.empty(TRIAD)
    taken = []
    for _ in range(turns):
        began = time.perf_counter()
        np.add(b, c, out=a)
        taken.append(time.perf_counter() - began)
    return 3 * a.nbytes / min(taken)


def row_bytes(variables: Iterable, sizes: dict[str, int], times: dict[str, int]) -> int:
    """Bytes of rows of the schema, each counted `times[name]` times; KeyError for a name that is not in the schema."""
    from taichi_lsm.core.fields import bytes_per_row

    by_name = {v.name: v for v in variables}
    return sum(factor * bytes_per_row([by_name[name]], sizes) for name, factor in times.items())


def step_bytes(sim) -> tuple[float, float, float, float]:
    """Bytes that a step moves if every value is moved once.

    Returns
    -------
    tuple of float
        Bytes per grain and step, bytes per contact and step, contacts per grain, listed pairs per grain.
    """
    g, p, n = sim.grains, sim.pairs, len(sim)
    listed = int(p.row_start.to_numpy()[n])
    contacts = int((p.status.to_numpy()[:listed] != 0).sum())
    per_grain = row_bytes(g.variables.values(), g.sizes, GRAIN)
    per_pair = row_bytes(p.variables, p.sizes, PAIR) + 4  # and the transpose
    per_contact = row_bytes(p.variables, p.sizes, CONTACT)
    total = per_grain + (listed * per_pair + contacts * per_contact) / n
    return total, total * n / contacts, contacts / n, listed / n


def measure(tags: Sequence[str], turns: int) -> str:
    """Markdown table of the tags, with the bandwidth above it."""
    import taichi_lsm as lsm

    bandwidth = triad_bandwidth()
    head = ("scene", "contacts", "listed pairs", "bytes per grain", "per contact", "ns at the bandwidth", "ns measured")
    lines = [f"Triad: {bandwidth / 1e9:.1f} GB/s on one core.", "", *page.head(*head)]
    for tag in tags:
        sim = lsm.Simulation(scenes.declared(tag, parallel=False)[0])
        sim.run(STEPS)
        total, each, contacts, listed = step_bytes(sim)
        with Worker(tag, "f64", 1, False) as worker:
            worker.ask(f"run {STEPS}")
            taken = [worker.ask(f"run {STEPS}")["seconds"] / (STEPS * len(sim)) * 1e9 for _ in range(turns)]
        counts = (f"{contacts:.2f}", f"{listed:.2f}", f"{total:.0f}", f"{each:.0f}")
        lines.append(page.row(tag, *counts, f"{total / bandwidth * 1e9:.0f}", f"{median(taken):.0f}"))
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=3, help="timed turns; medians are printed")
    print(measure(TAGS, parser.parse_args().turns))


if __name__ == "__main__":
    main()
