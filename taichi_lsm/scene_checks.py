"""What a scene must fulfil before anything is compiled. Every refusal names the parameter, its value and the bound."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .bonds.bond_setup import checked_bonds
from .boundaries.cell_servo import check_servo
from .boundaries.periodic_cell import check_box, check_shear
from .boundaries.platens import Platen
from .boundaries.wall_setup import PlaneWall, check_walls
from .contact.surface_kinds import kind_of
from .core.errors import InputError, finite
from .core.fields import orientation_size, rotation_size
from .effects.base import Effect
from .shapes import GrainShape
from .stepping.guards import Guards
from .stepping.verlet import VelocityVerlet

if TYPE_CHECKING:
    from .scene import Scene

UNIT_TOLERANCE = 1e-9  # of the norm of a unit quaternion, and of the radius of equal arcs
TABLES = {"effects": Effect, "shapes": GrainShape, "platens": Platen, "walls": PlaneWall}  # classes of their entries


def float_array(name: str, given: Any) -> NDArray:
    """Array of the floats given for the field `name`; InputError if they are no numbers or do not form an array."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        raise InputError(f"Scene.{name}: {reprlib.repr(given)}, must be numbers, equally many in each row") from None


def index_array(name: str, given: Any, default: int) -> NDArray:
    """Array of the int32 given for the field `name`, `default` if it is None; InputError for anything else."""
    array = np.asarray(default) if given is None else float_array(name, given)
    with np.errstate(invalid="ignore"):  # of what is not finite or too large, which the comparison finds
        whole = array.astype(np.int32)
    wrong = array[whole != array]
    if len(wrong):
        raise InputError(f"Scene.{name}: {wrong[0]:g}, must be whole numbers, rows of a table")
    return whole


def check_scene(scene: Scene) -> None:
    """Raise InputError if the completed `scene` contradicts itself; sorts its bonds."""
    _check_arrays(scene)
    _check_axes(scene)
    _check_values(scene)
    _check_settings(scene)
    for name, entry in TABLES.items():
        _check_entries(scene, name, entry)
    _check_indices(scene)
    _check_effects(scene)
    area = None if scene.bond_area is None else float_array("bond_area", scene.bond_area)
    scene.bonds, scene.bond_area = checked_bonds(scene.bonds, area, scene.effects, len(scene.position))
    for effect in scene.effects:
        effect.check(scene)
    check_box(scene.lengths, scene.periodic, scene.widest(), scene.skin)
    _check_shapes(scene)
    check_walls(scene)
    check_shear(scene)
    check_servo(scene)


def check_orientation(scene: Scene) -> None:
    """Raise InputError if orientations are given in the form of the other dimension."""
    given, other = ("angle", "orientation") if scene.dim == 2 else ("orientation", "angle")
    if getattr(scene, other) is not None:
        raise InputError(f"Scene.{other}: given in {scene.dim}D, where `{given}` gives the orientations")


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


def _check_axes(scene: Scene) -> None:
    """One length and one truth value per axis."""
    for name, kind in (("lengths", "a number"), ("periodic", "True or False")):
        given = getattr(scene, name)
        if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
            raise InputError(f"Scene.{name}: {given!r}, must be {kind} per axis ({scene.dim})")
        if len(given) != scene.dim:
            raise InputError(f"Scene.{name}: {len(given)} values, must be one per axis ({scene.dim})")
        for value in given:
            number = isinstance(value, int | float | np.number | np.bool_) and not np.isnan(value)
            if not number or (name == "periodic" and value not in (0, 1)):
                raise InputError(f"Scene.{name}: {value!r}, must be {kind} per axis")


def _check_values(scene: Scene) -> None:
    """Numbers that must be positive; unit quaternions."""
    if not (scene.diameter > 0).all():
        raise InputError(f"Scene.diameter: least value {scene.diameter.min():g} m, must be > 0")
    units = {"density": " kg/m3", "thickness": " m", "skin": " m", "safety": ""}
    for name, unit in (units | ({} if scene.area is None else {"area": " m2"})).items():
        value = getattr(scene, name)
        if not (finite(value) and value > 0):
            raise InputError(f"Scene.{name}: {value!r}{unit}, must be > 0")
    if not finite(scene.shear_rate):
        raise InputError(f"Scene.shear_rate: {scene.shear_rate!r} s-1, must be a finite number, 0 for a cell at rest")
    if scene.dim == 3 and np.abs(np.linalg.norm(scene.orientation, axis=1) - 1.0).max() > UNIT_TOLERANCE:
        raise InputError("Scene.orientation: must be unit quaternions (w, x, y, z) to 1e-9")


def _check_settings(scene: Scene) -> None:
    """How the scene is run: class of the integration, switches, guards."""
    integrator = scene.integrator
    if not (isinstance(integrator, type) and issubclass(integrator, VelocityVerlet)):
        raise InputError(f"Scene.integrator: {integrator!r}, must be a class such as OnsetVerlet, not its name")
    if not isinstance(scene.guards, Guards):
        raise InputError(f"Scene.guards: {scene.guards!r}, must be Guards(...), in which None switches a guard off")
    for name in ("track_dissipation", "track_contacts"):
        if not isinstance(getattr(scene, name), bool | np.bool_):
            raise InputError(f"Scene.{name}: {getattr(scene, name)!r}, must be True or False")
    if scene.track_contacts and not scene.track_dissipation:
        raise InputError("Scene.track_contacts: True, must be False without track_dissipation, of which it is a part")
    if not (scene.parallel is None or isinstance(scene.parallel, bool | np.bool_)):
        raise InputError(f"Scene.parallel: {scene.parallel!r}, must be True, False or None")


def _check_entries(scene: Scene, name: str, entry: type) -> None:
    """A sequence of instances of the class `entry`; there is at least one shape."""
    given = getattr(scene, name)
    if not isinstance(given, Sequence) or not all(isinstance(e, entry) for e in given):
        raise InputError(f"Scene.{name}: {reprlib.repr(given)}, must be instances of {entry.__name__}, in a list")
    if name == "shapes" and len(given) == 0:
        raise InputError("Scene.shapes: none, must be at least one, or left out for discs or spheres")


def _check_indices(scene: Scene) -> None:
    """Rows of the tables of shapes and platens."""
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
    names = [e.name for e in scene.effects]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(f"Scene.effects: {repeated}, each effect may be listed once")
    for role in sorted({e.role for e in scene.effects if e.role}):
        same = [e.name for e in scene.effects if e.role == role]
        if len(same) > 1:
            raise InputError(f"Scene.effects: {same} are all effects of {role}, one may be listed")
    lossy = [e.name for e in scene.effects if e.dissipates]
    if scene.integrator.conservative and lossy:
        raise InputError(f"Scene.integrator: {scene.integrator.__name__} is for scenes without losses, not {lossy}")


def _check_shapes(scene: Scene) -> None:
    """Shapes of this dimension, of one kind of surface, with one radius of curvature where an effect wants it."""
    wrong = [s.name for s in scene.shapes if s.dim != scene.dim]
    if wrong:
        raise InputError(f"Scene.shapes: {wrong[0]!r} is not a shape in {scene.dim}D")
    kind_of(scene.shapes)  # refuses shapes that cannot stand beside each other
    local = [e.name for e in scene.effects if e.local_radius]
    # The radii of a polyhedron take a while: they are asked for only where an effect depends on them.
    uneven = [s.name for s in scene.shapes if not _locally_even(s)] if local else []
    if uneven:
        raise InputError(
            f"Scene.effects: {local} with the local radius of curvature, which jumps at the seams of {uneven[0]!r} and "
            f"is not defined on edges: no step would conserve the energy; use radius = 'equivalent'"
        )


def _locally_even(shape: GrainShape) -> bool:
    """Whether every surface point of each part has one radius of curvature, the same on all patches of the part."""
    if shape.kind == "cones":  # patches that are not full spheres are pieces of one surface
        radius, half_angle = shape.patches()[1], shape.patches()[3]
        return bool(np.all(half_angle >= np.pi)) or _one_radius(radius)
    if shape.kind == "polyhedron":  # more faces meet in edges
        return all(part.patch_count == 1 for part in shape.parts)
    return all(_one_radius(part.patches()[1]) for part in shape.parts)


def _one_radius(radius: NDArray) -> bool:
    """Whether all these radii are the same."""
    return bool(np.ptp(radius) <= UNIT_TOLERANCE * radius.max())
