"""Hard cases of places and lists: far away, in the same place, in cells too small, one grain and none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, hard, refused

STIFFNESS = 1e6  # [N m-1]
ROWS = 6  # of a square lattice of discs
SIDE = 7.0  # of the periodic square [m]
STEPS = 2000
BEFORE_CHAOS = 300  # steps in which a difference of the last bits grows a hundredfold


def gas(offset: ArrayLike = 0.0, skin: float | None = 0.1, speed: float = 1.0) -> lsm.Scene:
    """36 discs in a periodic square at random velocities, all moved by `offset` [m] along both axes."""
    rng = np.random.default_rng(1)
    place = np.stack(np.divmod(np.arange(ROWS**2), ROWS), axis=1) * (SIDE / ROWS)
    place = place + rng.uniform(-0.05, 0.05, place.shape)
    effects = [lsm.LinearElastic(STIFFNESS), lsm.CoulombFriction(0.3, 0.5 * STIFFNESS)]
    velocity = rng.normal(0.0, speed, place.shape)
    cell: dict[str, Any] = {"lengths": (SIDE, SIDE), "periodic": (True, True)}
    return scene_of(np.asarray(offset, float) + place, effects, velocity=velocity, skin=skin, **cell)


def flown(bench: Bench, scene: lsm.Scene, steps: int) -> Any:
    """Positions (n, dim) [m] after `steps` steps less those of the start."""
    sim = bench.simulate(scene)
    sim.run(steps)
    return sim.state.position.to_numpy() - scene.position


@hard(
    "Coordinates of 1e5 diameters",
    "difference from the displacements near 0, in diameters",
    1e-7,
    f32_bound=1e-5,
)
def far_from_the_origin(bench: Bench) -> float:
    """After long shear grains have gone many times around the cell.

    In single precision a coordinate of 1e5 diameters is known to a hundredth of a diameter, ten times an overlap;
    positions are kept in double precision always.
    """
    near, far = (flown(bench, gas(offset=x), BEFORE_CHAOS) for x in (0.0, 1e5))
    return float(np.abs(near - far).max())


@hard("List rebuilt in every step, and never", "difference of the positions, in diameters", 0.0)
def any_list(bench: Bench) -> float:
    """The list of neighbours is a matter of speed.

    Whether it is rebuilt in every step or never, whatever the order in which pairs are found, the same bits must come
    out.
    """
    steps = bench.steps(20_000, STEPS)
    every, never = flown(bench, gas(skin=1e-9), steps), flown(bench, gas(skin=2.0), steps)
    return float(np.abs(every - never).max())


@hard("Two grains in the same place", "started simulations of two", 0.0)
def coincident_centres(bench: Bench) -> float:
    """Between coincident centres there is no normal: a division by zero, and a NaN that spreads.

    Both grains are named, discs as well as grains of arcs.
    """
    round_grains = gas()
    round_grains.position[1] = round_grains.position[0]
    return named_at_start(bench, round_grains) + named_at_start(bench, angular_pair(0.0))


def named_at_start(bench: Bench, scene: lsm.Scene) -> float:
    """0 if the simulation of the scene stops at its start and names the grains 0 and 1, else 1."""
    try:
        bench.simulate(scene).run(1)
    except lsm.SimulationError as error:
        return float(set(error.grains) != {0, 1})
    return 1.0


def angular_pair(apart: float) -> lsm.Scene:
    """Two equal angular grains of equal orientation, `apart` [m]."""
    shapes = {"shapes": lsm.shapes.random_angular_shapes(1, 1), "shape_index": [0, 0], "angle": np.zeros(2)}
    return scene_of([(0.0, 0.0), (apart, 0.0)], [lsm.LinearElastic(STIFFNESS)], **shapes)


def scattered(distance: float) -> lsm.Scene:
    """18 pairs of discs about to collide, spread over `distance` [m] of open space."""
    rng = np.random.default_rng(2)
    middle = np.repeat(rng.uniform(-distance, distance, (ROWS**2 // 2, 2)), 2, axis=0)
    side = np.tile([(-0.6, 0.0), (0.6, 0.0)], (ROWS**2 // 2, 1))
    effects = [lsm.LinearElastic(STIFFNESS), lsm.CoulombFriction(0.3, 0.5 * STIFFNESS)]
    return scene_of(middle + side, effects, velocity=-side)


@hard("Collisions spread over a million diameters", "collisions that were missed", 0.0)
def spread_in_open_space(bench: Bench) -> float:
    """A grid of cells that covers everything would hold 1e12 of them.

    Hashed cells hold grains from far apart in one list. No collision may be missed, and none added.
    """
    scene = scattered(1e6)
    sim = bench.simulate(scene)
    sim.run(STEPS)
    turned_back = sim.state.velocity.to_numpy()[:, 0] * scene.velocity[:, 0] < 0.0
    return float((~turned_back).sum()) / 2.0


@hard("One grain", "error of its displacement over a diameter", 1e-9)
def one_grain(bench: Bench) -> float:
    """No pair, an empty list, a cell that is all its own neighbours: the grain flies on as if nothing was there."""
    cell = {"lengths": (3.0, 3.0), "periodic": (True, True)}
    scene = scene_of([(1.0, 1.0)], [lsm.LinearElastic(STIFFNESS)], velocity=np.array([(3.0, -2.0)]), **cell)
    sim = bench.simulate(scene)
    sim.run(bench.steps(1_000_000, 10_000))
    return float(np.abs(sim.state.position.to_numpy() - scene.position - sim.time * scene.velocity).max() / sim.time)


@hard("No grain", "0 if refused with the reason", 0.0)
def no_grain(bench: Bench) -> float:
    """Empty arrays pass through many a program until something divides by their length."""
    return refused(lambda: scene_of(np.empty((0, 2)), [lsm.LinearElastic(STIFFNESS)]), "no grains", "at least one")


@hard("Grain larger than half of its cell", "accepted cells of two that are too small", 0.0)
def cell_too_small(bench: Bench) -> float:
    """A grain that meets its neighbour on both sides, or its own image, needs more than the nearest image.

    A code that considers one loses a contact without a word. The least length is named.
    """
    effects = [lsm.LinearElastic(STIFFNESS)]
    cells = ({"lengths": (1.9, 9.0), "periodic": (True, False)}, {"lengths": (9.0, 0.5), "periodic": (False, True)})
    return float(sum(math.isinf(refused(lambda c=c: scene_of([(0, 0)], effects, **c), "must be >=")) for c in cells))
