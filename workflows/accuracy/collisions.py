"""Integrators, time steps and force laws, by single collisions with a closed form and by a rack of ten discs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.accuracy import Trial
from workflows.common.small_scenes import scene_of

if TYPE_CHECKING:
    from workflows.accuracy_cost import Params

STIFFNESS = 1e5  # [N m-1]
MASS = 250.0 * np.pi  # of a disc of 1 m [kg]
LEVELS = (12, 17, 24, 34, 48, 68, 96, 136, 192)  # steps per contact
SPEED = 0.05  # of approach [m s-1]: overlaps of some thousandths of a diameter
DURATION = np.pi * np.sqrt(0.5 * MASS / STIFFNESS)  # of a contact of linear springs [s]
SCHEMES = ("explicit_euler", "symplectic_euler", "velocity_verlet", "onset_verlet", "forest_ruth")
CLASSES: dict[str, str] = dict(
    zip(SCHEMES, ("ExplicitEuler", "SymplecticEuler", "VelocityVerlet", "OnsetVerlet", "ForestRuth"))
)
HERTZ_TIME = 2.9432  # duration of an impact after Hertz, in greatest depth over speed
OF_PAIRS = ("energy during a collision", "energy after a collision", "distance after a collision")
RACK = 10  # discs
FINEST = 3200  # steps per contact of the reference of the rack


def linear() -> list[Any]:
    """Linear springs."""
    return [lsm.LinearElastic(STIFFNESS)]


def hertz() -> list[Any]:
    """Hertz's law, for impacts as long as those of `linear` at SPEED."""
    depth = SPEED * DURATION / HERTZ_TIME
    radius = 0.25  # of two discs of 1 m, reduced
    modulus = 0.5 * (0.5 * MASS) * SPEED**2 * 15.0 / 8.0 / (np.sqrt(radius) * depth**2.5)
    return [lsm.effects.Hertz(youngs_modulus=2.0 * (1.0 - 0.3**2) * modulus, poissons_ratio=0.3)]


FORCE_LAWS = {"linear": linear, "hertz": hertz}


def pairs(scheme: str, force_law: str, per_contact: float, count: int, seed: int) -> tuple[lsm.Scene, NDArray]:
    """`count` pairs of discs about to collide head on, each with another phase of the step at the first touch."""
    dt = DURATION / per_contact
    gap = SPEED * dt * (3.0 + np.random.default_rng(seed).uniform(0.0, 1.0, count))
    y = 5.0 * np.arange(count)
    position = np.stack([np.stack([0.0 * y, y], axis=1), np.stack([1.0 + gap, y], axis=1)], axis=1).reshape(-1, 2)
    velocity = np.tile([(0.5 * SPEED, 0.0), (-0.5 * SPEED, 0.0)], (count, 1))
    more = {"dt": dt, "integrator": getattr(lsm, CLASSES[scheme]), "guards": lsm.Guards(energy=None, step=None)}
    return scene_of(position, FORCE_LAWS[force_law](), velocity=velocity, **more), gap


def errors_of_pairs(
    sims: dict[Any, lsm.Simulation], scheme: str, force_law: str, per_contact: float, count: int, seed: int
) -> tuple[float, float, float]:
    """Errors of pairs of discs that collide once.

    Greatest relative error of the energy of all pairs together during the collision; rms over the phases of its error
    after it; rms of the error of the distance, over the distance that the grains fly in one contact.
    """
    scene, gap = pairs(scheme, force_law, per_contact, count, seed)
    sim = loaded(sims, (scheme, force_law), scene)
    start, during = lsm.energies(sim).balance, 0.0
    for _ in range(int(per_contact + 14) // 3 + 1):  # whole steps of Forest-Ruth
        sim.run(3)
        during = max(during, abs(lsm.energies(sim).balance / start - 1.0))
    x, v = sim.state.position.to_numpy()[:, 0], sim.state.velocity.to_numpy()[:, 0]
    away = (v[1::2] - v[::2]) / SPEED
    exact = 1.0 + SPEED * (sim.time - gap / SPEED - DURATION)
    distance = (x[1::2] - x[::2] - exact) / (SPEED * DURATION)
    return during, float(np.sqrt(np.mean((away**2 - 1.0) ** 2))), float(np.sqrt(np.mean(distance**2)))


def loaded(sims: dict[Any, lsm.Simulation], key: tuple[str, str], scene: lsm.Scene) -> lsm.Simulation:
    """The simulation of this key at the start of the scene; compiled once."""
    if key in sims:
        sims[key].reset(scene)
    else:
        sims[key] = lsm.Simulation(scene)
    return sims[key]


def rack(scheme: str, per_contact: int, angle: float) -> lsm.Scene:
    """A disc that hits a triangle of nine discs a little apart, off its axis, the whole rotated by `angle` [rad]."""
    row = [(i * np.sqrt(0.75), j - 0.5 * i) for i in range(4) for j in range(i + 1)][: RACK - 1]
    position = 1.004 * np.array([(0.0, 0.0), *row]) + [0.0, 0.0]
    position[0] = (-1.02, 0.13)
    c, s = np.cos(angle), np.sin(angle)
    position = position @ np.array([[c, s], [-s, c]])
    velocity = np.zeros((RACK, 2))
    velocity[0] = SPEED * np.array([c, s])
    more = {"dt": DURATION / per_contact, "integrator": getattr(lsm, CLASSES[scheme])}
    return scene_of(position, linear(), velocity=velocity, guards=lsm.Guards(energy=None, step=None), **more)


def places_of_rack(sims: dict[Any, lsm.Simulation], scheme: str, per_contact: int, angle: float) -> NDArray:
    """Positions (n, 2) [m] of the discs of the rack after four contact times."""
    sim = loaded(sims, (scheme, "rack"), rack(scheme, per_contact, angle))
    sim.run(4 * per_contact)
    return sim.state.position.to_numpy()


def measure_collisions(params: Params, force_law: str) -> list[Trial]:
    """Trials of single collisions with this force law, without costs: schemes by steps per contact."""
    schemes = SCHEMES if force_law == "linear" else ("symplectic_euler", "velocity_verlet", "onset_verlet")
    sims, trials = {}, []
    # contacts that last whole steps end at the phase at which they began, and errors cancel
    fractions = (np.arange(params.replicas) + 0.5) / params.replicas - 0.5
    for scheme in schemes:
        parameter = scheme if force_law == "linear" else f"{scheme}, Hertz"
        for n in LEVELS:
            for replica, fraction in enumerate(fractions):
                found = errors_of_pairs(sims, scheme, force_law, n + fraction, params.phases, params.seed + replica)
                for quantity, error in zip(OF_PAIRS, found):
                    trials.append(
                        Trial(parameter, f"{n} steps per contact", n, quantity, replica, error, np.nan, np.nan)
                    )
    return trials


def measure_rack(params: Params) -> list[Trial]:
    """Trials of the rack, without costs: rms error of the positions over the flight in one contact."""
    sims, trials = {}, []
    angles = np.random.default_rng(params.seed).uniform(0.0, 1.0, params.replicas)
    exact = [places_of_rack(sims, "onset_verlet", FINEST, angle) for angle in angles]
    for scheme in SCHEMES:
        for n in LEVELS:
            if n % 3 == 0 or scheme != "forest_ruth":
                for replica, angle in enumerate(angles):
                    off = places_of_rack(sims, scheme, n, angle) - exact[replica]
                    error = float(np.sqrt((off**2).sum(axis=1).mean()) / (SPEED * DURATION))
                    where = (scheme, f"{n} steps per contact", n, "places after ten collisions", replica)
                    trials.append(Trial(*where, error, np.nan, np.nan))
    return trials
