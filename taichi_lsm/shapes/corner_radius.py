"""Corner radii in units of the finished grain, whose size is known only when it is made."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from ..core.errors import InputError
from .base import GrainShape
from .input_checks import check_corner_radius

CORNER_TOLERANCE = 1e-10  # of the equivalent diameter
SECANT_STEPS = 12

Shape = TypeVar("Shape", bound=GrainShape)


def meeting_corner(fit: Callable[[float], Shape], corner_radius: float, inscribed: float) -> Shape:
    """The result of `fit` whose least radius is corner_radius in units of its own equivalent diameter.

    Met to CORNER_TOLERANCE. fit: makes a normalised shape from a least radius in the target's unit of length;
    inscribed: radius of the largest ball within the target, in that unit. InputError if no radius below it is right.
    """
    check_corner_radius(corner_radius)
    asked, before = corner_radius * 2.0 * inscribed, (0.0, 0.0)
    for _ in range(SECANT_STEPS):  # a secant on the radius that comes out over the one that was asked for
        if not 0 < asked < inscribed:
            break
        shape = fit(asked)
        got = shape.overlap_limit
        if abs(got - corner_radius) <= CORNER_TOLERANCE:
            return shape
        slope = (got - before[1]) / (asked - before[0])
        before = (asked, got)
        asked += (corner_radius - got) / slope
    raise InputError(f"corner_radius = {corner_radius}: too large for the body; ask for a smaller one")
