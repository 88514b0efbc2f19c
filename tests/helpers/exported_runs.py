"""Small folders of runs to be exported: run.nc with three rows, grains.nc with three snapshots of nine grains."""

import numpy as np
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers.output_files import effects, run_row, run_writer
from tests.helpers.shaped_grains import append_snapshot, grains_file

TIMES = (0.0, 1e-3, 2e-3)
LENGTH, GRID, GLUED = 4e-3, 1.3e-3, (0, 1)  # m, m, ids


def shapes_in(dim):
    """A convex grain with corners, a round one and one of two parts, of equivalent diameter 1."""
    if dim == 2:
        return [lsm.shapes.regular_polygon(5), lsm.disc(), lsm.shapes.crossed_bars()]
    pair = lsm.shapes.clump([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [1.0, 1.0])
    return [lsm.shapes.regular_polyhedron(4), lsm.sphere(), pair]


def orientations(dim, count, seed):
    """Unit quaternions (count, 4), w, x, y, z; in 2D about z."""
    if dim == 3:
        return Rotation.random(count, rng=seed).as_quat(scalar_first=True)
    half = np.random.default_rng(seed).uniform(0.0, np.pi, count)
    return np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=1)


def write_run(folder, dim, run_status="complete"):
    """A layer of 3 x 3 grains that moves along x, by more than a period in all; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = run_writer(folder / "run.nc", effects=effects())
    for i in range(3):
        rows.append(run_row(i))
    rows.close("complete")
    rng = np.random.default_rng(dim)
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij"))
    place = GRID * np.stack([x, y, x + y][:dim], axis=1)
    scale = rng.uniform(0.8e-3, 1e-3, 9)
    writer = grains_file(
        folder / "grains.nc", shapes_in(dim), np.arange(9) % 3, scale, periodic=[LENGTH] * (dim - 1), glued=GLUED
    )
    for i, time in enumerate(TIMES):
        append_snapshot(
            writer,
            time,
            place + np.eye(dim)[0] * 3e-3 * i,
            orientation=orientations(dim, 9, i),
            velocity=rng.uniform(-1.0, 1.0, (9, dim)),
            angular_velocity=rng.uniform(-9.0, 9.0, 9 if dim == 2 else (9, 3)),
        )
    if run_status != "running":
        writer.close(run_status)
    return folder
