"""Small scenes that several tests share, and the means to use one compiled simulation for many of them."""

import os
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of as scene

PRECISION = os.environ.get("LSM_TEST_PRECISION", "f64")  # of the present test; the fixture `runtime` sets it
KEY_PRECISIONS = ("f64", "f32") if PRECISION == "f64" else (PRECISION,)
both_precisions = pytest.mark.parametrize("runtime", KEY_PRECISIONS, indirect=True)  # of a key test
STIFFNESS = 1e5
FILL = {"discs": 0.88, "arcs": 0.90}  # share of the box that a packing fills: a few per cent of overlap
STORED = Path(__file__).parent / "packings"


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
    """The compiled effect of this name: its parameters are in fields."""
    return next(e for e in sim.effects if e.name == name)


def energy(sim):
    """(kinetic and stored energy, dissipated energy) of the grains now [J]."""
    sums = sim.measure.sums()
    parts = ("translational_energy", "rotational_energy", "elastic_energy", "potential_energy")
    return sum(sums[p] for p in parts), sum(v for k, v in sums.items() if k.startswith("dissipated_"))


def momenta(sim):
    """(linear momentum, its scale, angular momentum, its scale) of velocities half a step before positions."""
    mass, inertia = sim.scene.masses()
    x, v, omega = (getattr(sim.state, name).to_numpy() for name in ("position", "velocity", "angular_velocity"))
    orbital = np.cross(x, v) if x.shape[1] == 3 else (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])[:, None]
    own = sim.state.angular_momentum.to_numpy() if sim.grains.has("angular_momentum") else inertia * omega
    angular = mass[:, None] * orbital + own
    linear = (mass[:, None] * v).sum(axis=0)
    return linear, (mass * np.linalg.norm(v, axis=1)).sum(), angular.sum(axis=0), np.abs(angular).sum()


def frictional(stiffness=STIFFNESS):
    """All effects of a grain in gouge."""
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
    """Arguments of `scene` for a dense periodic packing of "discs" or of angular "arcs", from `grow_packing.py`."""
    with np.load(STORED / f"{body}-{count}-{seed}.npz") as arrays:
        return loose_packing(body, count, seed) | dict(arrays)


def loose_packing(body, count, seed):
    """The same grains on a lattice, before they are grown into each other."""
    rng = np.random.default_rng(seed)
    shapes = [lsm.disc()] if body == "discs" else lsm.shapes.random_angular_shapes(8, seed)
    scale = rng.uniform(0.8, 1.2, count)
    side = float(np.sqrt(0.25 * np.pi * (scale**2).sum() / FILL[body]))
    rows = int(np.ceil(np.sqrt(count)))
    lattice = np.stack(np.divmod(rng.permutation(rows * rows)[:count], rows), axis=1)
    return {
        "position": (lattice + 0.5 + rng.uniform(-0.05, 0.05, (count, 2))) * (side / rows),
        "shapes": shapes,
        "shape_index": np.arange(count) % len(shapes),
        "diameter": scale,
        "angle": rng.uniform(0, 2 * np.pi, count),
        "lengths": (side, side),
        "periodic": (True, True),
    }
