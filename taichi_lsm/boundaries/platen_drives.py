"""Drives of a platen along one axis: at rest, at a velocity, by a spring, or under a servo-controlled stress.

Those of tests at an imposed shear stress or a constant normal stiffness are in `stress_drives`.

A drive is a dataclass on the host and one Taichi function in the step. `values(area)` gives the numbers that the
kernel reads, at most VALUES of them, as the argument `p`. `kick` or, for a drive with a spring, `pull` advances the
velocity of the platen by one step and returns the work of the drive and the energy that it dissipates in it.
"""

from dataclasses import dataclass

import numpy as np

from ..core.errors import finite, require
from ..core.runtime import ti
from .servo import UNITS, drag_of, require_positive, servo_kick

VALUES = 4  # numbers per driven axis in the parameter field
UNBOUNDED = 1e300  # stands for infinity in kernels


@ti.data_oriented
@dataclass
class Fixed:
    """The platen does not move along this axis."""

    def values(self, area: float) -> tuple[float, ...]:
        """Numbers that the kernel reads; none."""
        return ()

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """New velocity [m s-1], work of the drive [J] and energy dissipated [J]; all zero.

        p: values of the drive; v [m s-1]: velocity; force [N]: of the contacts on the platen; mass [kg]; dt [s].
        """
        return 0.0 * v, 0.0 * v, 0.0 * v


@ti.data_oriented
@dataclass
class ConstantVelocity:
    """The platen moves at a constant velocity, which it reaches at a constant acceleration.

    Parameters
    ----------
    velocity : float
        Velocity along the axis [m s-1].
    acceleration : float
        Rate at which the velocity is reached [m s-2], > 0; at once if infinite.

    Raises
    ------
    InputError
        If a value is not allowed.
    """

    velocity: float
    acceleration: float = np.inf

    def __post_init__(self) -> None:
        require(finite(self.velocity), self, "velocity", self.velocity, "a finite number, m/s")
        rate = self.acceleration
        require(rate == np.inf or (finite(rate) and rate > 0), self, "acceleration", rate, "> 0 m/s2")

    def values(self, area: float) -> tuple[float, ...]:
        """Numbers that the kernel reads: velocity [m s-1] and acceleration [m s-2]."""
        return (self.velocity, min(self.acceleration, UNBOUNDED))

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """As `Fixed.kick`; the drive supplies whatever force keeps the velocity, and does its work.

        Work of the step: (M (v' - v) - F_contact dt) (v + v')/2, the impulse of the drive times the mean velocity.
        """
        step = p[1] * dt
        v_new = v + ti.max(-step, ti.min(step, p[0] - v))
        work = (mass * (v_new - v) - force * dt) * 0.5 * (v + v_new)
        return v_new, work, 0.0 * v


@ti.data_oriented
@dataclass
class SpringLoadPoint:
    """A load point at constant velocity pulls the platen by a spring: M x'' = F_contact + K (V t - x).

    Parameters
    ----------
    velocity : float
        Velocity V of the load point [m s-1].
    stiffness : float
        Stiffness K of the loading frame [N m-1], > 0.
    inertia : float
        Mass M of the platen with what moves along [kg], at least the mass of the glued grains.

    Raises
    ------
    InputError
        If a value is not allowed.

    Notes
    -----
    The spring starts without tension and keeps its stretch when the values change. `work` is what the spring does on
    the platen. The spring stores K stretch^2/2; the sum of both is the work of the load point.
    """

    velocity: float
    stiffness: float
    inertia: float

    def __post_init__(self) -> None:
        require(finite(self.velocity), self, "velocity", self.velocity, "a finite number, m/s")
        for name, unit in (("stiffness", "N/m"), ("inertia", "kg")):
            value = getattr(self, name)
            require(finite(value) and value > 0, self, name, value, f"> 0 {unit}")

    def check_step(self, dt: float, area: float) -> None:
        """Raise InputError unless the time step dt [s] resolves the platen on its spring, whatever its area.

        Verlet is stable up to dt = 2 sqrt(M/K); half of that is allowed, hence K <= M/dt^2.
        """
        most = self.inertia / dt**2
        require(self.stiffness <= most, self, "stiffness", self.stiffness, f"<= inertia/dt^2 = {most:g} N/m")

    def values(self, area: float) -> tuple[float, ...]:
        """Numbers that the kernel reads: velocity [m s-1] and stiffness [N m-1]."""
        return (self.velocity, self.stiffness)

    @ti.func
    def pull(self, p, v, force, mass, stretch, dt):
        """As `Fixed.kick`, with the stretch of the spring [m] before and, as the last result, after the step."""
        tension = p[1] * stretch
        v_new = v + dt / mass * (force + tension)
        return v_new, tension * 0.5 * (v + v_new) * dt, 0.0 * v, stretch + (p[0] - v_new) * dt


@ti.data_oriented
@dataclass
class ServoStress:
    """Servo-controlled normal stress: M y'' = (sigma_contact - sigma) A - C y', y pointing away from the layer.

    Parameters
    ----------
    stress : float
        Normal stress sigma [Pa], compression positive, > 0.
    outward : int
        Sign of "away from the layer" along the axis, 1 or -1.
    stiffness : float
        Stiffness K of the layer as the platen feels it [N m-1], > 0; it sets the drag C = 2 zeta sqrt(M K).
    inertia : float
        Mass M [kg], at least the mass of the glued grains.
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
    A platen without a contact falls at most at the speed limit, so that it returns to the layer gently.
    """

    stress: float
    outward: int
    stiffness: float
    inertia: float
    speed_limit: float
    damping_ratio: float = 0.2

    def __post_init__(self) -> None:
        require(finite(self.stress) and self.stress > 0, self, "stress", self.stress, "> 0 Pa")
        require(self.outward in (-1, 1), self, "outward", self.outward, "-1 or 1")
        require_positive(self, *UNITS)

    def values(self, area: float) -> tuple[float, ...]:
        """Numbers that the kernel reads: force of the stress [N], drag C [kg s-1], speed limit [m s-1] and mass [kg].

        area [m2]: surface of the platen on which the stress acts.
        """
        return (self.stress * area * self.outward, drag_of(self), self.speed_limit, self.inertia)

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """As `Fixed.kick`; what the drag and the speed limit take from the platen is dissipated energy."""
        return servo_kick(p[0], p[1], p[2], p[3], v, force, dt)
