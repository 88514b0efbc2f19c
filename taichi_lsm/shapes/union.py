"""Non-convex grains as unions of convex parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from ..core.errors import InputError
from .arc_chain import ArcChain
from .ball_polyhedron import BallPolyhedron
from .base import GrainShape, Patches, counted
from .geometry import even_directions, principal_frame, unit_normals
from .input_checks import check_positive, number_array
from .placement import Placement, quaternion_of
from .polygon_fit import from_polygon
from .union_mass import OUTLINE_POINTS, ConvexShape, moments_of, surface_points

Part = TypeVar("Part", ArcChain, BallPolyhedron)

PEAK_POINTS = 8000  # of all parts, where the greatest number of parts is sought
BALL_MARGIN = 1.001  # on the radius of a ball about sampled points of a part, for what lies between them
REACH_MARGIN = 1.0005  # the same for the bounding radius of the union
UNIT_QUATERNION = 1e-6  # by how much the length of a quaternion may differ from 1
PROBE = 1e-3  # equivalent diameters: parts nearer than this to a point of the outer surface resist there together


@dataclass(frozen=True, eq=False, repr=False)
class Union(GrainShape):
    """A rigid grain of convex parts, whose arrays are in the body frame of the whole. Parts never touch each other.

    Parameters
    ----------
    name, dim, measure, inertia, bounding_radius, overlap_limit, lever
        See `GrainShape`; mass properties are those of the union, the overlap limit is the least of its parts.
    members : tuple of ArcChain or BallPolyhedron
        The convex parts, all of one class; their mass is not used.
    stiffness_peak : float
        Greatest number of parts that resist at one point of the outer surface, in units of the contact stiffness k:
        where parts meet at a re-entrant corner it is 2; along shared outer surfaces it should not be.

    Raises
    ------
    InputError
        If there is no part or a field has the wrong form.
    """

    members: tuple[ConvexShape, ...]
    stiffness_peak: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.members:
            raise InputError("members = (): must be at least one convex part")

    @property
    def kind(self) -> str:
        """The contact geometry that reads the surface of the parts: chain or polyhedron."""
        return self.members[0].kind

    @property
    def patch_count(self) -> int:
        """Number of patches of all parts."""
        return sum(m.patch_count for m in self.members)

    @property
    def parts(self) -> tuple[ConvexShape, ...]:
        """The convex parts, in the body frame of the whole."""
        return self.members

    def _content(self) -> tuple[str, ...]:
        """Numbers of parts and of their patches."""
        return counted(len(self.members), "part", "parts"), *super()._content()

    def patches(self) -> Patches:
        """See `GrainShape.patches`; part after part."""
        centre, radius, axis, half_angle = (np.concatenate(rows) for rows in zip(*(m.patches() for m in self.members)))
        return centre, radius, axis, half_angle

    @cached_property
    def half_width(self) -> float:
        """See `GrainShape.half_width`: of the thinnest part."""
        return min(m.half_width for m in self.members)

    def part_bounds(self) -> tuple[NDArray, NDArray]:
        """See `GrainShape.part_bounds`."""
        balls = [ball_about(m) for m in self.members]
        return np.array([c for c, _ in balls]), np.array([r for _, r in balls])


def ball_about(part: ConvexShape) -> tuple[NDArray, float]:
    """Centre (dim,) and radius of a ball that holds a convex part."""
    x = surface_points(part, 512 if part.dim == 2 else 2000)
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    return middle, float(np.linalg.norm(x - middle, axis=1).max()) * BALL_MARGIN


def place_part(shape: Part, offset: ArrayLike, rotation: float | NDArray = 0.0, factor: float = 1.0) -> Part:
    """A convex shape as a part of a union: scaled, rotated, then moved.

    Parameters
    ----------
    shape : ArcChain or BallPolyhedron
        The part in its own body frame; an arc chain of 3 or more arcs.
    offset : array_like, (dim,)
        Where the centre of mass of the part goes, in the frame and unit of the union.
    rotation : float or ndarray
        Angle [rad] in 2D, rotation matrix (3, 3) or unit quaternion w, x, y, z (4,) in 3D; 0 is no rotation.
    factor : float
        Length of the unit of the shape in the unit of the union, > 0.

    Returns
    -------
    ArcChain or BallPolyhedron
        The part in the frame of the union, for `union`.

    Raises
    ------
    InputError
        If the shape is neither, or a number is out of range.
    """
    check_positive("factor", factor)
    if isinstance(shape, BallPolyhedron):
        return shape.rescaled(factor).moved(_rotation_matrix(rotation), offset)
    if not (isinstance(shape, ArcChain) and shape.patch_count > 1):
        raise InputError(f"shape = {shape!r}: must be an arc chain of 3 or more arcs, or a ball-polyhedron")
    if np.ndim(rotation) != 0:
        raise InputError(f"rotation = {rotation}: must be an angle [rad] for a 2D part")
    c, s = np.cos(rotation), np.sin(rotation)
    matrix = np.array([[c, -s], [s, c]])
    reach = shape.bounding_radius * factor + float(np.linalg.norm(offset))
    return replace(
        shape,
        centre=factor * shape.centre @ matrix.T + np.asarray(offset),
        radius=factor * shape.radius,
        seam=shape.seam @ matrix.T,
        measure=shape.measure * factor**2,
        inertia=shape.inertia * factor**4,
        bounding_radius=reach,
        overlap_limit=shape.overlap_limit * factor,
        lever=min(reach, shape.lever * factor + float(np.linalg.norm(offset))),
    )


def _rotation_matrix(rotation: float | NDArray) -> NDArray:
    """Rotation matrix (3, 3) from one, from a unit quaternion or from 0; InputError for anything else."""
    if np.ndim(rotation) == 0:
        return np.eye(3)
    array = number_array("rotation", rotation)
    if array.shape == (4,):
        if not abs(np.linalg.norm(array) - 1.0) < UNIT_QUATERNION:
            raise InputError(f"rotation = {array}: must be a unit quaternion w, x, y, z")
        return Rotation.from_quat(array, scalar_first=True).as_matrix()
    if array.shape != (3, 3):
        raise InputError(f"rotation has shape {array.shape}: must be (3, 3) or (4,) for a 3D part")
    return array


def union(
    members: Sequence[ConvexShape], *, name: str = "union", normalise: bool = True
) -> Union | ArcChain | BallPolyhedron:
    """One rigid grain of convex parts that may overlap.

    Parameters
    ----------
    members : sequence of ArcChain or BallPolyhedron
        Parts of one class in a common frame and unit, see `place_part`; together they hang together.
    name : str
        What pictures and files call the shape.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit of the parts is kept.

    Returns
    -------
    Union or ArcChain or BallPolyhedron
        The grain, moved to its centre of mass and in 3D rotated into the principal frame. Mass properties are those of
        the true union, to about 1e-8 in 2D and 1e-4 in 3D. A single part is returned as it is.

    Raises
    ------
    InputError
        If there is no part, classes or dimensions differ, or the parts do not hang together.

    See Also
    --------
    union_and_placement : tells where the grain lies among its parts.
    """
    return union_and_placement(members, name=name, normalise=normalise)[0]


def union_and_placement(
    members: Sequence[ConvexShape], *, name: str = "union", normalise: bool = True
) -> tuple[Union | ArcChain | BallPolyhedron, Placement]:
    """As `union`, with the centre, orientation and size of the grain in the frame and unit of its parts.

    Parameters
    ----------
    members, name, normalise
        See `union`.

    Returns
    -------
    shape : Union or ArcChain or BallPolyhedron
        The grain.
    placement : Placement
        Where it lies among the parts, see `Placement`; of a single part, which is not moved, the identity.

    Raises
    ------
    InputError
        As `union`.
    """
    members = list(members)
    if not members:
        raise InputError("members: none given, must be at least one")
    for m in members:
        if not isinstance(m, ArcChain | BallPolyhedron):
            raise InputError(f"members: {m!r} is no convex shape, must be an ArcChain or a BallPolyhedron")
    if len(members) == 1:
        still = 0.0 if members[0].dim == 2 else np.array([1.0, 0.0, 0.0, 0.0])
        return members[0], Placement(np.zeros(members[0].dim), still, 1.0)
    if len({(m.kind, m.dim) for m in members}) > 1:
        raise InputError(f"members: {[(m.name, m.kind) for m in members]}, must be of one kind")
    return _union_of(members, name, normalise)


def _union_of(members: Sequence[ConvexShape], name: str, normalise: bool) -> tuple[Union, Placement]:
    """The grain of two parts or more; see `union_and_placement`."""
    dim = members[0].dim
    measure, centroid, second = moments_of(members)
    inertia, frame = principal_frame(second)
    unit = np.pi / 4 if dim == 2 else np.pi / 6
    factor = (unit / measure) ** (1.0 / dim) if normalise else 1.0
    inertia = inertia * factor ** (dim + 2)
    moved: list[ConvexShape] = []
    for m in members:
        if isinstance(m, BallPolyhedron):
            moved.append(m.moved(frame.T, -frame.T @ centroid).rescaled(factor))
        else:
            moved.append(place_part(m, -factor * centroid, 0.0, factor))
    points = np.concatenate([surface_points(m, OUTLINE_POINTS) for m in moved])
    reach = float(np.linalg.norm(points, axis=1).max()) * REACH_MARGIN
    shape = Union(
        name=name,
        dim=dim,
        measure=measure * factor**dim,
        inertia=inertia,
        bounding_radius=reach,
        overlap_limit=min(m.overlap_limit for m in moved),
        lever=reach,
        members=tuple(moved),
        stiffness_peak=_stiffness_peak(moved, points[:: max(1, len(points) // PEAK_POINTS)]),
    )
    return shape, Placement(centroid, 0.0 if dim == 2 else quaternion_of(frame), 1.0 / factor)


def _depth_in(part: ConvexShape, x: NDArray) -> NDArray:
    """How far inside a convex part the points (k, dim) lie, at most; negative outside."""
    n = unit_normals(2.0 * np.pi * np.arange(720) / 720) if part.dim == 2 else even_directions(1000)
    return (part.support(n) - x @ n.T).min(axis=1)


def _stiffness_peak(members: Sequence[ConvexShape], points: NDArray) -> float:
    """Greatest number of parts near one of the points (k, dim) that lies on the outer surface; see `Union`."""
    depth = np.array([_depth_in(m, points) for m in members])
    outer = depth.max(axis=0) < 0.5 * PROBE
    return float((depth[:, outer] > -PROBE).sum(axis=0).max())


def crossed_bars(arm_ratio: float = 3.0, corner_radius: float = 0.05) -> Union:
    """Two equal rounded bars at a right angle (2D).

    Parameters
    ----------
    arm_ratio : float
        Length over width of a bar, finite and > 1.
    corner_radius : float
        Least radius of a corner in equivalent diameters of the cross before its corners are rounded, > 0 and at most
        half the width of a bar.

    Returns
    -------
    Union
        Grain of equivalent diameter 1, body frame. The bars share the square in the middle and meet at four re-entrant
        corners.

    Raises
    ------
    InputError
        If a number is out of range.
    """
    if not (np.isfinite(arm_ratio) and arm_ratio > 1):
        raise InputError(f"arm_ratio = {arm_ratio}: must be finite and above 1")
    x, y = 0.5 * arm_ratio, 0.5
    size = np.sqrt(4.0 / np.pi * (2.0 * arm_ratio - 1.0))
    bar = from_polygon([(-x, -y), (x, -y), (x, y), (-x, y)], corner_radius * size, normalise=False)
    bars = [place_part(bar, (0.0, 0.0)), place_part(bar, (0.0, 0.0), 0.5 * np.pi)]
    return _union_of(bars, f"cross {arm_ratio:g}", normalise=True)[0]
