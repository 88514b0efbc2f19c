"""The equation of a servo, M y'' = F - load - C y' with C = 2 zeta sqrt(M K): of platens, plane walls and the cell.

A servo on the host has the fields `stiffness` K [N m-1], that of the grains as it feels them, `inertia` M [kg],
`speed_limit` [m s-1], the bound on abs(y'), and `damping_ratio` zeta [1].
"""

from typing import Any

import numpy as np

from ..core.errors import finite, require
from ..core.runtime import ti

UNITS = {"stiffness": " N/m", "inertia": " kg", "speed_limit": " m/s", "damping_ratio": ""}


def require_positive(servo: Any, *names: str) -> None:
    """Raise InputError unless these fields of a servo, of those in `UNITS`, are numbers above 0."""
    for name in names:
        value = getattr(servo, name)
        require(finite(value) and value > 0, servo, name, value, f"> 0{UNITS[name]}")


def drag_of(servo: Any) -> float:
    """Drag C [kg s-1] of a servo."""
    return 2.0 * servo.damping_ratio * float(np.sqrt(servo.inertia * servo.stiffness))


@ti.func
def servo_kick(load, drag, limit, inertia, v, force, dt):
    """New velocity [m s-1], work of the stress [J] and energy dissipated [J] of M y'' = F - load - drag y'.

    load [N]: of the stress; drag [kg s-1]; limit [m s-1]: of the speed; inertia [kg]: M; v [m s-1]: velocity; force
    [N]: F, of the grains; dt [s]. The drag is evaluated at the mean velocity of the step, (v + v')/2, so that any C is
    stable.
    """
    a = 0.5 * drag * dt / inertia
    v_new = ((1.0 - a) * v + dt / inertia * (force - load)) / (1.0 + a)
    v_new = ti.max(-limit, ti.min(limit, v_new))
    v_mean = 0.5 * (v + v_new)
    # Impulse of drag and speed limit: the change of momentum that contacts and stress do not explain.
    held = inertia * (v_new - v) - (force - load) * dt
    return v_new, -load * v_mean * dt, -held * v_mean
