"""Aggregates of angular pieces that collide and break: the scene of two tests, and a run of it in a process of its own.

Usage: python -m tests.helpers.bonds_run FOLDER STEPS THREADS PRECISION
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np

import taichi_lsm as lsm

PIECES = 9
YOUNG = 2e7


def rubble(parallel=None, columns=3, rows=3):
    """columns x rows aggregates with random velocities in a periodic square; they break when they collide."""
    rng = np.random.default_rng(8)
    kinds = [lsm.shapes.angular_aggregate(PIECES, seed, corner_radius=0.1) for seed in range(3)]
    pitch = 1.02 * 2.0 * max(kind.reach for kind in kinds)
    size = float(np.sqrt(PIECES))  # of an aggregate; its pieces have diameters of about 1
    shapes = [shape for kind in kinds for shape in kind.shapes]
    shape, position, scale, angle, velocity, bonds = [], [], [], [], [], []
    for a, cell in enumerate(np.ndindex(columns, rows)):
        kind, angle_of_all = kinds[a % 3], rng.uniform(0, 2 * np.pi)
        c, s = np.cos(angle_of_all), np.sin(angle_of_all)
        bonds.append(kind.pairs + a * PIECES)
        shape.append(np.arange(PIECES) + a % 3 * PIECES)
        position.append(size * (kind.position @ [[c, s], [-s, c]] + pitch * np.array(cell)))
        scale.append(size * kind.diameter)
        angle.append(np.full(PIECES, angle_of_all))
        velocity.append(np.broadcast_to(rng.uniform(-1.5, 1.5, 2), (PIECES, 2)))
    return lsm.Scene(
        dim=2,
        lengths=(size * pitch * columns, size * pitch * rows),
        periodic=(True, True),
        shapes=shapes,
        shape_index=np.concatenate(shape),
        position=np.concatenate(position),
        diameter=np.concatenate(scale),
        angle=np.concatenate(angle),
        velocity=np.concatenate(velocity),
        density=1000.0,
        effects=[
            lsm.LinearElastic(YOUNG),
            lsm.ViscousDamping(restitution=0.5),
            lsm.CoulombFriction(0.5, 0.5 * YOUNG),
            lsm.effects.ElasticBrittleBond(YOUNG, 0.25, cohesion=1e5, friction_angle=0.6, radius_ratio=0.55),
        ],
        bonds=np.concatenate(bonds),
        thickness=1.0,
        parallel=parallel,
    )


def columns_of(sim):
    """{name: array} by persistent id of everything that a run leaves behind."""
    columns = {n: getattr(sim.state, n).to_numpy() for n in sorted(set(sim.grains.variables) - {"built_position"})}
    columns |= {row.name: getattr(sim.bonds, row.name).to_numpy() for row in sim.bonds.variables if row.restart}
    columns["sums"] = np.concatenate([np.ravel(value) for value in sim.measure.sums().values()])
    return columns


def digest(sim):
    """{name: SHA-256} of these columns."""
    return {n: hashlib.sha256(np.ascontiguousarray(v).tobytes()).hexdigest() for n, v in columns_of(sim).items()}


def main(folder, steps, threads, precision):
    """Write {"half", "end"} to digests.json: a run from the start, and one from the checkpoint half.nc there."""
    sim = lsm.Simulation(rubble(parallel=True), precision=precision, threads=int(threads))
    sim.run(int(steps))
    half = digest(sim)
    lsm.restore_checkpoint(sim, Path(folder) / "half.nc")
    sim.run(int(steps))
    text = json.dumps({"half": half, "end": digest(sim)})
    (Path(folder) / "digests.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
