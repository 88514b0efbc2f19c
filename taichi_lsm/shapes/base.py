"""What every grain shape states about itself: mass, bounds and patches, in the body frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .geometry import even_directions, unit_normals
from .input_checks import check_positive, number_array

if TYPE_CHECKING:
    from .cone_patches import PatchGrain

WIDTHS = {2: 180, 3: 500}  # even directions in which the width of a grain is tried, besides those of its patches

# Centre (patches, dim), radius (patches,), outward unit axis (patches, dim) and half-angle (patches,) [rad].
Patches = tuple[NDArray, NDArray, NDArray, NDArray]
# Centre (balls, dim) and radius (balls,) of balls that span a grain.
Balls = tuple[NDArray, NDArray]


class ConvexPart(Protocol):
    """What the contact geometry reads from a convex part of a grain."""

    @property
    def kind(self) -> str:
        """The contact geometry that reads the surface."""
        ...

    @property
    def patch_count(self) -> int:
        """Number of spherical patches of the surface."""
        ...

    def patches(self) -> Patches:
        """Spherical patches of the surface, see `GrainShape.patches`."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class GrainShape:
    """A rigid grain of unit density in its body frame: origin at the centre of mass, principal axes in 3D.

    Parameters
    ----------
    name : str
        What pictures and files call it.
    dim : int
        2 or 3.
    measure : float
        Area [diameter^2] in 2D, volume [diameter^3] in 3D.
    inertia : ndarray
        Second moments about the centre of mass: (1,) polar [diameter^4] in 2D, (3,) principal [diameter^5] in 3D.
    bounding_radius : float
        Greatest distance of the surface from the centre of mass [diameter].
    overlap_limit : float
        Least radius of curvature of the surface [diameter]. Two grains may overlap by less than the sum of theirs.
    lever : float
        Greatest distance of a surface normal line from the centre of mass, max |x cross n| [diameter].

    Raises
    ------
    InputError
        If a field has the wrong form.

    Notes
    -----
    Shapes of the library have the equivalent diameter 1 (area pi/4, volume pi/6): the unit of length of a shape is its
    equivalent diameter, and a scene scales it by the diameter of the grain [m]. Shapes made with `normalise=False` keep
    the unit of what they were made from.

    How the surface is described is the matter of the subclasses; `kind` names the contact geometry that reads it.
    Arrays are copied, float64 and read-only. Shapes compare and hash by identity.
    """

    # The maker of a grain of any patches, `from_patches`; the package sets it, for a subclass is unknown here.
    from_patches: ClassVar[Callable[..., PatchGrain]]

    name: str
    dim: int
    measure: float
    inertia: NDArray
    bounding_radius: float
    overlap_limit: float
    lever: float

    def __post_init__(self) -> None:
        if self.dim not in (2, 3):
            raise InputError(f"dim = {self.dim}: must be 2 or 3")
        object.__setattr__(self, "inertia", frozen_array("inertia", self.inertia))
        for field in ("measure", "bounding_radius", "overlap_limit", "lever"):
            value = float(getattr(self, field))
            if not np.isfinite(value) or value < 0 or (value == 0 and field != "lever"):
                raise InputError(f"{field} = {value}: must be finite and {'>= 0' if field == 'lever' else '> 0'}")
            object.__setattr__(self, field, value)
        moments = 1 if self.dim == 2 else 3
        if self.inertia.shape != (moments,) or np.any(self.inertia <= 0):
            raise InputError(f"inertia = {self.inertia}: must be {moments} values > 0 in {self.dim}D")
        if self.lever > self.bounding_radius:
            raise InputError(f"lever = {self.lever}: must not exceed bounding_radius = {self.bounding_radius}")

    def __repr__(self) -> str:
        content = ", ".join([repr(self.name), *self._content()])
        limits = f"overlap limit {self.overlap_limit:.3g}, bounding radius {self.bounding_radius:.3g}"
        return f"{type(self).__name__}({content}, {limits})"

    def _content(self) -> tuple[str, ...]:
        """What the surface consists of, as `repr` says it."""
        return (counted(self.patch_count, "patch", "patches"),)

    @property
    def kind(self) -> str:
        """The contact geometry that reads the surface: chain, polyhedron or cones."""
        raise NotImplementedError

    @property
    def patch_count(self) -> int:
        """Number of spherical patches of the surface; 1 for a disc or a sphere."""
        raise NotImplementedError

    @property
    def parts(self) -> tuple[ConvexPart, ...]:
        """The convex parts of the grain, in the body frame of the whole; the grain itself if it is convex."""
        return (self,)

    def patches(self) -> Patches:
        """Spherical patches of the surface, in the body frame.

        Returns
        -------
        centre : ndarray, (patches, dim)
            Centres of the spheres or discs [diameter].
        radius : ndarray, (patches,)
            Their radii [diameter].
        axis : ndarray, (patches, dim)
            Outward unit axes of the cones of normals.
        half_angle : ndarray, (patches,)
            Half-angles of the cones [rad]; pi for a full disc or sphere.
        """
        raise NotImplementedError

    @cached_property
    def equivalent_radius(self) -> float:
        """Radius of the disc of equal area or the sphere of equal volume [diameter]; 1/2 for shapes of the library."""
        root = np.sqrt if self.dim == 2 else np.cbrt
        return 0.5 * float(root(2.0 * self.dim * self.measure / np.pi))

    @cached_property
    def half_width(self) -> float:
        """Half the least distance of two parallel planes that hold the grain between them [diameter].

        Of grains of several parts that of the thinnest one: what another grain has to cross.
        """
        n = self._directions()
        width = self._reach_along(n) + self._reach_along(-n)
        return min(self.bounding_radius, 0.5 * float(width.min()))

    def _directions(self) -> NDArray:
        """Unit vectors (k, dim) along which the width is tried: square to the patches, and even ones."""
        even = even_directions(WIDTHS[3]) if self.dim == 3 else unit_normals(np.pi / WIDTHS[2] * np.arange(WIDTHS[2]))
        return np.concatenate([self.patches()[2], even])

    def _reach_along(self, n: NDArray) -> NDArray:
        """Greatest x . n of the surface for each unit normal (k, dim); infinite where no patch has that normal."""
        centre, radius, axis, half_angle = self.patches()
        own = axis @ n.T >= np.cos(half_angle)[:, None] - 1e-9
        reach = np.where(own, centre @ n.T + radius[:, None], -np.inf).max(axis=0)
        return np.where(own.any(axis=0), reach, np.inf)

    def spanning_balls(self) -> Balls:
        """Balls whose convex hull is the grain, or nearly: what is quick to compute the distance of grains from.

        Returns
        -------
        centre : ndarray, (balls, dim)
            Centres of the balls [diameter], body frame.
        radius : ndarray, (balls,)
            Their radii, all equal to the least radius of curvature [diameter].

        Notes
        -----
        A ball of the least radius of curvature touches the surface from inside at any point: here at the middle of
        every patch. Between them, where patches of large radius bulge, the hull lies below the surface.
        """
        centre, radius, axis = (
            np.concatenate(rows) for rows in zip(*(part.patches()[:3] for part in self.parts), strict=True)
        )
        return centre + (radius - self.overlap_limit)[:, None] * axis, np.full(len(radius), self.overlap_limit)

    def part_bounds(self) -> tuple[NDArray, NDArray]:
        """Balls that hold the parts, in the body frame.

        Returns
        -------
        centre : ndarray, (parts, dim)
            Centres of the balls [diameter].
        radius : ndarray, (parts,)
            Their radii [diameter].
        """
        return np.zeros((1, self.dim)), np.array([self.bounding_radius])


LENGTHS = ("centre", "radius", "bounding_radius", "overlap_limit", "lever")
Scalable = TypeVar("Scalable", bound=GrainShape)


def rescaled(shape: Scalable, factor: float) -> Scalable:
    """The same arc chain or patch grain with all lengths multiplied by a factor.

    Parameters
    ----------
    shape : ArcChain or PatchGrain
        The shape; a `BallPolyhedron` has a method of this name.
    factor : float
        Ratio of the new lengths to the old ones, finite and > 0.

    Returns
    -------
    ArcChain or PatchGrain
        A new shape of the same class; areas scale as factor^2, second moments as factor^(dim + 2).

    Raises
    ------
    InputError
        If the factor is not finite and > 0, or the shape is of another class.
    """
    check_positive("factor", factor)
    if not all(hasattr(shape, field) for field in LENGTHS):
        raise InputError(f"shape = {shape!r}: must be an ArcChain or a PatchGrain")
    lengths = {name: getattr(shape, name) * factor for name in LENGTHS}
    mass = {"measure": shape.measure * factor**shape.dim, "inertia": shape.inertia * factor ** (shape.dim + 2)}
    return replace(shape, **lengths, **mass)


def counted(count: int, one: str, many: str) -> str:
    """A number and its noun: '1 patch', '24 patches'."""
    return f"{count} {one if count == 1 else many}"


def frozen_array(field: str, value: ArrayLike) -> NDArray[np.float64]:
    """Read-only float64 copy; InputError naming the field if it holds what is not a finite number."""
    array = number_array(field, value)
    if not np.all(np.isfinite(array)):
        raise InputError(f"{field} = {array}: must be finite")
    array.setflags(write=False)
    return array
