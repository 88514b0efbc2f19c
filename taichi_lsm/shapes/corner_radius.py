"""Corner radii in units of the finished grain, whose size is known only when it is made."""

from __future__ import annotations

from collections.abc import Callable

from ..core.errors import InputError
from .input_checks import check_corner_radius

CORNER_TOLERANCE = 1e-10  # of the equivalent diameter
SECANT_STEPS = 12


def radius_for_corner(least_radius: Callable[[float], float], corner_radius: float, inscribed: float) -> float:
    """The least radius, in the target's unit of length, that is corner_radius in diameters of the finished grain.

    Met to CORNER_TOLERANCE. least_radius: that of the grain made with a least radius in the target's unit, in its own
    equivalent diameters; inscribed: radius of the largest ball within the target, in that unit. InputError if no radius
    below it is right.
    """
    check_corner_radius(corner_radius)
    asked, before = corner_radius * 2.0 * inscribed, (0.0, 0.0)
    for _ in range(SECANT_STEPS):  # a secant on the radius that comes out over the one that was asked for
        if not 0 < asked < inscribed:
            break
        got = least_radius(asked)
        if abs(got - corner_radius) <= CORNER_TOLERANCE:
            return asked
        slope = (got - before[1]) / (asked - before[0])
        before = (asked, got)
        asked += (corner_radius - got) / slope
    raise InputError(f"corner_radius = {corner_radius}: too large for the body; ask for a smaller one")
