"""Digests of the positions of the declared scenes after some steps: `python -m benchmarks.digest [--steps 2000]`.

A change that leaves the physics alone prints the same lines before and after it, on the same processor and with the
same version of Taichi.
"""

import argparse
import hashlib

import numpy as np

import taichi_lsm as lsm
from benchmarks import clumps, scenes

TAGS = ("S2_1000", "S3_1000", "S2_1000/30", "P8_500")


def build(tag: str) -> lsm.Scene:
    """Scene of a tag with the defaults of a run: dissipation tracked by effect, onset of contacts corrected."""
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
    parser.add_argument("--scenes", nargs="+", default=TAGS, help="tags as in benchmarks.scenes.declared")
    args = parser.parse_args()
    for tag in args.scenes:
        print(f"{tag} {args.steps} {digest(tag, args.steps)}", flush=True)


if __name__ == "__main__":
    main()
