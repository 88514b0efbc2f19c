"""Drives of a platen for tests at an imposed shear stress and at a constant normal stiffness.

They are as those of `platen_drives`; scenes without them compile nothing of them.
"""

from dataclasses import dataclass

import numpy as np

from ..core.errors import finite, require
from ..core.runtime import ti
from .platen_drives import UNBOUNDED, ServoStress

AT_VELOCITY, UNDER_STRESS = 0.0, 1.0  # which of the two a platen is driven by, as kernels read it


@ti.data_oriented
@dataclass
class VelocityOrStress:
    """The platen moves at a velocity, or a shear stress pushes it, M x'' = F_contact + tau A; whichever is given.

    Parameters
    ----------
    inertia : float
        Mass M of the platen with what moves along [kg], at least the mass of the glued grains.
    velocity : float, optional
        Velocity along the axis [m s-1], reached at a constant acceleration.
    stress : float, optional
        Stress tau on the platen along the axis [Pa], in place of the velocity.
    acceleration : float
        Rate at which the velocity is reached [m s-2], > 0; at once if infinite.

    Raises
    ------
    InputError
        If a value is not allowed, or not one of velocity and stress is given.

    Notes
    -----
    Under a stress nothing but the layer holds the platen: above the strength of the layer it is accelerated without
    bound. `Platens.set` changes from one to the other; the platen keeps its velocity and its mass, so that the budget
    of energy has no jump.
    """

    inertia: float
    velocity: float | None = None
    stress: float | None = None
    acceleration: float = np.inf

    def __post_init__(self) -> None:
        require(finite(self.inertia) and self.inertia > 0, self, "inertia", self.inertia, "> 0 kg")
        rate = self.acceleration
        require(rate == np.inf or (finite(rate) and rate > 0), self, "acceleration", rate, "> 0 m/s2")
        if self.stress is None:
            require(finite(self.velocity), self, "velocity", self.velocity, "a finite number, m/s, or stress be given")
        else:
            require(finite(self.stress), self, "stress", self.stress, "a finite number, Pa")
            require(self.velocity is None, self, "velocity", self.velocity, "None where a stress is given")

    def values(self, area: float) -> tuple[float, ...]:
        """Numbers that the kernel reads: which of the two drives, and its velocity and acceleration or its force [N].

        area [m2]: surface of the platen on which the stress acts.
        """
        if self.stress is None:
            return (AT_VELOCITY, float(self.velocity or 0.0), min(self.acceleration, UNBOUNDED))
        return (UNDER_STRESS, self.stress * area)

    @ti.func
    def kick(self, p, v, force, mass, dt):
        """As `ConstantVelocity.kick`; under a stress its impulse is tau A dt and its work tau A (v + v')/2 dt."""
        step = p[2] * dt
        driven = v + ti.max(-step, ti.min(step, p[1] - v))
        pushed = v + dt / mass * (force + p[1])
        v_new = ti.select(p[0] == UNDER_STRESS, pushed, driven)
        work = (mass * (v_new - v) - force * dt) * 0.5 * (v + v_new)
        return v_new, work, 0.0 * v


@ti.data_oriented
@dataclass
class ServoWithSpring(ServoStress):
    """Servo with a spring behind it: sigma = sigma_0 + k_n (y - y_0), a boundary of constant normal stiffness.

    The platen obeys M y'' = (sigma_contact - sigma) A - C y' as under `ServoStress`; the stress rises with its distance
    y - y_0 from where it was when the stiffness was first above 0, and is never below 0.

    Parameters
    ----------
    normal_stiffness : float
        Stiffness k_n of the spring over the area of the platen [Pa m-1], >= 0; 0: the spring is not yet put in.

    Raises
    ------
    InputError
        If a value is not allowed.

    Notes
    -----
    `stress`, the first parameter of the servo, is sigma_0. `work` is what servo and spring together do on the platen;
    the spring stores A k_n (y - y_0)^2/2 of it.
    """

    normal_stiffness: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        given = self.normal_stiffness
        require(finite(given) and given >= 0, self, "normal_stiffness", given, ">= 0 Pa/m")

    def check_step(self, dt: float, area: float) -> None:
        """Raise InputError unless the time step dt [s] resolves the platen of area [m2] on the spring, k_n A <= M/dt^2.

        See `SpringLoadPoint.check_step`.
        """
        most = self.inertia / dt**2 / area
        given = self.normal_stiffness
        require(given <= most, self, "normal_stiffness", given, f"<= inertia/(dt^2 area) = {most:g} Pa/m")

    def stress_at(self, stretch: float) -> float:
        """Normal stress [Pa]; stretch [m]: displacement of the platen along its axis since the spring was put in."""
        return max(0.0, self.stress + self.normal_stiffness * self.outward * stretch)

    def values(self, area: float) -> tuple[float, ...]:
        """Numbers that the kernel reads: as of `ServoStress`, but k_n A [N m-1] in place of the mass."""
        return (*super().values(area)[:3], self.normal_stiffness * area)

    @ti.func
    def pull(self, p, v, force, mass, stretch, dt):
        """As `ServoStress.kick`, with the displacement of the platen [m] since the spring was put in.

        stretch: before the step; the last result is that after it.
        """
        outward = ti.select(p[0] > 0.0, 1.0, -1.0)
        servo = p
        servo[0] = outward * ti.max(0.0, outward * (p[0] + p[3] * stretch))
        servo[3] = mass
        v_new, work, lost = self.kick(servo, v, force, mass, dt)
        return v_new, work, lost, ti.select(p[3] > 0.0, stretch + v_new * dt, 0.0)
