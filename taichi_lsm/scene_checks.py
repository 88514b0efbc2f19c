"""What a scene must fulfil before anything is compiled. Every refusal names the parameter, its value and the bound."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .bonds.bond_setup import checked_bonds
from .boundaries.periodic_cell import check_box, check_shear
from .boundaries.wall_setup import check_walls
from .contact.surface_kinds import CURVED, kind_of
from .core.errors import InputError
from .core.fields import orientation_size, rotation_size
from .effects.base import Effect

if TYPE_CHECKING:
    from .scene import Scene

UNIT_TOLERANCE = 1e-9  # of the norm of a unit quaternion


def check_scene(scene: Scene) -> None:
    """Raise InputError if the completed `scene` contradicts itself; sorts its bonds."""
    _check_arrays(scene)
    _check_values(scene)
    _check_tables(scene)
    _check_effects(scene)
    scene.bonds = checked_bonds(scene.bonds, scene.effects, len(scene.position))
    for effect in scene.effects:
        effect.check(scene)
    if not (np.isfinite(scene.skin) and scene.skin > 0):
        raise InputError(f"Scene.skin: {scene.skin!r} m, must be > 0")
    check_box(scene.lengths, scene.periodic, scene.widest(), scene.skin)
    _check_shapes(scene)
    check_walls(scene)
    check_shear(scene)


def check_orientation(scene: Scene) -> None:
    """Raise InputError if orientations are given in the form of the other dimension."""
    given, other = ("angle", "orientation") if scene.dim == 2 else ("orientation", "angle")
    if getattr(scene, other) is not None:
        raise InputError(f"Scene.{other}: given in {scene.dim}D, where `{given}` says how a grain is turned")


def _check_arrays(scene: Scene) -> None:
    """Shapes of all arrays; numbers that are finite."""
    n = len(scene.position)
    expected = {
        "position": (n, scene.dim),
        "diameter": (n,),
        "shape_index": (n,),
        "platen_index": (n,),
        **({"angle": (n,)} if scene.dim == 2 else {"orientation": (n, orientation_size(3))}),
        "velocity": (n, scene.dim),
        "angular_velocity": (n, rotation_size(scene.dim)),
    }
    for name, shape in expected.items():
        value = getattr(scene, name)
        if value.shape != shape:
            raise InputError(f"Scene.{name}: array of shape {value.shape}, must be {shape}")
        if not np.isfinite(value).all():
            raise InputError(f"Scene.{name}: grain {np.argwhere(~np.isfinite(value))[0][0]} is not finite")
    for name in ("lengths", "periodic"):
        if len(getattr(scene, name)) != scene.dim:
            raise InputError(f"Scene.{name}: {len(getattr(scene, name))} values, must be one per axis ({scene.dim})")


def _check_values(scene: Scene) -> None:
    """Numbers that must be positive."""
    if not (scene.diameter > 0).all():
        raise InputError(f"Scene.diameter: least value {scene.diameter.min():g} m, must be > 0")
    if not (np.isfinite(scene.density) and scene.density > 0):
        raise InputError(f"Scene.density: {scene.density!r} kg/m3, must be > 0")
    if scene.dim == 3 and np.abs(np.linalg.norm(scene.orientation, axis=1) - 1.0).max() > UNIT_TOLERANCE:
        raise InputError("Scene.orientation: must be unit quaternions (w, x, y, z) to 1e-9")


def _check_tables(scene: Scene) -> None:
    """Indices into the tables of shapes and platens."""
    if scene.shape_index.min() < 0 or scene.shape_index.max() >= len(scene.shapes):
        raise InputError(
            f"Scene.shape_index: {scene.shape_index.min()}..{scene.shape_index.max()}, "
            f"must be 0..{len(scene.shapes) - 1}"
        )
    if scene.platen_index.max() >= len(scene.platens) or scene.platen_index.min() < -1:
        raise InputError(
            f"Scene.platen_index: {scene.platen_index.min()}..{scene.platen_index.max()}, must be -1 for mobile grains "
            f"or a row of Scene.platens, which has {len(scene.platens)}"
        )


def _check_effects(scene: Scene) -> None:
    """Effects that can act together, and with the integrator."""
    if not all(isinstance(e, Effect) for e in scene.effects):
        raise InputError(f"Scene.effects: {scene.effects!r}, must be instances of Effect")
    names = [e.name for e in scene.effects]
    if len(set(names)) < len(names):
        raise InputError(f"Scene.effects: {names}, each effect may be listed once")
    for role in sorted({e.role for e in scene.effects if e.role}):
        same = [e.name for e in scene.effects if e.role == role]
        if len(same) > 1:
            raise InputError(f"Scene.effects: {same} are all laws of {role}, one may be listed")
    lossy = [e.name for e in scene.effects if e.dissipates]
    if scene.integrator.conservative and lossy:
        raise InputError(f"Scene.integrator: {scene.integrator.__name__} is for scenes without losses, not {lossy}")


def _check_shapes(scene: Scene) -> None:
    """Shapes of this dimension, of one kind of surface, which has the curvature that the effects need."""
    wrong = [s.name for s in scene.shapes if s.dim != scene.dim]
    if wrong:
        raise InputError(f"Scene.shapes: {wrong[0]!r} is not a shape in {scene.dim}D")
    kind = kind_of(scene.shapes)
    curved = [e.name for e in scene.effects if "reduced_radius" in e.needs]
    if curved and kind not in CURVED:
        raise InputError(
            f"Scene.effects: {curved} need one radius of curvature at the contact, which grains with {kind} "
            f"surfaces do not have; shapes must be discs, spheres or arc chains"
        )
