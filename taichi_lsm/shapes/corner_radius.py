"""Corner radii in units of the finished grain, whose size is known only when it is made."""

from __future__ import annotations

from collections.abc import Callable

from .base import GrainShape

CORNER_TOLERANCE = 1e-10  # of the equivalent diameter


def meeting_corner(fit: Callable[[float], GrainShape], corner_radius: float, room: float) -> GrainShape:
    """The result of `fit` whose least radius is corner_radius in units of its own equivalent diameter.

    Met to CORNER_TOLERANCE. fit: makes a normalised shape from a least radius in the target's unit of length; room: the
    target's inscribed radius in that unit. Raises ValueError if no radius below it is the right one.
    """
    if not 0 < corner_radius < 0.5:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.5, which is a sphere or disc")
    asked, before = corner_radius * 2.0 * room, (0.0, 0.0)
    for _ in range(12):  # a secant on the radius that comes out over the one that was asked for
        if not 0 < asked < room:
            break
        shape = fit(asked)
        got = shape.overlap_limit
        if abs(got - corner_radius) <= CORNER_TOLERANCE:
            return shape
        slope = (got - before[1]) / (asked - before[0])
        before = (asked, got)
        asked += (corner_radius - got) / slope
    raise ValueError(f"corner_radius = {corner_radius}: too large for the body")
