"""Digests of the positions of some scenes after some steps: `python -m benchmarks.digest [--steps 2000]`.

A change that leaves the physics alone prints the same lines before and after it, on the same processor and with the
same version of Taichi. The declared scenes cover discs, spheres, arc chains and ball-polyhedra between platens, one at
rest and one at a constant velocity; three small scenes cover bonds and plane walls, multi-part grains in a sheared
cell, and a layer under a servo, pulled by a load point.
"""

import argparse
import functools
import hashlib
import multiprocessing

import numpy as np

import taichi_lsm as lsm
from benchmarks import clumps, scenes
from benchmarks.effect_sets import FRICTIONAL

SIDE = 8  # grains along an edge of a small scene


def bonds_and_walls() -> lsm.Scene:
    """A block of bonded discs that breaks on a floor, beside a wall that moves into it."""
    i, j = np.divmod(np.arange(SIDE * SIDE), SIDE)
    along_x = np.flatnonzero(i < SIDE - 1)
    along_y = np.flatnonzero(j < SIDE - 1)
    return lsm.Scene(
        position=np.stack([1.0 + i, 1.0 + j], axis=1),
        velocity=np.full((SIDE * SIDE, 2), (0.5, -4.0)),
        density=1.0,
        effects=[*FRICTIONAL, lsm.Gravity((0.0, -1.0)), lsm.effects.ElasticBrittleBond(1e4, 0.25, 300.0, 0.8)],
        bonds=np.concatenate([np.stack([along_x, along_x + SIDE], 1), np.stack([along_y, along_y + 1], 1)]),
        walls=[
            lsm.PlaneWall("floor", point=(0.0, 0.0), normal=(0.1, 1.0)),
            lsm.PlaneWall("side", point=(SIDE + 2.0, 0.0), normal=(-1.0, 0.0), velocity=(-1.0, 0.0)),
        ],
    )


def crosses_in_a_sheared_cell() -> lsm.Scene:
    """Crosses at random angles in a homogeneously sheared periodic cell."""
    rng = np.random.default_rng(0)
    pitch = 1.4
    i, j = np.divmod(np.arange(SIDE * SIDE), SIDE)
    return lsm.Scene(
        lengths=(SIDE * pitch, SIDE * pitch),
        periodic=(True, True),
        shapes=[lsm.shapes.crossed_bars()],
        position=pitch * (0.5 + np.stack([i, j], axis=1)),
        angle=rng.uniform(0.0, 2.0 * np.pi, SIDE * SIDE),
        velocity=rng.normal(0.0, 1.0, (SIDE * SIDE, 2)),
        density=1.0,
        effects=FRICTIONAL,
        shear_rate=0.5,
    )


def layer_on_a_spring() -> lsm.Scene:
    """Discs between rough platens, the upper one under a servo and pulled by a spring."""
    i, j = np.divmod(np.arange(SIDE * SIDE), SIDE)
    glued_mass = SIDE * np.pi / 4.0
    pull = lsm.SpringLoadPoint(velocity=1.0, stiffness=500.0, inertia=glued_mass)
    servo = lsm.ServoStress(stress=20.0, outward=1, stiffness=1e4, inertia=glued_mass, speed_limit=1.0)
    return lsm.Scene(
        lengths=(SIDE * 1.05, np.inf),
        periodic=(True, False),
        position=np.stack([1.05 * (i + 0.5 * (j % 2)), 0.95 * j], axis=1),
        density=1.0,
        effects=FRICTIONAL,
        platen_index=np.select([j == 0, j == SIDE - 1], [0, 1], -1),
        platens=[lsm.Platen("bottom", [lsm.Fixed(), lsm.Fixed()]), lsm.Platen("top", [pull, servo])],
    )


SMALL = {
    "bonds_and_walls": bonds_and_walls,
    "sheared_crosses": crosses_in_a_sheared_cell,
    "layer_on_a_spring": layer_on_a_spring,
}
TAGS = ("S2_1000", "S3_1000", "S2_1000/30", "P8_500", *SMALL)


def build(tag: str) -> lsm.Scene:
    """Scene of a tag with the defaults of a run: dissipation tracked by effect, onset of contacts corrected."""
    if tag in SMALL:
        return SMALL[tag]()
    if tag in clumps.TAGS:
        return clumps.build(clumps.load(tag), clumps.relaxed(tag), extras=True)
    return scenes.declared(tag, extras=True)[0]


def digest(tag: str, steps: int) -> str:
    """SHA-256 of the positions (f64, in the order of the ids) after `steps` steps."""
    sim = lsm.Simulation(build(tag))
    sim.run(steps)
    return hashlib.sha256(np.ascontiguousarray(sim.state.position.to_numpy()).tobytes()).hexdigest()


def main() -> None:
    """Print one line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000, help="steps after which positions are read")
    parser.add_argument("--scenes", nargs="+", default=TAGS, help="of TAGS, or tags as in scenes.declared")
    args = parser.parse_args()
    # A process of its own for each scene: together their fields overflow Taichi's table of nodes.
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        digests = pool.imap(functools.partial(digest, steps=args.steps), args.scenes, chunksize=1)
        for tag, text in zip(args.scenes, digests, strict=True):
            print(f"{tag} {args.steps} {text}", flush=True)


if __name__ == "__main__":
    main()
