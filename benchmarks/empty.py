"""Does an empty domain cost anything? `python -m benchmarks.empty`.

The grains of a declared scene, in the domain of that scene and in one 100 times as long along each axis, each in a
process of its own: time of a neighbour search, in turn, and resident memory of the process after them.
"""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from statistics import median
from typing import Any

from benchmarks import bounds
from benchmarks.ours import Worker

SCENES = ("S3_10000", "S2_10000")
LONGER = 100
SEARCHES = 20  # per turn
SLOWER = 2.0  # bound of the time of a search over that in the domain of the scene
MORE_MEMORY = 16.0  # MB: bound of the resident memory beyond that of the scene


def measure(tags: Sequence[str], turns: int) -> tuple[dict[str, dict[str, Any]], dict[str, list[float]]]:
    """Compare neighbour searches in the domain of a scene with those in one LONGER times as long.

    Parameters
    ----------
    tags : sequence of str
        Declared scenes.
    turns : int
        Timed turns of SEARCHES searches.

    Returns
    -------
    metrics : dict
        For each tag the ratio of the two times and the additional resident memory [MB], with their bounds.
    times : dict
        Tag: the two median times of a search [ms].
    """
    metrics, times = {}, {}
    for tag in tags:
        with ExitStack() as stack:
            both = [stack.enter_context(Worker(t, "f64", 1, False)) for t in (tag, f"{tag}@{LONGER}")]
            taken: list[list[float]] = [[], []]
            for _ in range(turns):
                for worker, seconds in zip(both, taken):
                    seconds += worker.ask(f"rebuild {SEARCHES}")["seconds"]
            near, far = (worker.ask("memory")["resident"] for worker in both)
        ratio = median(taken[1]) / median(taken[0])
        times[tag] = [1e3 * median(seconds) for seconds in taken]
        metrics[f"empty_search_{tag}"] = bounds.metric(ratio, "1", SLOWER)
        metrics[f"empty_memory_{tag}"] = bounds.metric((far - near) / 1e6, "MB", MORE_MEMORY)
    return metrics, times


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=5, help=f"turns of {SEARCHES} searches; medians are printed")
    metrics, times = measure(SCENES, parser.parse_args().turns)
    for tag, (near, far) in times.items():
        print(f"{tag}: a neighbour search takes {near:.2f} ms, {far:.2f} ms in a domain {LONGER} times as long")
    print(bounds.table(metrics))


if __name__ == "__main__":
    main()
