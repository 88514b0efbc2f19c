"""Integrators, time steps, precision and skin, by a gas of 225 grains of about 30 arcs, and of discs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows import energy_conservation
from workflows.accuracy import Trial, seconds_per_step
from workflows.accuracy.collisions import CLASSES

if TYPE_CHECKING:
    from workflows.accuracy_cost import Params

LEVELS = (12, 24, 48, 96, 192)  # steps per contact
GROUPS = {  # schemes whose simulations fit into one process
    "first": ("explicit_euler", "symplectic_euler", "velocity_verlet", "onset_verlet"),
    "second": ("forest_ruth",),
    "single": ("onset_verlet",),
}
DISC = 0.93  # diameter of the discs, in places of their lattice
LIMIT = 0.5  # of the energy of the start: beyond this change the run is ended
SKINS = (0.01, 0.03, 0.07, 0.15, 0.3, 0.6)  # in diameters


def gas(
    params: Params, scheme: str, per_contact: float, seed: int, body: str = "arcs", dt: str | None = None
) -> lsm.Scene:
    """The elastic gas of `energy_conservation`, of arcs, or of as many equal discs on a lattice of the same cell."""
    of_gas = energy_conservation.Params(seed=seed)
    known = scheme if scheme in energy_conservation.SCHEMES else "onset_verlet"
    scene = energy_conservation.build(of_gas, params.gas_grains, seed, per_contact, known, "--gas-grains")
    scene.integrator = getattr(lsm, CLASSES[scheme])
    scene.guards = lsm.Guards(energy=None, step=None)
    if body == "discs":
        rows = round(np.sqrt(params.gas_grains))
        place = np.stack(np.divmod(np.arange(params.gas_grains), rows), axis=1) + 0.5
        jitter = np.random.default_rng(seed).uniform(-0.02, 0.02, place.shape)
        scene.position = (place + jitter) * scene.lengths[0] / rows
        scene.shapes, scene.shape_index = [lsm.disc()], np.zeros(params.gas_grains, np.int32)
        scene.diameter = np.full(params.gas_grains, DISC * scene.lengths[0] / rows)
    if dt == "default":
        scene.dt = None
    return scene


def drift(sim: lsm.Simulation, contacts: float, per_contact: float, samples: int = 60) -> float:
    """Greatest relative error of the energy over `contacts` contact durations; infinite if the run is stopped."""
    start, worst = lsm.energies(sim).balance, 0.0
    chunk = max(3, 3 * round(contacts * per_contact / samples / 3))
    for _ in range(samples):
        try:
            sim.run(chunk)
        except lsm.SimulationError:
            return np.inf
        worst = max(worst, abs(lsm.energies(sim).balance / start - 1.0))
        if not worst < LIMIT:
            break
    return worst


def reference(params: Params, precision: str = "f64") -> tuple[lsm.Simulation, float]:
    """(simulation of the gas of discs at the default settings, its steps per contact)."""
    scene = gas(params, "onset_verlet", 48, params.seed, "discs", dt="default")
    sim = lsm.Simulation(scene, precision=precision)
    return sim, gas(params, "onset_verlet", 1, params.seed, "discs").chosen_dt() / sim.dt


def default_steps_per_contact(params: Params) -> float:
    """Steps per contact of the gas of discs at the default settings."""
    return reference(params)[1]


def measure_gas(params: Params, group: str, precision: str = "f64") -> list[Trial]:
    """Trials of the schemes of a group: energy drift of the gas of arcs against steps per contact."""
    discs, usual = reference(params, precision)
    sims = {"discs": discs}
    for scheme in GROUPS[group]:
        sims[scheme] = lsm.Simulation(gas(params, scheme, 200, params.seed), precision=precision)
    cost = seconds_per_step(sims, params.timed_steps // 3 * 3, params.turns)
    trials = []
    for scheme in GROUPS[group]:
        for n in LEVELS:
            for replica in range(params.replicas):
                sims[scheme].reset(gas(params, scheme, n, params.seed + replica))
                error = drift(sims[scheme], params.contacts, n)
                parameter = scheme if precision == "f64" else f"{scheme}, f32"
                relative = cost[scheme] * n / (cost["discs"] * usual)
                where = (parameter, f"{n} steps per contact", n, "energy drift of a gas", replica)
                trials.append(Trial(*where, error, cost[scheme] * n, relative))
    return trials


def measure_lists(params: Params) -> list[Trial]:
    """Trials of the skin by the gas of discs: greatest difference of a position, and cost."""
    trials, positions = [], {}
    sim, usual = reference(params)
    scenes = {skin: gas(params, "onset_verlet", 48, params.seed, "discs") for skin in SKINS}
    for skin, scene in scenes.items():
        scene.skin = skin * float(np.mean(scene.diameter))
    taken = {skin: [] for skin in SKINS}
    for turn in range(params.turns + 1):
        for skin, scene in scenes.items():
            sim.reset(scene)
            began = time.process_time()
            sim.run(params.timed_steps)
            if turn:
                taken[skin].append((time.process_time() - began) / params.timed_steps / len(sim))
            positions[skin] = sim.state.position.to_numpy()
    default = float(np.median(taken[0.07]))
    for skin in SKINS:
        error, cost = float(np.abs(positions[skin] - positions[0.07]).max()), float(np.median(taken[skin]))
        where = ("skin", f"{skin:g} d", skin, "difference of positions", 0)
        trials.append(Trial(*where, error, cost * usual, cost / default))
    return trials
