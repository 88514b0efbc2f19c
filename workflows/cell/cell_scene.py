"""The scene of a cell before consolidation: grains that do not touch, in a box that is periodic along every axis."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.cell.parameters import CellParams
from workflows.common.refusals import check_idle, in_terms_of
from workflows.common.reports import Progress
from workflows.common.small_scenes import scene_of
from workflows.gouge.grain_parameters import EFFECTS_HELP, MOST_GRAINS
from workflows.gouge.initial_grains import (
    Unplaced,
    densest_height,
    initial_orientations,
    least_cell,
    lengths_as_options,
    unplaced_grains,
)
from workflows.gouge.layer_scene import LARGEST_SPEED, check_steps, check_stiffness, effects_of, mobile_count, stand_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

INERTIA = 1e-3  # of the height at least, in masses of the grains; docs/decisions/0022
STEPS = 0.5  # angle by which the height, on the stiffness of the grains, oscillates in a step at most [rad]
DAMPING_RATIO = 0.1  # of the height
WIDE = 100.0  # of a cell in which effects are tried out [diameters]


def check(params: CellParams) -> None:
    """Refuse parameters that are sure to fail, before any grain is made.

    Raises
    ------
    InputError
        For options without effect, more grains than a process can hold, a cell in which a grain would touch its own
        image, or effects that are wrong or do not suit grains of this shape, or a mean flow.
    """
    p = params
    check_idle(p)
    if mobile_count(p) > MOST_GRAINS:
        height, lengths = p.layer
        raise lsm.InputError(
            f"--cell-height {height / p.diameter:g}, --length {lengths[0] / p.diameter:g}: the cell has "
            f"{mobile_count(p):.3g} grains, must be <= {MOST_GRAINS:g}; make it smaller"
        )
    least_cell(p, p.largest_diameter, "grains")
    with in_terms_of("effects", EFFECTS_HELP):
        scene_of(
            2.0 * np.eye(2, p.dim),
            effects_of(p),
            shapes=[stand_in(p.shape, p.dim)],
            lengths=(WIDE,) * p.dim,
            periodic=(True,) * p.dim,
            cell_servo=lsm.CellServo(1.0, 1.0, 1.0, 1.0),
        )
    check_stiffness(p)


def build(params: CellParams, progress: Progress | None = None) -> lsm.Scene:
    """The scene before consolidation, at rest.

    Parameters
    ----------
    params
        Of the cell.
    progress
        Takes reports on the shapes that are made.

    Raises
    ------
    InputError
        If the parameters give no such cell; the message names options.
    """
    p, d, dim = params, params.diameter, params.dim
    check(p)
    rng = np.random.default_rng(p.seed)
    one = lsm.disc() if dim == 2 else lsm.sphere()
    table, grains = unplaced_grains(p, rng, mobile_count(p), [one], progress)
    position, height = _placed(p, rng, grains)
    _, lengths = p.layer
    solid = (d if dim == 2 else 1.0) * one.measure * float((grains.diameter**dim).sum())
    servo = _servo(p, solid)
    if servo.least_height > height:
        raise lsm.InputError(
            f"--solid-fraction {p.solid_fraction:g}: the grains fill {solid / (p.area * height):.3g} of the cell "
            "before it is pressed, must be more than that; give --start loose, or a higher fraction"
        )
    with in_terms_of(lengths_as_options(p), "make the cell larger, or the range of the effects shorter"):
        scene = lsm.Scene(
            dim=dim,
            lengths=(lengths[0], height, *lengths[1:]),
            periodic=(True,) * dim,
            shapes=table,
            shape_index=grains.kind,
            position=position,
            diameter=grains.diameter,
            **initial_orientations(grains.rotation, 0),
            density=p.density,
            effects=effects_of(p),
            cell_servo=servo,
            thickness=d,
            safety=p.step_safety,
        )
    check_steps(scene, p)
    # As light as the time step allows: the lighter the height, the closer it follows the stress.
    scene.cell_servo = replace(servo, inertia=max(servo.inertia, servo.stiffness * (scene.chosen_dt() / STEPS) ** 2))
    return scene


def _servo(p: CellParams, solid: float) -> lsm.CellServo:
    """The servo of grains that fill a volume [m3]; its greatest speed is that of the upper border, or of a platen."""
    (height, lengths), d = p.layer, p.diameter
    fastest = max(LARGEST_SPEED * d, p.inertial_number * height) / p.inertial_time
    return lsm.CellServo(
        stress=p.normal_stress,
        stiffness=p.stiffness * float(np.prod(lengths)) / d ** (p.dim - 2) / height,
        inertia=INERTIA * p.density * solid,
        speed_limit=fastest,
        damping_ratio=DAMPING_RATIO,
        least_height=solid / (p.area * p.solid_fraction) if p.solid_fraction else 0.0,
    )


def _placed(p: CellParams, rng: np.random.Generator, grains: Unplaced) -> tuple[NDArray, float]:
    """Places of grains (n, dim) [m] without overlap, also of their images, and the height of the cell [m]."""
    lengths, reach = p.layer[1], grains.reach
    least_cell(p, 2.0 * float(reach.max()), "grains")
    if p.start == "loose":
        place = lsm.loose_packing(rng, reach, lengths, p.dim)
        return place, float((place[:, 1] + reach).max() - (place[:, 1] - reach).min())
    nothing = np.zeros((0, p.dim)), np.zeros(0)
    with in_terms_of("--start dense", "give --start loose"):
        place, raised = lsm.dense_packing(rng, *grains[:4], lengths, (nothing, nothing), densest_height(p, grains))
    # Centres lie between the two borders of the packing: beyond them is room for the outermost grains.
    return place, raised + 2.0 * float(reach.max())
