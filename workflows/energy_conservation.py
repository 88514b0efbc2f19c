"""The verification of Abe & Mora (2003): an elastic gas of random grains must keep its energy.

Grains of about 30 patches fill the tiles of a periodic square, start with random velocities and no spin, and collide
elastically. The drift of the total energy is measured against the step for several integrators; the paper's scheme
kept it within 2.5 %.
"""

import time
from pathlib import Path
from typing import ClassVar

import numpy as np
from pydantic import Field

import taichi_lsm as lsm

from workflows.settings import Params as BaseParams
from workflows.settings import to_toml
from workflows.summary import Figure, write_summary

SEED_DRIFT = 0.025  # of the paper, its Figure 4
LEVELS = (50, 71, 100, 141, 200, 283, 400)  # steps per contact, for the order
SCHEMES = {
    "onset_verlet": lsm.OnsetVerlet,
    "velocity_verlet": lsm.VelocityVerlet,
    "symplectic_euler": lsm.SymplecticEuler,
    "explicit_euler": lsm.ExplicitEuler,
}


class Params(BaseParams):
    """The seed's verification test in 2D."""

    grains: int = Field(900, ge=16, description="number of grains [1]")
    tile: float = Field(1e-3, gt=0, description="mean width of a tile [m]")
    corner_radius: float = Field(0.08, gt=0, le=0.3, description="least patch radius [tiles]")
    gap: float = Field(0.02, gt=0, le=0.2, description="distance of a grain from the sides of its tile [tiles]")
    arcs_per_corner: int = Field(4, ge=1, description="patches per corner; about 30 per grain with 4 [1]")
    density: float = Field(2500.0, gt=0, description="density of the grains [kg m-3]")
    stiffness: float = Field(5e4, gt=0, description="normal stiffness k [N m-1]")
    speed: float = Field(1.0, gt=0, description="root mean square velocity at the start [m s-1]")
    steps: int = Field(5000, ge=100, description="steps of each run [1]")
    long_steps: int = Field(50_000, ge=100, description="steps of the long run [1]")
    seeds: int = Field(3, ge=1, description="packings for the drift [1]")
    order_seeds: int = Field(8, ge=1, description="packings for the order [1]")
    order_grains: int = Field(225, ge=16, description="grains of the runs that measure the order [1]")
    samples: int = Field(500, ge=10, description="energies recorded per run [1]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {"grains": 100, "steps": 1000, "long_steps": 2000, "order_seeds": 2, "order_grains": 49},
        "demo": {"order_seeds": 4, "order_grains": 100},
        "standard": {},
        "reference": {"seeds": 8, "long_steps": 500_000, "order_seeds": 16},
    }


def build(params, grains, seed, steps_per_contact, scheme) -> lsm.Scene:
    """One elastic gas; `steps_per_contact` fixes the step through the contact duration pi sqrt(m/(2k))."""
    p = params
    side = np.sqrt(grains)
    shapes, position, scale = lsm.pave(grains, side, seed, p.corner_radius, p.gap, p.arcs_per_corner)
    rng = np.random.default_rng(seed + 100)
    velocity = rng.normal(size=(grains, 2)) * p.speed / np.sqrt(2.0)
    scene = lsm.Scene(
        dim=2,
        lengths=(side * p.tile, side * p.tile),
        periodic=(True, True),
        shapes=shapes,
        shape=np.arange(grains),
        position=position * p.tile,
        scale=scale * p.tile,
        density=p.density,
        thickness=p.tile,
        velocity=velocity,
        effects=[lsm.LinearElastic(p.stiffness)],
        integrator=SCHEMES[scheme],
        ledger=False,
        dt=1.0,
    )
    mass, _ = scene.masses()
    scene.velocity -= (mass[:, None] * velocity).sum(axis=0) / mass.sum()
    scene.dt = np.pi * np.sqrt(mass.mean() / (2.0 * p.stiffness)) / steps_per_contact
    return scene


class Gas:
    """Runs many scenes of one scheme and size through one compiled simulation."""

    def __init__(self, params, scheme):
        self.params, self.scheme, self.sims = params, scheme, {}

    def run(self, grains, seed, steps_per_contact, steps):
        """Energies of one run: dict of arrays over the samples, time [s] and energies [J]."""
        p = self.params
        scene = build(p, grains, seed, steps_per_contact, self.scheme)
        if grains in self.sims:
            sim, _ = self.sims[grains]
            sim.load(scene)
        else:
            sim = lsm.Simulation(scene, p.arch, p.precision, p.threads)
            self.sims[grains] = (sim, lsm.ShadowEnergy(sim))
        sim, shadow = self.sims[grains]
        rows = []
        every = max(1, steps // p.samples)
        for _ in range(steps // every + 1):
            sums = sim.measure.sums()
            kept = {n: sums[n] for n in ("translational_energy", "rotational_energy", "elastic_energy")}
            rows.append({"time": sim.time, **kept, "shadow_correction": shadow.correction()})
            if not np.isfinite(sum(kept.values())):
                break
            sim.run(every)
        return {name: np.array([r[name] for r in rows]) for name in rows[0]}


def drift(series, shadow=False):
    """max abs(E/E0 - 1) of a run, of the energy or of the shadow energy [1]."""
    total = sum(series[n] for n in ("translational_energy", "rotational_energy", "elastic_energy"))
    if shadow:
        total = total + series["shadow_correction"]
    return float(np.abs(total / total[0] - 1.0).max())
