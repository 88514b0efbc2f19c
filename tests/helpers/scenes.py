"""Small scenes that several tests share, and the means to use one compiled simulation for many of them."""

import functools
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of as scene

PRECISION = os.environ.get("LSM_TEST_PRECISION", "f64")
STIFFNESS = 1e5
FILL = {"discs": 0.88, "arcs": 0.90}  # part of the box that a packing fills: a few per cent of overlap


def tolerance(f64, f32=1e-4):
    """The bound that the rounding of this process's precision allows."""
    return f64 if PRECISION == "f64" else f32


def simulate(new_scene, threads=1):
    """Simulation at the precision of this test process."""
    return lsm.Simulation(new_scene, precision=PRECISION, threads=threads)


def reload(sim, dt=None, strain=0.0, **columns):
    """Start `sim` again from these state columns (velocities at the same time as position), without a past."""
    for name, values in columns.items():
        getattr(sim.state, name).from_numpy(values)
    if dt is not None:
        sim.set_time_step(dt)
    sim.restart(strain)


def effect(sim, name):
    """The compiled law of this name: its parameters are in fields."""
    return next(e for e in sim.effects if e.name == name)


def energy(sim):
    """(kinetic and stored energy, dissipated energy) of the grains now [J]."""
    sums = sim.measure.sums()
    parts = ("translational_energy", "rotational_energy", "elastic_energy", "potential_energy")
    return sum(sums[p] for p in parts), sum(v for k, v in sums.items() if k.startswith("dissipated_"))


def frictional(stiffness=STIFFNESS):
    """All the laws of a grain in gouge."""
    return [
        lsm.LinearElastic(stiffness),
        lsm.ViscousDamping(restitution=0.6),
        lsm.CoulombFriction(0.5, 0.5 * stiffness),
    ]


def reference_packing_scene(name):
    """elastic_discs, elastic_arcs, frictional_discs, frictional_arcs: 48 grains packed in a periodic square."""
    kind, body = name.split("_")
    effects = [lsm.LinearElastic(STIFFNESS)] if kind == "elastic" else frictional()
    return scene(effects=effects, **packing(body))


def packing(body, count=48, seed=1):
    """Arguments of `scene` for a dense periodic packing of "discs" or of angular "arcs", found by slow growth."""
    rng = np.random.default_rng(seed)
    shapes = [lsm.disc()] if body == "discs" else lsm.random_angular_shapes(8, seed)
    scale = rng.uniform(0.8, 1.2, count)
    side = float(np.sqrt(0.25 * np.pi * (scale**2).sum() / FILL[body]))
    rows = int(np.ceil(np.sqrt(count)))
    lattice = np.stack(np.divmod(rng.permutation(rows * rows)[:count], rows), axis=1)
    loose = {
        "position": (lattice + 0.5 + rng.uniform(-0.05, 0.05, (count, 2))) * (side / rows),
        "shapes": shapes,
        "shape_index": np.arange(count) % len(shapes),
        "diameter": scale,
        "angle": rng.uniform(0, 2 * np.pi, count),
        "lengths": (side, side),
        "periodic": (True, True),
    }
    return loose | grown_elsewhere(body, count, seed) if __name__ != "__main__" else loose


@functools.cache
def grown_elsewhere(body, count, seed):
    """position and angle of the packing, made in a process of its own: its Taichi leaves no fields in ours."""
    root = Path(__file__).resolve().parents[2]
    file = Path(os.environ.get("LSM_TEST_FOLDER") or tempfile.mkdtemp()) / f"packing-{body}-{count}-{seed}.npz"
    if not file.exists():
        command = [sys.executable, "-m", "tests.helpers.scenes", body, str(count), str(seed), str(file)]
        subprocess.run(command, cwd=root, check=True, env=os.environ | {"LSM_TEST_PRECISION": "f64"})
    with np.load(file) as arrays:
        return dict(arrays)


def grown(arguments, stages=60, steps=200):
    """position (n, 2) [m] and angle (n,) [rad] after the grains have grown from 0.6 of their size, without friction."""
    scale = arguments["diameter"]
    sim = simulate(scene(effects=frictional(), **arguments | {"diameter": 0.6 * scale}))
    effect(sim, "coulomb_friction").mu_[0] = 0.0
    effect(sim, "viscous_damping").c_[0] = 1.5
    names = [name for name in ("radius", "diameter", "overlap_limit") if sim.grains.has(name)]
    small = {name: getattr(sim.state, name).to_numpy() for name in names}
    sim.search.grid.set_width(2.0 * small["radius"].max() / 0.6 + sim.skin)
    rest = {"velocity": np.zeros((len(scale), 2)), "angular_velocity": np.zeros((len(scale), 1))}
    for growth in np.append(np.linspace(1.0, 1.0 / 0.6, stages), np.full(40, 1.0 / 0.6)):
        reload(sim, **{name: growth * value for name, value in small.items()}, **rest)
        sim.run(steps)
    state = {"position": sim.state.position.to_numpy()}
    if sim.grains.has("orientation"):
        turn = sim.state.orientation.to_numpy()
        state["angle"] = np.arctan2(turn[:, 1], turn[:, 0])
    return state


if __name__ == "__main__":
    np.savez(sys.argv[4], **grown(packing(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
