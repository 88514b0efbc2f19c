"""Plane walls of a scene before anything is compiled: what defines a wall, and the checks of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .wall_servo import WallServo, check_wall_servo

ROUNDING = 1e-12  # of a unit normal along a periodic axis, as sine and cosine of a right angle leave it


@dataclass
class PlaneWall:
    """Half-space beyond a plane: at rest, at a constant velocity, or under a servo-controlled normal force.

    Parameters
    ----------
    name : str
        Name in files and error messages.
    point : tuple (dim,)
        Point on the plane at the start [m].
    normal : tuple (dim,)
        Normal of the plane into the grains, of any length. Along a periodic axis it has no component; 1e-12 of its
        length is taken for rounding and set to 0.
    velocity : tuple (dim,) or 0
        Constant velocity [m s-1]; along the plane it drags the grains. `Walls.set_velocity` changes it between runs.
    rigid : bool
        Whether the wall yields to no force: then E* = E/(1 - nu^2) and G* = E/(2 (1 + nu) (2 - nu)) of `Hertz` and
        `Mindlin`, twice those of two like bodies. Else it is of the material of the grains. Springs of a given
        stiffness (`LinearElastic`) have it at either.
    servo : WallServo or None
        What moves the wall along its normal, from rest, to keep the normal force on it; the velocity then lies along
        the plane. `Walls.set_servo` changes its force between runs. None: the wall keeps its velocity.
    """

    name: str
    point: tuple
    normal: tuple
    velocity: tuple | float = 0.0
    rigid: bool = False
    servo: WallServo | None = None


def check_walls(scene: Any) -> None:
    """Refuse walls that make no sense in a scene.

    Parameters
    ----------
    scene : Scene
        The scene; without walls it always passes.

    Raises
    ------
    InputError
        If a name is missing or not unique, a point, normal or velocity is not a finite vector, a normal is zero or
        points along a periodic axis, a shape has no single deepest point, a mobile grain starts beyond a wall, a wall
        is rigid to forces that know of no modulus, or a servo makes no sense.
    """
    names = [wall.name for wall in scene.walls]
    if len(set(names)) < len(names) or not all(names):
        raise InputError(f"Scene.walls: names {names}, must be given and all different")
    kinds = sorted({s.name for s in scene.shapes if s.kind == "cones" or len(s.parts) > 1})
    if scene.walls and kinds:
        raise InputError(f"Scene.walls: {kinds[0]!r} has more than one part or general cones: no single deepest point")
    for wall in scene.walls:
        for name in ("point", "normal", "velocity"):
            given = getattr(wall, name)
            value = as_vector(given)
            at_rest = name == "velocity" and value.shape == () and value == 0.0
            if not at_rest and (value.shape != (scene.dim,) or not np.isfinite(value).all()):
                raise InputError(f"wall {wall.name!r}: {name} = {given!r}, must be {scene.dim} finite numbers")
        if not isinstance(wall.rigid, bool | np.bool_):
            raise InputError(f"wall {wall.name!r}: rigid = {wall.rigid!r}, must be True or False")
        if wall.rigid and not any("reduced_radius" in effect.needs for effect in scene.effects):
            raise InputError(
                f"wall {wall.name!r}: rigid = True, but no effect has a modulus: must be False, or list Hertz"
            )
        if not np.any(np.asarray(wall.normal, float)):
            raise InputError(f"wall {wall.name!r}: normal = {wall.normal!r}, must not be zero")
        normal = unit_normal(wall.normal, scene.periodic)
        for axis in np.flatnonzero(scene.periodic):
            if normal[axis] != 0.0:
                raise InputError(
                    f"wall {wall.name!r}: normal = {wall.normal!r}, must be zero along the periodic axis {'xyz'[axis]} "
                    f"to {ROUNDING:g} of its length; incline the gravity, or let the cell be open along that axis"
                )
        check_wall_servo(wall, normal, scene.integrator)
        height = (scene.position - np.asarray(wall.point, float)) @ normal
        beyond = np.flatnonzero((height <= 0.0) & (scene.platen_index < 0))
        if len(beyond):
            raise InputError(f"wall {wall.name!r}: the centre of grain {beyond[0]} starts beyond it, must be inside")


def unit_normal(normal: Any, periodic: Any) -> NDArray:
    """Unit vector (dim,) of a normal; a component along a periodic axis that is but rounding becomes 0.

    normal (dim,): not zero; periodic (dim,): whether the cell repeats along each axis.
    """
    unit = np.asarray(normal, float)
    # By a power of 2, which rounds nothing: squares of very long or short ones would be infinite or zero.
    unit = np.ldexp(unit, -np.frexp(np.abs(unit).max())[1])
    unit = unit / np.linalg.norm(unit)
    unit[np.asarray(periodic, bool) & (np.abs(unit) <= ROUNDING)] = 0.0
    return unit


def as_vector(given: Any) -> NDArray:
    """Array of the numbers that were given; an empty one, which no check accepts, if they are no numbers."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        return np.empty(0)
