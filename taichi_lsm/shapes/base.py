"""What every grain shape states about itself: mass, bounds and patches, in the body frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class GrainShape:
    """A rigid grain of unit density in its body frame: origin at the centre of mass, principal axes in 3D.

    Library shapes have equivalent diameter 1 (area pi/4, volume pi/6), so that a grain's scale is its
    equivalent diameter in metres. All lengths below are in that unit of the shape.

    name             what figures and files call it
    dim              2 or 3
    measure          area (2D) or volume (3D)
    inertia          second moments about the centre of mass: (1,) polar in 2D, (3,) principal in 3D
    bounding_radius  greatest distance of the surface from the centre of mass
    cap_radius       least radius of curvature of the surface: contacts must be less deep than the sum of two
    lever            greatest distance of a surface normal line from the centre of mass, max |x cross n|

    How the surface is described is the subclass's matter; `kind` names the contact geometry that reads it.
    Arrays are copied, float64 and read-only. Shapes compare and hash by identity.
    Raises ValueError if a field has the wrong form.
    """

    kind: ClassVar[str]

    name: str
    dim: int
    measure: float
    inertia: NDArray
    bounding_radius: float
    overlap_limit: float
    lever: float

    def __post_init__(self):
        if self.dim not in (2, 3):
            raise ValueError(f"dim = {self.dim}: must be 2 or 3")
        object.__setattr__(self, "inertia", frozen_array("inertia", self.inertia))
        for field in ("measure", "bounding_radius", "overlap_limit", "lever"):
            value = float(getattr(self, field))
            if not np.isfinite(value) or value < 0 or (value == 0 and field != "lever"):
                raise ValueError(f"{field} = {value}: must be finite and {'>= 0' if field == 'lever' else '> 0'}")
            object.__setattr__(self, field, value)
        moments = 1 if self.dim == 2 else 3
        if self.inertia.shape != (moments,) or np.any(self.inertia <= 0):
            raise ValueError(f"inertia = {self.inertia}: must be {moments} values > 0 in {self.dim}D")
        if self.lever > self.bounding_radius:
            raise ValueError(f"lever = {self.lever}: must not exceed bounding_radius = {self.bounding_radius}")

    @property
    def patch_count(self) -> int:
        """Number of spherical patches of the surface; 1 for a disc or a sphere."""
        raise NotImplementedError

    @property
    def parts(self) -> tuple[GrainShape, ...]:
        """The convex parts of the grain, in the body frame of the whole; the grain itself if it is convex."""
        return (self,)

    def patches(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Centre (patches, dim), radius (patches,), outward unit axis (patches, dim) and half-angle (patches,) [rad]
        of every spherical patch, body frame."""
        raise NotImplementedError

    def part_bounds(self) -> tuple[NDArray, NDArray]:
        """Balls that hold the parts: centres (parts, dim) in the body frame, radii (parts,)."""
        return np.zeros((1, self.dim)), np.array([self.bounding_radius])


LENGTHS = ("centre", "radius", "bounding_radius", "overlap_limit", "lever")


def rescaled(shape: GrainShape, factor: float) -> GrainShape:
    """The same arc chain or patch grain in other units of length: all lengths times `factor` > 0."""
    if not (np.isfinite(factor) and factor > 0):
        raise ValueError(f"factor = {factor}: must be finite and > 0")
    lengths = {name: getattr(shape, name) * factor for name in LENGTHS}
    mass = {"measure": shape.measure * factor**shape.dim, "inertia": shape.inertia * factor ** (shape.dim + 2)}
    return replace(shape, **lengths, **mass)


def frozen_array(field: str, value: ArrayLike) -> NDArray:
    """Read-only float64 copy. Raises ValueError naming the field if a number is not finite."""
    array = np.array(value, dtype=np.float64)
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{field} = {array}: must be finite")
    array.setflags(write=False)
    return array
