"""Hard cases of packings: grains of very different size, that overlap at the start, that are very stiff, and any."""

from __future__ import annotations

from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, hard

STIFFNESS = 1e6  # [N m-1]
ROWS = 6  # of a lattice of discs
SIDE = 6.0  # of the periodic square [m]
CELL = {"lengths": (SIDE, SIDE), "periodic": (True, True)}
SMALL = 200  # small spheres around a large one


def effects_of(stiffness: float = STIFFNESS, restitution: float = 1.0, friction: float = 0.0) -> list[Any]:
    """Elastic, damped and frictional contacts."""
    return [
        lsm.LinearElastic(stiffness),
        lsm.ViscousDamping(restitution=restitution),
        lsm.CoulombFriction(friction, 0.5 * stiffness),
    ]


def growth(sim: lsm.Simulation, steps: int, samples: int = 20) -> float:
    """Greatest growth of stored and dissipated energy over the energy at the start; infinite if it is not finite."""
    start, worst = lsm.energies(sim).balance, 0.0
    for _ in range(samples):
        sim.run(max(1, steps // samples))
        now = lsm.energies(sim).balance
        worst = max(worst, now / start - 1.0) if np.isfinite(now) else np.inf
    return worst


def giant_and_dwarfs() -> lsm.Scene:
    """A sphere of 1 m amid 200 of 1 cm in a periodic cell; all share the same mean energy."""
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(SMALL, 3))
    direction *= rng.uniform(0.52, 0.6, (SMALL, 1)) / np.linalg.norm(direction, axis=1)[:, None]
    scale = np.concatenate([[1.0], np.full(SMALL, 0.01)])
    velocity = rng.normal(0.0, 0.01, (SMALL + 1, 3)) * scale[:, None] ** -1.5
    cell = {"lengths": (2.2,) * 3, "periodic": (True,) * 3, "skin": 0.01}
    place = np.concatenate([np.zeros((1, 3)), direction])
    return scene_of(place, [lsm.LinearElastic(STIFFNESS)], diameter=scale, velocity=velocity, **cell)


@hard("Sizes 1:100, masses 1:1e6", "relative error of the energy", 1e-3)
def giant_among_dwarfs(bench: Bench) -> float:
    """The smallest sphere sets the time step and the largest the size of the cells.

    The sum of forces on the giant is a million times the force on a dwarf, in which small ones drown if they are added
    carelessly.
    """
    sim = bench.simulate(giant_and_dwarfs())
    start, worst = lsm.energies(sim).balance, 0.0
    for _ in range(20):
        sim.run(bench.steps(10_000, 200))
        worst = max(worst, abs(lsm.energies(sim).balance / start - 1.0))
    return worst


def overlapping(seed: int) -> lsm.Scene:
    """36 discs thrown into a square at random: two centres may be half a diameter apart."""
    rng, place = np.random.default_rng(seed), []
    while len(place) < ROWS**2:
        x = rng.uniform(0.0, SIDE, 2)
        d = np.array(place).reshape(-1, 2) - x
        d -= SIDE * np.rint(d / SIDE)
        if not len(d) or np.linalg.norm(d, axis=1).min() > 0.5:
            place.append(x)
    return scene_of(place, effects_of(restitution=0.3, friction=0.3), safety=0.03, **CELL)


@hard("Packing that overlaps at the start", "greatest energy over the elastic energy at the start", 1.001)
def overlapping_start(bench: Bench) -> float:
    """Discs thrown in at random hold a thousand times the energy of a layer under stress.

    All of it is released, and no more: nothing may be shot through its neighbours, and damping must take it up.
    """
    sim = bench.simulate(overlapping(1))
    stored = lsm.energies(sim).elastic
    most = 0.0
    for _ in range(bench.steps(400, 100)):
        sim.run(50)
        most = max(most, lsm.energies(sim).stored / stored)
    return most


@hard("What an overlapping start releases", "kinetic energy left over the elastic energy of the start", 1e-2)
def relaxed_start(bench: Bench) -> float:
    """After the release the packing has to come to rest, not go on as a gas."""
    sim = bench.simulate(overlapping(2))
    stored = lsm.energies(sim).elastic
    sim.run(bench.steps(200_000, 20_000))
    return lsm.energies(sim).kinetic / stored


def jammed(overlap: float) -> lsm.Scene:
    """A periodic triangular lattice of discs that overlap by `overlap` [m], at velocities in proportion to it."""
    rng = np.random.default_rng(3)
    row, column = np.divmod(np.arange(ROWS**2), ROWS)
    near = 1.0 - overlap
    place = near * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)
    mass = 250.0 * np.pi
    velocity = rng.normal(0.0, 0.3 * overlap * np.sqrt(STIFFNESS / mass), place.shape)
    cell = {"lengths": (ROWS * near, ROWS * near * np.sqrt(0.75)), "periodic": (True, True)}
    return scene_of(place, effects_of(), velocity=velocity, **cell)


@hard(
    "Stiffness number of 1e6",
    "relative error of the energy",
    1e-2,
    excepted="the rounding of lengths of one diameter, 6e-8, is some per cent of an overlap of 1e-6 diameters",
)
def very_stiff(bench: Bench) -> float:
    """Overlaps of a millionth of a diameter are the small difference of lengths of one diameter.

    Ten digits must be left of them, and contacts open and close all the time.
    """
    sim = bench.simulate(jammed(1e-6))
    start, worst = lsm.energies(sim).balance, 0.0
    for _ in range(20):
        sim.run(bench.steps(10_000, 200))
        worst = max(worst, abs(lsm.energies(sim).balance / start - 1.0))
    return worst


def sheared() -> lsm.Scene:
    """36 discs of sizes 1:4, dense, in a cell under homogeneous shear."""
    rng = np.random.default_rng(4)
    scale = np.geomspace(0.5, 2.0, ROWS**2)[rng.permutation(ROWS**2)]
    side = np.sqrt(0.25 * np.pi * (scale**2).sum() / 0.7)
    place = np.stack(np.divmod(np.arange(ROWS**2), ROWS), axis=1) * (side / ROWS)
    cell = {"lengths": (side, side), "periodic": (True, True), "shear_rate": 2.0}
    return scene_of(place, effects_of(restitution=0.5, friction=0.5), diameter=scale, safety=0.1, **cell)


@hard("Sizes 1:4 in a sheared cell", "error of the energy balance over the work of shearing", 1e-3)
def polydisperse_shear(bench: Bench) -> float:
    """Grains cross the border at speed and meet their neighbours' images, small ones between large ones.

    The work of the shear must be what is dissipated and stored.
    """
    sim = bench.simulate(sheared())
    sim.run(2000)
    begin = lsm.energies(sim)
    sim.run(bench.steps(400_000, 20_000))
    end = lsm.energies(sim)
    return abs(end.balance - begin.balance) / abs(end.work - begin.work)


def any_discs(seed: int) -> lsm.Scene:
    """Any 36 discs: sizes, velocities, rotation, stiffness, restitution and friction are drawn at random."""
    rng = np.random.default_rng(seed)
    return any_grains(rng, [lsm.disc()], ROWS, rng.uniform(0.3, 0.95, ROWS**2))


def any_angular(seed: int) -> lsm.Scene:
    """Any 16 angular grains, drawn like `any_discs`."""
    rng = np.random.default_rng(seed)
    corner, elongation, angularity = rng.uniform(0.05, 0.15), rng.uniform(1.0, 1.8), rng.uniform(0.0, 1.0)
    shapes = lsm.shapes.random_polygons(4, int(rng.integers(1000)), corner, (4, 7), elongation, angularity)
    return any_grains(rng, shapes, 4, rng.uniform(0.5, 0.9, 16))


def any_grains(rng: np.random.Generator, shapes: list[Any], rows: Any, scale: Any) -> lsm.Scene:
    """Grains of these shapes and sizes on a lattice of `rows` rows, with parameters drawn from `rng`."""
    count = rows**2
    stiffness = 10.0 ** rng.uniform(5.0, 8.0)
    shape = rng.integers(0, len(shapes), count)
    size = np.array([s.bounding_radius for s in shapes])[shape] * scale
    pitch = 2.05 * size.max()
    place = pitch * (np.stack(np.divmod(np.arange(count), rows), axis=1) + rng.uniform(-0.01, 0.01, (count, 2)))
    mass = 250.0 * np.pi * scale**2
    fastest = 0.1 * np.min([s.overlap_limit for s in shapes]) * scale.min() * np.sqrt(stiffness / mass.max())
    speed = 10.0 ** rng.uniform(-2.0, 0.0) * fastest  # overlaps stay below a tenth of the radii
    return scene_of(
        place,
        effects_of(stiffness, rng.uniform(0.05, 1.0), rng.choice([0.0, 0.3, 1.0])),
        shapes=shapes,
        shape_index=shape,
        diameter=scale,
        angle=rng.uniform(0.0, 6.0, count),
        velocity=rng.normal(0.0, speed, (count, 2)),
        angular_velocity=rng.normal(0.0, speed, (count, 1)) / scale.max(),
        lengths=(pitch * rows,) * 2,
        periodic=(True, True),
    )


@hard("Any discs", "greatest growth of the energy over that of the start", 5e-3)
def random_discs(bench: Bench) -> float:
    """Not one situation but many: whatever is drawn, the energy may not grow and no number may be lost."""
    seeds = range(bench.steps(60, 6))
    return max(growth(bench.simulate(any_discs(seed)), bench.steps(40_000, 4000)) for seed in seeds)


@hard("Any angular grains", "greatest growth of the energy over that of the start", 5e-3)
def random_angular(bench: Bench) -> float:
    """The same of polygons of any angularity, elongation and roundness."""
    seeds = range(bench.steps(60, 6))
    return max(growth(bench.simulate(any_angular(seed)), bench.steps(40_000, 4000)) for seed in seeds)
