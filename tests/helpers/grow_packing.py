"""Makes the dense packings of `scenes.packing`, by slow growth without friction, and stores them beside this file.

Usage: python -m tests.helpers.grow_packing discs-48-1 arcs-48-1 discs-200-3
"""

import sys

import numpy as np

from tests.helpers import scenes

STAGES, STEPS, REST = 60, 200, 40  # growths by equal parts, steps after each, and stages at full size


def grown(arguments):
    """position (n, 2) [m] and angle (n,) [rad] after the grains have grown from 0.6 of their size, without friction."""
    scale = arguments["diameter"]
    sim = scenes.simulate(scenes.scene(effects=scenes.frictional(), **arguments | {"diameter": 0.6 * scale}))
    scenes.effect(sim, "coulomb_friction").mu_[0] = 0.0
    scenes.effect(sim, "viscous_damping").c_[0] = 1.5
    names = [name for name in ("radius", "diameter", "overlap_limit") if sim.grains.has(name)]
    small = {name: getattr(sim.state, name).to_numpy() for name in names}
    sim.search.grid.set_width(2.0 * small["radius"].max() / 0.6 + sim.skin)
    rest = {"velocity": np.zeros((len(scale), 2)), "angular_velocity": np.zeros((len(scale), 1))}
    for growth in np.append(np.linspace(1.0, 1.0 / 0.6, STAGES), np.full(REST, 1.0 / 0.6)):
        scenes.reload(sim, **{name: growth * value for name, value in small.items()}, **rest)
        sim.run(STEPS)
    state = {"position": sim.state.position.to_numpy()}
    if sim.grains.has("orientation"):
        orientation = sim.state.orientation.to_numpy()
        state["angle"] = np.arctan2(orientation[:, 1], orientation[:, 0])
    return state


if __name__ == "__main__":
    scenes.STORED.mkdir(exist_ok=True)
    for packing in sys.argv[1:]:
        kind, count, seed = packing.split("-")
        np.savez(scenes.STORED / f"{packing}.npz", **grown(scenes.loose_packing(kind, int(count), int(seed))))
