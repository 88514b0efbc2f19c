"""Drives of a platen along one axis: at rest, at a velocity, by a spring, or under a servo-controlled stress."""

from dataclasses import dataclass

import numpy as np

from ..core.errors import InputError
from ..core.runtime import ti

VALUES = 4  # numbers per driven axis in the parameter field


def _require(condition, drive, name, value, allowed):
    if not condition:
        raise InputError(f"{type(drive).__name__}.{name} = {value!r}: must be {allowed}")


@ti.data_oriented
@dataclass
class Fixed:
    """The platen does not move along this axis."""

    def values(self, area):
        return ()

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """(new velocity, external work [J], dissipated [J]) for parameters p, velocity v, contact force, mass."""
        return 0.0 * v, 0.0 * v, 0.0 * v


@ti.data_oriented
@dataclass
class ConstantVelocity:
    """The platen moves at `velocity` [m s-1], reached at `acceleration` [m s-2] (at once if infinite)."""

    velocity: float
    acceleration: float = np.inf

    def __post_init__(self):
        _require(np.isfinite(self.velocity), self, "velocity", self.velocity, "a finite number, m/s")
        _require(self.acceleration > 0, self, "acceleration", self.acceleration, "> 0 m/s2")

    def values(self, area):
        return (self.velocity, min(self.acceleration, 1e300))

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """The drive supplies whatever force keeps the velocity; its work is booked as external."""
        step = p[1] * dt
        v_new = v + ti.max(-step, ti.min(step, p[0] - v))
        work = (mass * (v_new - v) - force * dt) * 0.5 * (v + v_new)
        return v_new, work, 0.0 * v


@ti.data_oriented
@dataclass
class SpringLoadPoint:
    """A load point at `velocity` V [m s-1] pulls the platen by a spring: M x'' = F_contact + K (V t - x).

    stiffness K [N m-1]: of the loading frame; inertia M [kg]: of the platen with what moves along, at least the glued
    mass. The spring starts without tension and keeps its stretch when the values change. `work` is what the spring
    does on the platen; K stretch^2/2 lies in the spring, and their sum is the work of the load point.
    """

    velocity: float
    stiffness: float
    inertia: float

    def __post_init__(self):
        _require(np.isfinite(self.velocity), self, "velocity", self.velocity, "a finite number, m/s")
        for name, unit in (("stiffness", "N/m"), ("inertia", "kg")):
            value = getattr(self, name)
            _require(np.isfinite(value) and value > 0, self, name, value, f"> 0 {unit}")

    def check_step(self, dt):
        """Raise InputError if the platen on its spring is too quick for the step [s]: half of what is stable."""
        most = self.inertia / dt**2
        _require(self.stiffness <= most, self, "stiffness", self.stiffness, f"<= inertia/dt^2 = {most:g} N/m")

    def values(self, area):
        return (self.velocity, self.stiffness)

    @ti.func
    def pull(self, p, v, force, mass, stretch, dt):
        """As `kick` of the other drives, with the spring's stretch [m] before and, as the last result, after."""
        tension = p[1] * stretch
        v_new = v + dt / mass * (force + tension)
        return v_new, tension * 0.5 * (v + v_new) * dt, 0.0 * v, stretch + (p[0] - v_new) * dt


@ti.data_oriented
@dataclass
class ServoStress:
    """Servo-controlled normal stress: M y'' = (sigma_contact - sigma) A - C y', y pointing away from the layer.

    stress sigma [Pa], compression positive; outward +1 or -1: sign of "away from the layer" along the axis;
    stiffness K [N m-1]: of the layer as the platen feels it, for C = 2 zeta sqrt(M K); damping_ratio zeta [-];
    inertia M [kg] at least the glued mass; speed_limit [m s-1]: bound on abs(y').
    Without a contact the platen falls at most at speed_limit, so lost contacts are found again gently.
    """

    stress: float
    outward: int
    stiffness: float
    inertia: float
    speed_limit: float
    damping_ratio: float = 0.2

    def __post_init__(self):
        _require(np.isfinite(self.stress) and self.stress > 0, self, "stress", self.stress, "> 0 Pa")
        _require(self.outward in (-1, 1), self, "outward", self.outward, "-1 or 1")
        for name in ("stiffness", "inertia", "speed_limit", "damping_ratio"):
            value = getattr(self, name)
            _require(np.isfinite(value) and value > 0, self, name, value, "> 0")

    def values(self, area):
        drag = 2.0 * self.damping_ratio * np.sqrt(self.inertia * self.stiffness)
        return (self.stress * area * self.outward, drag, self.speed_limit, self.inertia)

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """Drag is taken at the mean velocity, so any C is stable; what it and the speed limit take is booked."""
        inertia = p[3]
        a = 0.5 * p[1] * dt / inertia
        v_new = ((1.0 - a) * v + dt / inertia * (force - p[0])) / (1.0 + a)
        v_new = ti.max(-p[2], ti.min(p[2], v_new))
        v_mean = 0.5 * (v + v_new)
        held = inertia * (v_new - v) - (force - p[0]) * dt
        return v_new, -p[0] * v_mean * dt, -held * v_mean
