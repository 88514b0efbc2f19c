"""Makes states/P*_faces.npz, our grains at the normal stress of the clumps: `python -m benchmarks.relax`.

Grains of 20 faces start at the clumps' centres of mass, so small that no contact is deeper than half of what it may be,
and grow by a tenth of a percent at a time, sheared like the clumps, until the middle of the layer carries the stress
that LAMMPS finds at its walls after the warm-up. Then the factor is corrected until the stored state, at rest and
without contact history, does so after the same warm-up. Needs LAMMPS; takes a few minutes.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.spatial import KDTree

import taichi_lsm as lsm
from benchmarks import clumps, lammps_clumps, scenes
from benchmarks.ours import Worker
from benchmarks.run import WARM_UP

GROWTH = 1.001  # of all sizes, per stage
STAGE = 200  # steps after each growth: 0.1 inertial times at unit stress, a displacement of the wall of 0.02 d
TOLERANCE = 0.03  # of the normal stress; the comparison asks for 0.1
CORRECTIONS = 12


def first_factor(state: clumps.Clumps, shape: lsm.shapes.BallPolyhedron) -> float:
    """Largest factor of the sizes at which no two bounding spheres overlap by more than half of the overlap limit."""
    d = clumps.diameters(state)
    # Least distance of two grains of diameter 1: the bounding radii less half of both overlap limits.
    reach = 2.0 * shape.bounding_radius - shape.overlap_limit
    sides = [state.box[0], 1e3, state.box[2]]  # no period along y
    tree = KDTree(np.mod(state.centre, sides), boxsize=sides)
    pairs = tree.query_pairs(1.1 * d.max() * reach, output_type="ndarray")
    apart = state.centre[pairs[:, 0]] - state.centre[pairs[:, 1]]
    apart -= np.round(apart / sides) * sides
    mobile = (state.kind[pairs] == scenes.MOBILE).any(axis=1)  # glued grains may overlap
    return float((np.linalg.norm(apart, axis=1) / (reach * d[pairs].mean(axis=1)))[mobile].min())


def resize(sim: lsm.Simulation, ratio: float) -> None:
    """Multiply all sizes of a running simulation by `ratio`; masses stay as they are, those of the walls too."""
    for name in ("diameter", "radius", "overlap_limit"):
        row = getattr(sim.state, name)
        row.from_numpy(row.to_numpy() * ratio)
    inertia = sim.state.inverse_inertia
    inertia.from_numpy(inertia.to_numpy() / ratio**2)
    sim.rebuild_neighbours()


def grow(state: clumps.Clumps, target: float) -> clumps.Faces:
    """Grains of the first state whose middle carries the normal stress `target`."""
    shape = lsm.shapes.ball_of_faces(clumps.FACES, scenes.DILATION)
    factor = first_factor(state, shape)
    scene = clumps.build(state, clumps.unrelaxed(state, factor))
    sim = lsm.Simulation(scene)
    stress = 0.0
    while stress < target:
        sim.run(STAGE)
        stress = clumps.metrics(sim, state)["normal_stress"]
        resize(sim, GROWTH)
        factor *= GROWTH
    return clumps.Faces(sim.state.position.to_numpy(), sim.state.orientation.to_numpy(), factor)


def save(tag: str, faces: clumps.Faces) -> None:
    """Write the file that `clumps.relaxed` reads."""
    orientation = faces.orientation / np.linalg.norm(faces.orientation, axis=1, keepdims=True)
    path = scenes.STATES / f"{tag}_faces.npz"
    np.savez_compressed(path, position=faces.position, orientation=orientation, factor=faces.factor)


def measured(tag: str) -> float:
    """Our normal stress after the warm-up of the stored state, in a process of its own."""
    with Worker(tag, "f64", 1, False) as worker:
        worker.ask(f"run {WARM_UP}")
        return worker.ask("measure")["normal_stress"]


def relax(tag: str) -> None:
    """Make, correct and store the state of a tag; SystemExit if the normal stress does not converge."""
    state = clumps.load(tag)
    target = lammps_clumps.run(state, 1, 0, WARM_UP)["normal_stress"]
    faces = grow(state, target)
    low, high = None, None  # factors below and above the target
    for _ in range(CORRECTIONS):
        save(tag, faces)
        stress = measured(tag)
        print(f"{tag}: factor {faces.factor:.5f}, normal stress {stress:.3f}, clumps {target:.3f}", flush=True)
        if abs(stress / target - 1.0) < TOLERANCE:
            return
        low, high = (faces.factor, high) if stress < target else (low, faces.factor)
        step = GROWTH if stress < target else 1.0 / GROWTH
        factor = 0.5 * (low + high) if low and high else faces.factor * step
        faces = clumps.Faces(faces.position, faces.orientation, factor)
    raise SystemExit(f"{tag}: the normal stress did not come within {TOLERANCE} of {target:.3f}")


def main() -> None:
    """Relax the states of the given tags."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tags", nargs="*", default=clumps.TAGS, help="which states (default both)")
    for tag in parser.parse_args().tags:
        relax(tag)


if __name__ == "__main__":
    main()
