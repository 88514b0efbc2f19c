"""Panels of a run that not every run has: stick-slip on a spring, and the breakage of bonded grains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflows.plots.canvas import BLUE, ORANGE

if TYPE_CHECKING:
    import xarray


def load_displacement(sheared: xarray.Dataset) -> NDArray:
    """Displacement of the load point since the first row (n,) [m]: the integral of its velocity over time."""
    velocity, time = sheared.load_point_velocity.values, sheared.time.values
    return np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time))])


def draw_stick_slip(axes: Any, sheared: xarray.Dataset, letter: str) -> None:
    """Friction at the platen and its velocity over that of the load point, against displacement and time of the latter.

    A row's velocity is the mean since the row before it: 0 while the layer sticks, far above 1 in a slip.
    """
    load, time = 1e6 * load_displacement(sheared), 1e3 * (sheared.time - sheared.time[0]).values
    friction = (sheared.platen_shear_stress / sheared.platen_normal_stress).values
    velocity = 1e6 * np.diff(sheared.displacement.values) / np.diff(load)
    axes.plot(load, friction, color=ORANGE, lw=1.2)
    axes.set(xlim=(0, load[-1]), xlabel="displacement of the load point [µm]")
    axes.set_ylabel("friction at the platen [1]", color=ORANGE)
    axes.set_ylim(0, 1.05 * friction.max())
    slip = axes.twinx()
    slip.axhline(1.0, color="0.6", lw=0.9, ls=":")
    slip.stairs(velocity, load, color=BLUE, lw=1.0, baseline=None)
    slip.set_ylabel("velocity of the platen / of the load point [1]", color=BLUE)
    slip.set_ylim(min(0.0, velocity.min()), 2.2 * velocity.max())  # below the friction
    slip.spines["right"].set_visible(True)
    per_time = load[-1] / time[-1]  # the load point moves at a constant velocity
    above = axes.secondary_xaxis("top", functions=(lambda x: x / per_time, lambda t: t * per_time))
    above.set_xlabel("time since shear began [ms]")
    above.spines["top"].set_visible(True)
    axes.set_title(f"({letter}) stick-slip on the spring of the load point")


def draw_breakage(axes: Any, sheared: xarray.Dataset, letter: str) -> None:
    """Share of the bonds that have broken since the start of the shear, and the number of fragments."""
    strain, bonds = sheared.shear_strain.values, sheared.bond_count.values
    fragments = sheared.fragment_count.values
    axes.plot(strain, 100.0 * (1.0 - bonds / max(1, bonds[0])), color=ORANGE, lw=1.5)
    axes.set(xlim=(0, strain[-1]), xlabel="shear strain [1]")
    axes.set_ylabel("bonds broken since shear began [%]", color=ORANGE)
    axes.set_ylim(bottom=0)
    count = axes.twinx()
    count.plot(strain, fragments, color=BLUE, lw=1.5, ls="--")
    count.set_ylabel("number of fragments [1] (dashed)", color=BLUE)
    count.spines["right"].set_visible(True)
    axes.set_title(f"({letter}) breakage: {bonds[0]} bonds, {fragments[0]} to {fragments[-1]} fragments")
