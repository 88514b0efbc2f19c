"""What the curves of a run are drawn against: shear strain, or slip or time where stages go back or stand still."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray


class Course(NamedTuple):
    """Values along the horizontal axis of a run's curves.

    Attributes
    ----------
    values
        One of each row (n,), which never fall.
    label
        Of the axis, with the unit.
    timed
        Whether they are times.
    """

    values: NDArray
    label: str
    timed: bool = False

    def name_axis(self, axes: Any) -> None:
        """Label and limits of the horizontal axis, which holds all rows."""
        axes.set(xlim=(0.0, float(self.values[-1])), xlabel=self.label)


def course_of(sheared: xarray.Dataset, params: Any) -> Course:
    """The course of a run, as a laboratory draws it.

    Shear strain at one velocity. Through stages the slip of the platen, which counts in either direction, over the mean
    diameter; time over the inertial time if a stage holds or is under a shear stress, where slip says little.

    Parameters
    ----------
    sheared
        Rows of run.nc since shear began.
    params
        Of the run, attributes by their names.
    """
    if "cycle" not in sheared:
        return Course(sheared.shear_strain.values, "shear strain [1]")
    diameter = 0.5 * (params.smallest_diameter + params.largest_diameter)
    if holds(sheared).any() or pushed(sheared).any():
        unit = diameter * np.sqrt(params.density / params.normal_stress)
        time = sheared.time.values
        start = "shear began" if is_sheared(sheared) else "the first level"
        return Course((time - time[0]) / unit, f"time since {start} [inertial times]", timed=True)
    return Course(slip_of(sheared) / diameter, "slip in either direction [mean diameters]")


def is_sheared(sheared: xarray.Dataset) -> bool:
    """Whether the layer is sheared at all: in an oedometer it is not."""
    return bool(np.ptp(sheared.shear_strain.values) > 0.0)


def slip_of(sheared: xarray.Dataset) -> NDArray:
    """Slip of the platen since shear began [m] (n,), the sum of its displacements in either direction."""
    first = abs(float(sheared.shear_strain[0] * sheared.layer_thickness[0]))
    return first + np.concatenate([[0.0], np.cumsum(np.abs(np.diff(sheared.displacement.values)))])


def holds(sheared: xarray.Dataset) -> NDArray:
    """Whether the drive stands still in each row (n,)."""
    return (sheared.load_point_velocity.values == 0.0) & ~pushed(sheared)


def pushed(sheared: xarray.Dataset) -> NDArray:
    """Whether a shear stress is imposed in each row (n,)."""
    if "imposed_shear_stress" not in sheared:
        return np.zeros(sheared.sizes["time"], bool)
    return np.isfinite(sheared.imposed_shear_stress.values)
