"""The scene of a layer of gouge before consolidation: bottom platen, mobile grains, top platen."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.common.parameters import option_name
from workflows.common.refusals import check_idle, in_terms_of
from workflows.common.reports import Progress
from workflows.common.small_scenes import scene_of
from workflows.gouge.expected_shear import expected
from workflows.gouge.grain_parameters import EFFECTS_HELP, MOST_GRAINS, PACKED, GrainParams
from workflows.gouge.initial_grains import (
    breakable_grains,
    initial_orientations,
    least_cell,
    lengths_as_options,
    whole_grains,
)
from workflows.gouge.layer_parameters import LEAST_INERTIA, SPRINGS, LayerParams

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from taichi_lsm.effects import Effect
    from taichi_lsm.shapes import GrainShape

BOND_WIDTH = 0.55  # of the bonds between pieces in 2D, in their diameter: about the side that two tiles share
BOND_AREA = 0.25  # likewise in 3D, of the faces that two pieces share, in squared diameters of a piece
BOND_POISSON = 0.25
BOND_ANGLE = float(np.arctan(0.75))  # internal friction of rock
LARGEST_SPEED = 0.1  # of the servo, in diameters per inertial time
ROUNDING = 1e-9  # by which a stiffness number may miss its bound, as that of a modulus given in round numbers does
MOST_STEPS = 1e10  # of a run: a month, even of the smallest layer


def check(params: LayerParams) -> None:
    """Refuse parameters that are sure to fail, before any grain is made.

    Raises
    ------
    InputError
        For options without effect, more grains than a process can hold, a cell in which a grain would touch its own
        image, or effects that are wrong or do not suit the shape and dimension of the grains.
    """
    p = params
    check_idle(p)
    _check_count(p)
    least_cell(p, p.platen_roughness * p.largest_diameter, "grains of the platens")
    least_cell(p, p.largest_diameter, "grains")
    _check_effects(p)


def _check_effects(p: LayerParams) -> None:
    """Refuse effects that cannot act together, or not on grains of this shape and dimension."""
    effects = effects_of(p)
    with in_terms_of("effects", EFFECTS_HELP):
        scene_of(
            2.0 * np.eye(2, p.dim),
            effects,
            shapes=[stand_in(p.shape, p.dim)],
            bonds=np.array([[0, 1]]) if p.breakable else None,
        )
    check_stiffness(p)


def check_stiffness(p: GrainParams) -> None:
    """Refuse contacts of angular grains that are too soft for their corners, of whatever effects."""
    number, least = p.stiffness / (p.normal_stress * p.diameter), p.least_stiffness_number
    if p.shape == "angular" and number < least * (1.0 - ROUNDING):
        raise lsm.InputError(
            f"effects: stiffness number {number:.3g} of the contacts, must be >= {least:g} with --corner-radius "
            f"{p.corner_radius:g}: overlaps would exceed a tenth of what the corners can carry; make them stiffer"
        )


@functools.cache
def stand_in(shape: str, dim: int) -> GrainShape:
    """A grain with surfaces of the kind that layers of this `shape` have; made in less than a second."""
    if shape == "round":
        return lsm.disc() if dim == 2 else lsm.sphere()
    if dim == 2:
        return lsm.shapes.from_polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], 0.1)
    return lsm.shapes.from_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, 0.5), 0.1)


def mobile_count(params: GrainParams) -> int:
    """Number of mobile grains: as given, or as many as give the consolidated layer its thickness."""
    thickness, lengths = params.layer
    one = lsm.disc() if params.dim == 2 else lsm.sphere()
    filled = PACKED[params.dim] * thickness * float(np.prod(lengths))
    return params.grains or round(filled / (one.measure * params.diameter**params.dim))


def _check_count(p: LayerParams) -> None:
    """Refuse layers of more grains, mobile and glued, than a process can hold."""
    least = p.platen_roughness * p.smallest_diameter
    # In 3D the columns of a platen lie closer where sizes differ much, so that none passes: see rough_platen.
    pitch = least if p.dim == 2 else min(1.3 * least, 0.9 * p.platen_roughness * p.diameter)
    glued = 2.0 * float(np.prod([length / pitch + 1.0 for length in p.layer[1]]))
    mobile = mobile_count(p) * (p.pieces if p.breakable else 1)
    if mobile + glued > MOST_GRAINS:
        thickness, lengths = p.layer
        many = f"--grains {p.grains}" if p.grains else f"--layer-thickness {thickness / p.diameter:g}"
        raise lsm.InputError(
            f"{many}, --length {lengths[0] / p.diameter:g}: the layer has "
            f"{mobile + glued:.3g} grains, {glued:.3g} of them in the platens, must be <= {MOST_GRAINS:g}; make it "
            f"smaller, or its sizes from --smallest-diameter {p.smallest_diameter:g} m to --largest-diameter "
            f"{p.largest_diameter:g} m more equal"
        )


def build(params: LayerParams, progress: Progress | None = None, shapes: Sequence[GrainShape] = ()) -> lsm.Scene:
    """The scene before consolidation: bottom platen, mobile grains, top platen.

    Parameters
    ----------
    params
        Of the layer.
    progress
        Takes reports on the shapes that are made.
    shapes
        Shapes of whole angular grains, of equivalent diameter 1, in place of random ones. They are packed as they are:
        grains whose shapes are changed after `build` may overlap.

    Raises
    ------
    InputError
        If the parameters give no such layer; the message names options.
    """
    p, d, dim = params, params.diameter, params.dim
    check(p)
    rng = np.random.default_rng(p.seed)
    _, lengths = p.layer
    area = float(np.prod(lengths)) * (d if dim == 2 else 1.0)
    one = lsm.disc() if dim == 2 else lsm.sphere()
    smallest, largest = p.platen_roughness * p.smallest_diameter, p.platen_roughness * p.largest_diameter
    low, high = (lsm.rough_platen(rng, smallest, largest, lengths, dim) for _ in range(2))
    if p.breakable:
        grains = breakable_grains(p, rng, mobile_count(p), (low, high), [one], progress)
    else:
        grains = whole_grains(p, rng, mobile_count(p), (low, high), [one], progress, shapes)
    position = np.concatenate([grains.position, low[0], high[0]])
    sizes, glued = grains.diameter, np.repeat([0, 1], [len(low[0]), len(high[0])])
    position[len(sizes) :, 1] += np.array(grains.platen_heights)[glued]

    servo = _servo(p, sizes, high[1])
    still = [lsm.Fixed()] * (dim - 2)
    # All other values are checked above: only the cell can still be too small for the skin and the range of effects.
    with in_terms_of(lengths_as_options(p), "make the layer larger, or the range of the effects shorter"):
        scene = lsm.Scene(
            dim=dim,
            lengths=(lengths[0], np.inf, *lengths[1:]),
            periodic=(True, False, True)[:dim],
            shapes=grains.shapes,
            shape_index=np.concatenate([grains.shape_index, np.zeros(len(glued), int)]),
            position=position,
            diameter=np.concatenate([sizes, low[1], high[1]]),
            **initial_orientations(grains.rotation, len(glued)),
            density=p.density,
            platen_index=np.concatenate([np.full(len(sizes), -1), glued]),
            platens=[
                lsm.Platen("bottom", [lsm.Fixed()] * dim),
                lsm.Platen("top", [shear_drive(p, 0.0, servo.inertia), servo, *still]),
            ],
            effects=effects_of(p),
            bonds=grains.bonds,
            bond_area=grains.bond_area,
            thickness=d,
            area=area,
            safety=p.step_safety,
        )
    check_steps(scene, p)
    _check_springs(scene, p, servo.inertia)
    return scene


def _servo(p: LayerParams, mobile: NDArray, glued: NDArray) -> lsm.ServoStress:
    """The servo of the normal stress, for diameters [m] of the mobile grains and of those of the top platen.

    A spring behind it is put in when shear begins.
    """
    d, (thickness, lengths) = p.diameter, p.layer
    one = lsm.disc() if p.dim == 2 else lsm.sphere()
    unit_mass = p.density * one.measure * (d if p.dim == 2 else 1.0)
    layer_mass, glued_mass = (unit_mass * (sizes**p.dim).sum() for sizes in (mobile, glued))
    kind = lsm.ServoWithSpring if p.normal_stiffness else lsm.ServoStress
    return kind(
        stress=p.normal_stress,
        outward=1,
        stiffness=p.stiffness * float(np.prod(lengths)) / d ** (p.dim - 2) / thickness,
        inertia=max(glued_mass, LEAST_INERTIA * layer_mass),
        speed_limit=LARGEST_SPEED * d / p.inertial_time,
    )


def check_steps(scene: lsm.Scene, p: GrainParams) -> None:
    """Refuse runs of too many steps."""
    dt = scene.chosen_dt()
    _, shear_time = expected(p)
    steps = shear_time * p.inertial_time / dt
    if not steps <= MOST_STEPS:
        raise lsm.InputError(
            f"{p.how_far()}, --inertial-number {p.inertial_number:g}: the run would have {steps:.2g} "
            f"steps of {dt:.2g} s, must be <= {MOST_STEPS:g}; shear less far, lower --stiffness-number "
            f"{p.stiffness_number:g}, or raise --inertial-number or --step-safety {p.step_safety:g}"
        )


def _check_springs(scene: lsm.Scene, p: LayerParams, inertia: float) -> None:
    """Refuse springs of the load point or behind the servo that are too stiff for the step."""
    dt = scene.chosen_dt()
    most = inertia / dt**2
    if p.normal_stiffness and p.normal_stiffness * p.area > most:
        raise lsm.InputError(
            f"--normal-stiffness {p.normal_stiffness:g} Pa/m: must be <= {most / p.area:g} Pa/m, for the top platen to "
            f"be resolved by steps of {dt:.2g} s; lower it, or --step-safety {p.step_safety:g}"
        )
    if p.spring and p.spring > most:
        name = next(name for name in SPRINGS if getattr(p, name))
        given, unit = getattr(p, name), {"load_stiffness": " N/m", "load_stiffness_area": " Pa/m"}.get(name, "")
        raise lsm.InputError(
            f"{option_name(name)} {given:g}{unit}: must be <= {given * most / p.spring:g}{unit}, for the top "
            f"platen to be resolved by steps of {dt:.2g} s; lower it, or --step-safety {p.step_safety:g}"
        )


def effects_of(params: GrainParams) -> list[Effect]:
    """Effects of the contacts: elastic, damped, frictional; a given effect replaces the default of its kind."""
    p = params
    usual = [
        lsm.LinearElastic(p.stiffness),
        lsm.ViscousDamping(restitution=p.restitution),
        lsm.CoulombFriction(p.friction, p.tangential_ratio * p.stiffness),
    ]
    given = p.given_effects()
    taken = {effect.role or effect.phase for effect in given}
    usual += [_bond(p)] if isinstance(p, LayerParams) and p.breakable else []
    return [effect for effect in usual if (effect.role or effect.phase) not in taken] + given


def _bond(p: LayerParams) -> lsm.effects.ElasticBrittleBond:
    """Bonds about as stiff as a contact, of the strength asked for.

    Softer ones would let pieces overlap under pressure by more than contacts do, and a break would add energy.
    """
    return lsm.effects.ElasticBrittleBond(
        youngs_modulus=p.stiffness / bond_length(p.diameter, p.dim, p.pieces),
        poissons_ratio=BOND_POISSON,
        cohesion=p.bond_strength * p.normal_stress * np.tan(BOND_ANGLE),
        friction_angle=BOND_ANGLE,
        radius_ratio=BOND_WIDTH,
        weibull_modulus=np.inf if p.weibull_modulus is None else p.weibull_modulus,
        weibull_seed=0 if p.weibull_modulus is None else p.seed,
    )


def bond_length(diameter: float, dim: int, pieces: int) -> float:
    """Length A/L [m] of an average bond in grains of a diameter [m]: its stiffness k_n = E A/L over its modulus.

    In 2D that is (width R T)/(2 R) with the thickness T = d, in 3D a face of BOND_AREA over the diameter of a piece.
    """
    return BOND_WIDTH * diameter if dim == 2 else BOND_AREA * diameter / pieces ** (1.0 / 3.0)


def shear_drive(
    params: LayerParams, velocity: float, inertia: float, change: float = 0.0
) -> lsm.SpringLoadPoint | lsm.ConstantVelocity | lsm.VelocityOrStress:
    """The drive of the top platen along the shear, at a velocity.

    Parameters
    ----------
    params
        Of the run: with a load stiffness the drive is a load point with its spring, else the velocity of the platen
        changes over one inertial time; where a stage has a shear stress, it can be changed to that.
    velocity
        Of the load point or the platen [m s-1].
    inertia
        Of the platen on its spring or under a shear stress [kg].
    change
        Of the velocity of the platen [m s-1].
    """
    p = params
    if p.spring:
        return lsm.SpringLoadPoint(velocity, p.spring, inertia)
    acceleration = max(abs(change), 1e-3 * p.diameter) / p.inertial_time
    if p.pushed:
        return lsm.VelocityOrStress(inertia, velocity=velocity, acceleration=acceleration)
    return lsm.ConstantVelocity(velocity, acceleration=acceleration)
