"""Does a snapshot cost more the more there are? `python -m benchmarks.snapshot_cost`.

Appends snapshots of spheres at random places to a grains.nc in the present folder, and prints how long each took. With
`--shares` they share their way to the disk, as those of a run do.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.io.grains_file import GrainsWriter, snapshot_rows, static_rows

COUNTS = (1, 10, 100, 300)
MEDIAN_OF = 5  # appends, the last ones


def append_seconds(path: Path, grains: int, snapshots: int, shares: bool = False) -> list[float]:
    """Seconds of every append [s] to a new file at `path`."""
    static = {
        **dict.fromkeys(("mass", "bounding_radius", "shape_scale"), np.ones(grains)),
        **dict.fromkeys(("kind", "shape_index"), np.zeros(grains, np.int32)),
        "inertia": np.ones((grains, 3)),
        "patch_count": [1],
        "patch_centre": np.zeros((1, 3)),
        "patch_radius": [0.5],
        "patch_axis": [[1.0, 0.0, 0.0]],
        "patch_angle": [np.pi],
        "patch_part": [0],
        "patch_edge_radius": [0.0],
    }
    attributes = lsm.file_attributes("Cost of snapshots", "Random numbers", "", 1, 1.0, "cpu", "f64")
    writer = GrainsWriter(path, static, static_rows(3), snapshot_rows(3), attributes, shares=shares)
    random, seconds = np.random.default_rng(1), []
    for i in range(snapshots):
        arrays = {v.name: random.random((grains, 4 if v.name == "orientation" else 3)) for v in snapshot_rows(3)}
        began = time.perf_counter()
        writer.append(float(i), arrays)
        seconds.append(time.perf_counter() - began)
    writer.close("complete")
    return seconds


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grains", type=int, default=2000)
    parser.add_argument("--snapshots", type=int, default=COUNTS[-1])
    parser.add_argument("--shares", action="store_true")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        seconds = append_seconds(Path(folder) / "grains.nc", given.grains, given.snapshots, given.shares)
    print(f"{given.snapshots} snapshots: {sum(seconds):.2f} s")
    for count in COUNTS:
        if count <= given.snapshots:
            print(f"snapshot {count}: {1e3 * np.median(seconds[max(count - MEDIAN_OF, 0) : count]):.0f} ms")


if __name__ == "__main__":
    main()
