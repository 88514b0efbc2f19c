"""The servo of a cell without walls: what keeps its normal stress by its height, and which scenes may have one."""

from dataclasses import dataclass
from typing import Any

from ..core.errors import InputError, finite, require
from .servo import drag_of, require_positive


@dataclass(frozen=True)
class CellServo:
    """Servo-controlled normal stress of a cell: M h'' = (sigma_yy - sigma) A - C h', h the height of the cell.

    Parameters
    ----------
    stress : float
        Normal stress sigma [Pa], compression positive, > 0.
    stiffness : float
        Stiffness K of the grains as the height feels it [N m-1], > 0; it sets the drag C = 2 zeta sqrt(M K).
    inertia : float
        Mass M of the height [kg], > 0.
    speed_limit : float
        Bound on abs(h') [m s-1], >= 0; 0 holds the height, so that the volume of the cell is constant.
    damping_ratio : float
        Damping ratio zeta [-], > 0.
    least_height : float
        Height [m] below which the servo does not press the cell, >= 0.

    Raises
    ------
    InputError
        If a value is not allowed.

    Notes
    -----
    sigma_yy is the total normal stress of the cell, of contacts and of the motion of the grains relative to the mean
    flow; A is the area of the cell square to y. The equation of a platen under `ServoStress`, with the height of the
    cell for that of the platen; see `boundaries/driven_cell.py` for how the grains follow.
    """

    stress: float
    stiffness: float
    inertia: float
    speed_limit: float
    damping_ratio: float = 0.2
    least_height: float = 0.0

    def __post_init__(self) -> None:
        require(finite(self.stress) and self.stress > 0, self, "stress", self.stress, "> 0 Pa")
        require_positive(self, "stiffness", "inertia", "damping_ratio")
        require(finite(self.least_height) and self.least_height >= 0, self, "least_height", self.least_height, ">= 0 m")
        limit = self.speed_limit
        require(finite(limit) and limit >= 0, self, "speed_limit", limit, ">= 0 m/s, 0 for a constant height")

    @property
    def drag(self) -> float:
        """Drag C of the height [kg s-1]."""
        return drag_of(self)


def check_servo(scene: Any) -> None:
    """Refuse a scene whose cell cannot have a height that moves.

    Parameters
    ----------
    scene : Scene
        The scene; without a servo it always passes.

    Raises
    ------
    InputError
        If the servo is no `CellServo`, the cell is not periodic along every axis, an area of platens is given, there
        are bonds, or the integrator makes steps of several lengths.
    """
    servo = scene.cell_servo
    if servo is None:
        return
    if not isinstance(servo, CellServo):
        raise InputError(f"Scene.cell_servo: {servo!r}, must be CellServo(...), or None for a cell of constant height")
    if not all(scene.periodic):
        raise InputError("Scene.cell_servo: needs a cell that is periodic along every axis; see Scene.periodic")
    if scene.area is not None:
        raise InputError(f"Scene.area: {scene.area:g} m2, must be left out with a cell_servo: its area is of the cell")
    if scene.bonds is not None:
        raise InputError("Scene.bonds: must be left out with a cell_servo, which does not know the stress of bonds")
    if scene.integrator.conservative:
        name = scene.integrator.__name__
        raise InputError(f"Scene.cell_servo: with {name}, whose steps differ in length; must be a Verlet scheme")
