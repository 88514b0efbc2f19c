"""What shearing a layer is expected to take, from its parameters alone: no grain is made."""

from __future__ import annotations

import functools
import json

import numpy as np

import taichi_lsm as lsm
from workflows.common.run_cost import PROCESS_BYTES, RunCost
from workflows.common.small_scenes import scene_of
from workflows.gouge.expected_shear import expected
from workflows.gouge.grain_parameters import GrainParams
from workflows.gouge.layer_scene import LARGEST_SPEED, effects_of, mobile_count, stand_in

TABLE = "layer_costs.json"  # made by workflows/accuracy/prices.py
GRAIN_BYTES = {("round", 2): 1.2e3, ("angular", 2): 2.0e3, ("round", 3): 1.5e3, ("angular", 3): 4.0e3}
SHAPED_STEP = {"whole": 0.85, "breakable": 0.65}  # step of angular grains over that of the squares that stand in
CELL = 1.1  # of the lattice on which the loose grains lie, in the largest of their bounding diameters
REACH = {"round": 1.0, "angular": 1.35}  # bounding diameter of the largest grain over its equivalent one
# Inertial times of the consolidation of a dense start (docs/decisions/0017-dense-start.md); of a loose one, from the
# first contact with the platen on.
SETTLING = {("round", 2): 13.0, ("angular", 2): 29.0, ("round", 3): 15.0, ("angular", 3): 55.0}


@functools.cache
def price_of(shape: str, dim: int) -> dict[str, float]:
    """Measured seconds of the start, per grain and step, and per grain and unit of strain [s]."""
    rows = json.loads(lsm.data_path(TABLE).read_text(encoding="utf-8"))["rows"]
    return next(row for row in rows if (row["shape"], row["dim"]) == (shape, dim))


def start_seconds(params: GrainParams) -> float:
    """Measured time of the start of such a layer [s], most of which is compiling; it cannot be interrupted to tell."""
    return price_of("angular" if params.shape == "angular" else "round", params.dim)["start_seconds"]


def layer_cost(params: GrainParams) -> RunCost:
    """Expected steps, time and memory of one run of a layer; the time is that of a first run, which compiles."""
    p, shape = params, "angular" if params.shape == "angular" else "round"
    kind = (shape, p.dim)
    thickness, lengths = p.layer
    dt = expected_step(p)
    # Consolidation: of a loose start the servo first brings the platen down at its greatest speed.
    fall = 0.0
    if p.start == "loose":
        loose = mobile_count(p) * (CELL * REACH[shape] * p.largest_diameter) ** p.dim / float(np.prod(lengths))
        fall = max(0.0, loose - thickness) / (LARGEST_SPEED * p.diameter)
    strain, shear_time = expected(p)
    steps = p.inertial_time * (fall + SETTLING[kind] + shear_time) / dt
    grains = mobile_count(p) * p.pieces_of_one
    price = price_of(*kind)
    per_grain = price["grain_step_seconds"] * steps + price["grain_strain_seconds"] * strain
    seconds = price["start_seconds"] + grains * per_grain
    return RunCost(steps, seconds, PROCESS_BYTES + GRAIN_BYTES[kind] * grains)


def expected_step(params: GrainParams) -> float:
    """Time step [s] of two grains of the least size, whose frequencies bound those of the layer."""
    p = params
    broken = p.pieces_of_one > 1
    size = p.smallest_diameter / p.pieces_across
    two = scene_of(
        2.0 * size * np.eye(2, p.dim),
        effects_of(p),
        shapes=[stand_in(p.shape, p.dim)],
        diameter=size,
        density=p.density,
        thickness=p.diameter,
        bonds=np.array([[0, 1]]) if broken else None,
        safety=p.step_safety,
    )
    shaped = SHAPED_STEP["breakable" if broken else "whole"] if p.shape == "angular" else 1.0
    return shaped * two.chosen_dt()
