"""Panels of a run that not every run has: friction and slip on a spring, and the breakage of bonded grains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflows.plots.canvas import BLUE, ORANGE
from workflows.plots.course import Course
from workflows.plots.friction_axes import axis_limits, draw_zero

if TYPE_CHECKING:
    import xarray

SLIP = 2.0  # velocity of the platen over that of the load point above which it slips


def load_displacement(sheared: xarray.Dataset) -> NDArray:
    """Displacement of the load point since the first row (n,) [m]: the integral of its velocity over time."""
    velocity, time = sheared.load_point_velocity.values, sheared.time.values
    return np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time))])


def count_slips(velocity: NDArray) -> int:
    """Number of slips in velocities (n,) of the platen over that of the load point [1].

    A slip begins where the platen overtakes the load point, counts if it exceeds SLIP times its velocity, and ends
    where it falls behind; so a velocity that fluctuates about the bound is one slip.
    """
    faster = np.concatenate([[False], velocity > 1.0])
    begin = np.flatnonzero(faster[1:] & ~faster[:-1])
    return sum(bool(part.max() > SLIP) for part in np.split(velocity, begin)[1:])


def draw_spring(axes: Any, sheared: xarray.Dataset, letter: str, course: Course | None = None) -> None:
    """Friction at the platen and its velocity over that of the load point, against displacement and time of the latter.

    A row's velocity is the mean since the row before it: 0 while the layer sticks, far above 1 in a slip. The title
    tells how many slips there were. Through stages the load point may stand still or go back: then against `course`.
    """
    if course is not None and "cycle" in sheared:
        _draw_spring_of_stages(axes, sheared, letter, course)
        return
    load, time = 1e6 * load_displacement(sheared), 1e3 * (sheared.time - sheared.time[0]).values
    friction = (sheared.platen_shear_stress / sheared.platen_normal_stress).values
    velocity = 1e6 * np.diff(sheared.displacement.values) / np.diff(load)
    axes.plot(load, friction, color=ORANGE, lw=1.2)
    axes.set(xlim=(0, load[-1]), xlabel="displacement of the load point [µm]")
    axes.set_ylabel("friction at the platen [1]", color=ORANGE)
    axes.set_ylim(axis_limits(friction, space=1.05))
    draw_zero(axes)
    slip = axes.twinx()
    slip.axhline(1.0, color="0.6", lw=0.9, ls=":")
    slip.stairs(velocity, load, color=BLUE, lw=1.0, baseline=None)
    slip.set_ylabel("velocity of the platen / of the load point [1]", color=BLUE)
    slip.set_ylim(axis_limits(velocity, [1.0], space=2.2))  # below the friction
    slip.spines["right"].set_visible(True)
    per_time = load[-1] / time[-1]  # the load point moves at a constant velocity
    above = axes.secondary_xaxis("top", functions=(lambda x: x / per_time, lambda t: t * per_time))
    above.set_xlabel("time since shear began [ms]")
    above.spines["top"].set_visible(True)
    count = count_slips(velocity)
    slips = f"{count} slip{'s' * (count > 1)}, with the platen" if count else "no slip, the platen never"
    axes.set_title(f"({letter}) friction on the spring: {slips} above {SLIP:g} times the velocity of the load point")


def _draw_spring_of_stages(axes: Any, sheared: xarray.Dataset, letter: str, course: Course) -> None:
    """Stretch of the spring, and velocity of the platen over the greatest of the load point."""
    axes.plot(course.values, 1e6 * sheared.spring_stretch.values, color=ORANGE, lw=1.2)
    course.name_axis(axes)
    axes.set_ylabel("stretch of the spring [µm]", color=ORANGE)
    velocity = sheared.plate_velocity.values / max(float(np.abs(sheared.load_point_velocity).max()), 1e-300)
    slip = axes.twinx()
    slip.plot(course.values, velocity, color=BLUE, lw=1.0)
    slip.set_ylabel("velocity / greatest of the load point [1]", color=BLUE)
    slip.set_ylim(axis_limits(velocity, [1.0], space=2.2))  # below the stretch
    slip.spines["right"].set_visible(True)
    axes.set_title(f"({letter}) stretch of the spring and velocity of the platen")


def draw_breakage(axes: Any, sheared: xarray.Dataset, letter: str, course: Course | None = None) -> None:
    """Share of the bonds that have broken since the start of the shear, and the number of fragments.

    Against shear strain, or against `course`.
    """
    course = course or Course(sheared.shear_strain.values, "shear strain [1]")
    bonds, fragments = sheared.bond_count.values, sheared.fragment_count.values
    if bonds[0]:
        axes.plot(course.values, 100.0 * (1.0 - bonds / bonds[0]), color=ORANGE, lw=1.5)
    course.name_axis(axes)
    axes.set_ylabel("bonds broken since shear began [%]", color=ORANGE)
    axes.set_ylim(bottom=0)
    count = axes.twinx()
    count.plot(course.values, fragments, color=BLUE, lw=1.5, ls="--")
    count.set_ylabel("number of fragments [1] (dashed)", color=BLUE)
    count.spines["right"].set_visible(True)
    left = f"{bonds[0]} bonds" if bonds[0] else "no bond was left when shear began"
    axes.set_title(f"({letter}) breakage: {left}, {fragments[0]} to {fragments[-1]} fragments")
