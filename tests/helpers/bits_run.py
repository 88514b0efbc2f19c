"""Runs a sheared layer of discs in a process of its own and writes its state: started by test_bits.py.

Usage: python -m tests.helpers.bits_run FILE STEPS THREADS PATH SKIN WIDTH
PATH alone | shared: by one thread or a team; SKIN in diameters; WIDTH of a contact block.
"""

import hashlib
import json
import sys

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.contact import contact_block

COLUMNS, ROWS = 100, 50


def layer(parallel, skin):
    """5000 discs with friction and damping between two platens, the upper one pulled and under servo control.

    The lower platen is every fourth disc of the lowest row; the others of that row lie above a plane wall that moves.
    """
    rng = np.random.default_rng(21)
    pitch = 1.02
    x, y = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
    position = pitch * np.stack([x + 0.5 * (y % 2), 0.9 * y], axis=-1).reshape(-1, 2)
    platen = np.select([(y == 0) & (x % 4 == 0), y == ROWS - 1], [0, 1], -1).ravel()
    mobile = platen < 0
    k, stress = 1e5, 1e3
    return lsm.Scene(
        dim=2,
        lengths=(pitch * COLUMNS, np.inf),
        periodic=(True, False),
        shapes=[lsm.disc()],
        shape_index=np.zeros(len(position), int),
        position=position,
        diameter=rng.uniform(0.8, 1.0, len(position)),
        density=1000.0,
        effects=[
            lsm.LinearElastic(k),
            lsm.ViscousDamping(restitution=0.5),
            lsm.CoulombFriction(0.5, 0.5 * k),
        ],
        platen_index=platen,
        platens=[
            lsm.Platen("lower", [lsm.Fixed(), lsm.Fixed()]),
            lsm.Platen("upper", [lsm.ConstantVelocity(2.0, 10.0), lsm.ServoStress(stress, 1, k, 8e4, 1.0)]),
        ],
        walls=[lsm.PlaneWall("floor", (0.0, -0.55), (0.0, 1.0), (2.0, 0.02))],
        velocity=np.where(mobile[:, None], rng.standard_normal(position.shape), 0.0),
        skin=skin,
        parallel=parallel,
    )


def touching_contacts(sim):
    """(ids, force, history) of all contacts, in the order of their ids."""
    starts = sim.pairs.row_start.to_numpy()[: len(sim) + 1]
    used = starts[-1]
    first = sim.grains.id.to_numpy()[np.repeat(np.arange(len(sim)), np.diff(starts))]
    second = sim.pairs.second_id.to_numpy()[:used]
    order = np.lexsort([second, first])
    order = order[sim.pairs.status.to_numpy()[order] != 0]
    force, history = (getattr(sim.pairs, name).to_numpy()[order] for name in ("pair_force", "history"))
    return np.stack([first[order], second[order]], axis=1), force, history


def main(file, steps, threads, path, skin, width):
    """Run and write {"rebuilds", "digest": {quantity: SHA-256}, ...} as JSON."""
    contact_block.WIDTH = int(width)
    sim = lsm.Simulation(layer(path == "shared", float(skin)), threads=int(threads))
    sim.run(int(steps))
    # built_position alone depends on when the list was built
    names = sorted(set(sim.grains.variables) - {"built_position"})
    columns = {name: getattr(sim.state, name).to_numpy() for name in names}
    columns |= {f"platen_{name}": values for name, values in sim.platens.snapshot().items()}
    columns |= {f"wall_{name}": values for name, values in sim.walls.snapshot().items()}
    columns |= dict(zip(("pairs", "pair_force", "history"), touching_contacts(sim)))
    sums = sim.measure.sums(-1.0, 60.0)
    columns["sums"] = np.concatenate([np.ravel(value) for value in sums.values()])
    summary = {
        "digest": {n: hashlib.sha256(np.ascontiguousarray(v).tobytes()).hexdigest() for n, v in columns.items()},
        "finite": bool(all(np.isfinite(v).all() for v in columns.values())),
        "grains": len(sim),
        "rebuilds": sim.rebuilds,
        "sliding": sums["sliding_count"],
        "wall_work": float(columns["wall_work"][0]),
    }
    with open(file, "w", encoding="utf-8") as out:
        json.dump(summary, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
