"""Where a grain lies in the file, or among the parts, that it was made from."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .base import GrainShape

Shape = TypeVar("Shape", bound=GrainShape)
OwnMisfit = TypeVar("OwnMisfit")


class Placement(NamedTuple):
    """Position, orientation and size that bring a grain back to where its source has it.

    A point x of the shape lies at centre + diameter R x in the source, with R the rotation. A scene with the centre as
    `position`, the rotation as `angle` (2D) or `orientation` (3D) and `diameter` has the grain there, and
    `place_part(shape, *placement)` makes it a part there.

    Attributes
    ----------
    centre : ndarray, (dim,)
        Centre of mass of the grain [unit of the source].
    rotation : float or ndarray, (4,)
        From the body frame to the frame of the source: angle [rad] in 2D, unit quaternion w, x, y, z in 3D.
    diameter : float
        Length of the unit of the shape [unit of the source]. Of shapes of equivalent diameter 1 it is the diameter of
        the disc of the area, or the sphere of the volume, of the source.
    """

    centre: NDArray
    rotation: float | NDArray
    diameter: float


class Imported(NamedTuple, Generic[Shape, OwnMisfit]):
    """A grain made from a file, a mesh, an outline or an image.

    Attributes
    ----------
    shape : GrainShape
        Grain of equivalent diameter 1, body frame.
    misfit : Misfit or OutlineMisfit
        How far it is from its source, and what was repaired there.
    placement : Placement
        Where the source has it, how oriented and how large.
    """

    shape: Shape
    misfit: OwnMisfit
    placement: Placement


def quaternion_of(matrix: NDArray) -> NDArray:
    """Unit quaternion w, x, y, z (4,), w >= 0, of a rotation matrix (3, 3)."""
    return Rotation.from_matrix(matrix).as_quat(canonical=True, scalar_first=True)
