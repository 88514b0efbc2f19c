"""The servo of a plane wall, which keeps the force on it by moving it along its normal, and the state of the servos.

M y'' = F - P - C y' with y positive away from the grains, F their normal force on the wall and P the force that the
servo keeps: the equation of a platen under `ServoStress`. Kernels count along the normal, towards the grains.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import read, write
from ..core.errors import InputError, finite, require
from ..core.fields import allocate
from ..core.runtime import ti
from ..core.schema import Variable
from .servo import UNITS, drag_of, require_positive, servo_kick

VALUES = 4  # of a servo, as the kernel reads them: force, drag, limit of the speed and mass
SERVO_ROWS = [
    Variable("values", ("wall", "value"), "f64", "1", "values of the servo, in their own units; 0 without one", True),
    Variable("push", ("wall",), "f64", "N", "force of the grains along the normal, impulses as force over dt", True),
    Variable("last_velocity", ("wall", "space"), "f64", "m s-1", "velocity of the wall a step before", True),
    Variable("dissipated", ("wall",), "f64", "J", "energy that drag and speed limit dissipated", True),
]


@dataclass(frozen=True)
class WallServo:
    """Servo-controlled normal force on a plane wall: M y'' = F_contact - P - C y', y pointing away from the grains.

    Parameters
    ----------
    force : float
        Normal force P with which the wall presses on the grains [N], > 0. Of a stress: times the area on which it acts,
        in a periodic cell that of the cell square to the wall.
    stiffness : float
        Stiffness K of the grains as the wall feels it [N m-1], > 0; it sets the drag C = 2 zeta sqrt(M K).
    inertia : float
        Mass M of the wall [kg], > 0, for its motion along the normal alone.
    speed_limit : float
        Bound on abs(y') [m s-1], > 0.
    damping_ratio : float
        Damping ratio zeta [-], > 0.

    Raises
    ------
    InputError
        If a value is not allowed.

    Notes
    -----
    Equation and damping ratio are those of a platen under `ServoStress`. The wall has no weight, and contacts feel it
    as of infinite mass. Below M = K dt^2 a time step dt cannot follow the wall and is refused. What the drag and the
    speed limit take from it is dissipated energy.
    """

    force: float
    stiffness: float
    inertia: float
    speed_limit: float
    damping_ratio: float = 0.2

    def __post_init__(self) -> None:
        require(finite(self.force) and self.force > 0, self, "force", self.force, "> 0 N")
        require_positive(self, *UNITS)

    def check_step(self, dt: float) -> None:
        """Raise InputError unless the time step dt [s] resolves the wall on the grains, K <= M/dt^2.

        See `SpringLoadPoint.check_step`.
        """
        least = self.stiffness * dt**2
        allowed = f">= stiffness dt^2 = {least:g} kg, for the wall oscillates on the grains; raise it or lower the step"
        require(self.inertia >= least, self, "inertia", self.inertia, allowed)

    def values(self) -> tuple[float, float, float, float]:
        """Numbers that the kernel reads: force P [N], drag C [kg s-1], speed limit [m s-1] and mass M [kg]."""
        return (self.force, drag_of(self), self.speed_limit, self.inertia)


@ti.data_oriented
class WallServos:
    """State of the servos of all walls of a scene, in which at least one wall has a servo.

    Parameters
    ----------
    count, dim
        Number of walls, and of axes.
    """

    def __init__(self, count: int, dim: int) -> None:
        for name, field in vars(allocate(SERVO_ROWS, count, {"space": dim, "value": VALUES})).items():
            setattr(self, name, field)

    def begin(self, servos: Sequence[WallServo | None], velocity: NDArray) -> None:
        """Start again: no force is known, nothing is dissipated.

        servos: of each wall, None for one without; velocity (wall, dim): of the walls [m s-1].
        """
        write(self.values, [servo.values() if servo else (0.0,) * VALUES for servo in servos])
        write(self.last_velocity, velocity)
        for row in (self.push, self.dissipated):
            write(row, np.zeros(len(servos)))

    def set(self, w: int, name: str, servo: WallServo, dt: float) -> None:
        """Change the servo of wall w, called `name`, to one of the same inertia; dt [s]: the time step.

        Raises
        ------
        InputError
            If it is no servo, the wall had none at the start, the inertia differs, or the step cannot follow it.
        """
        values = read(self.values)
        if not isinstance(servo, WallServo) or not values[w, 3] > 0.0:
            raise InputError(f"wall {name!r}: servo = {servo!r}, must be a WallServo for a wall that begins with one")
        inertia = float(values[w, 3])
        require(servo.inertia == inertia, servo, "inertia", servo.inertia, f"{inertia!r} kg as at the start")
        servo.check_step(dt)
        values[w] = servo.values()
        write(self.values, values)

    def driven(self) -> NDArray:
        """Whether each wall has a servo (wall,)."""
        return read(self.values)[:, 3] > 0.0

    def energies(self, walls: Any, dt: float) -> tuple[float, float]:
        """Kinetic energy M y'^2/2 of the walls that servos move, and the energy that these dissipated [J].

        Both at the time of the positions: the first half of the next kick is added. walls: the walls; dt [s]: the time
        step, 0 where velocities belong to the time of the positions.
        """
        driven = self.driven()
        normal = read(walls.normal)
        v, force = ((read(row) * normal).sum(axis=1)[driven] for row in (walls.velocity, walls.force))
        keeps, drag, limit, mass = read(self.values)[driven].T
        # Impulses belong to the step that has ended, of the forces a half to that and a half to the next one.
        gained = dt * (0.5 * (force + keeps) + read(self.push)[driven] - force)
        after = np.clip(v + (gained - 0.5 * dt * drag * v) / mass, -limit, limit)
        held = mass * (after - v) - gained
        lost = read(self.dissipated).sum() - (held * 0.5 * (v + after)).sum()
        return float(0.5 * (mass * after**2).sum()), float(lost)

    @ti.func
    def note_force(self, w, force, impulse, dt):
        """Keep the force [N] and the impulse [N s] of the grains on wall w along its normal, after a step of dt [s]."""
        self.push[w] = force
        if dt > 0.0:
            self.push[w] = force + impulse / dt

    @ti.func
    def imposed(self, w, v, n):
        """The velocity [m s-1] of wall w that its servo does not give it: v without its normal component."""
        result = v
        if self.values[w][3] > 0.0:
            result = v - v.dot(n) * n
        return result

    @ti.func
    def kick(self, w, v, n, dt):
        """Velocity [m s-1] of wall w after the kick of a step of dt [s], and the work of its servo in the step [J].

        v: before; n: normal. The force of the servo is constant, so that its work depends on the path alone.
        """
        self.last_velocity[w] = v
        p, after, work = self.values[w], v, 0.0 * dt
        if p[3] > 0.0:
            before = v.dot(n)
            speed, _, lost = servo_kick(-p[0], p[1], p[2], p[3], before, self.push[w], dt)
            after = v + (speed - before) * n
            work = p[0] * speed * dt
            self.dissipated[w] = self.dissipated[w] + lost
        return after, work


def check_wall_servo(wall: Any, normal: NDArray, integrator: type) -> None:
    """Refuse a servo that makes no sense.

    Parameters
    ----------
    wall : PlaneWall
        Without a servo it always passes.
    normal
        Unit normal of the wall (dim,).
    integrator
        Class of the time integration.

    Raises
    ------
    InputError
        If the servo is none, the wall has a velocity along its normal as well, or steps have several lengths.
    """
    if wall.servo is None:
        return
    if not isinstance(wall.servo, WallServo):
        raise InputError(f"wall {wall.name!r}: servo = {wall.servo!r}, must be WallServo(...), or None")
    require_along(wall.name, wall.velocity, normal)
    if integrator.conservative:
        raise InputError(
            f"wall {wall.name!r}: servo with {integrator.__name__}, whose steps differ in length; "
            "must be a Verlet scheme"
        )


def check_servo_steps(walls: Sequence[Any], dt: float) -> None:
    """Raise InputError unless a time step dt [s] resolves every wall that a servo moves."""
    for wall in walls:
        if wall.servo is not None:
            wall.servo.check_step(dt)


def require_along(name: str, velocity: Any, normal: NDArray) -> None:
    """Raise InputError unless the velocity of the wall `name`, which has a servo, lies along the plane."""
    value = np.broadcast_to(np.asarray(velocity, float), normal.shape)
    if abs(value @ normal) > 1e-12 * np.linalg.norm(value):
        raise InputError(
            f"wall {name!r}: velocity = {velocity!r}, must lie along the wall, whose servo moves it along its normal"
        )
