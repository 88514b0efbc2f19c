"""Grains bounded by a chain of arcs (2D), and the disc and the sphere.

The outline is a closed chain of circular arcs with a continuous normal (G1). Arc i has centre p_i, radius r_i and the
outward normals from seam i counter-clockwise to seam i + 1, and neighbours obey

    p_(i+1) - p_i = (r_i - r_(i+1)) n_(i+1),    n_(i+1) the seam between them.

The normal cones then tile the circle once, which is what gives two grains one contact and keeps the energy.
Discs and spheres are the case of one patch and no seam.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .base import GrainShape, Patches, counted, frozen_array
from .geometry import cross_2d, unit_normals
from .input_checks import check_at_least

UNIT_TOLERANCE = 1e-12  # of a seam's length: cos and sin of one angle miss it by 1e-16
CHAIN_TOLERANCE = 1e-9  # of the bounding diameter: beyond it a seam is a visible step in the outline
ORIGIN_TOLERANCE = 1e-12  # of the bounding radius: how far a lone patch may lie from the centre of mass


@dataclass(frozen=True, eq=False, repr=False)
class ArcChain(GrainShape):
    """A convex grain bounded by a closed chain of arcs (2D); a disc or a sphere is the chain of one patch.

    Parameters
    ----------
    name, dim, measure, inertia, bounding_radius, overlap_limit, lever
        See `GrainShape`; the overlap limit is at most the least radius.
    centre : ndarray, (patches, dim)
        Centres p_i of the patches [diameter], body frame.
    radius : ndarray, (patches,)
        Radii r_i > 0 [diameter].
    seam : ndarray, (patches, 2)
        Unit vector of the lowest-angle normal of arc i, which ends at seam i + 1 (the last one at seam 0), body frame;
        (0, 2) for a single patch.

    Raises
    ------
    InputError
        If the arcs are not a closed chain with a continuous normal (G1) that turns once.

    Notes
    -----
    Neighbouring arcs obey p_(i+1) - p_i = (r_i - r_(i+1)) n_(i+1) with n_(i+1) the seam between them.
    """

    centre: NDArray
    radius: NDArray
    seam: NDArray

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("centre", "radius", "seam"):
            object.__setattr__(self, field, frozen_array(field, getattr(self, field)))
        self._check_arrays()
        if self.patch_count == 1:
            offset = float(np.linalg.norm(self.centre))
            if offset > ORIGIN_TOLERANCE * self.bounding_radius:
                raise InputError(f"centre = {self.centre[0]}: a single patch must lie at the centre of mass (0)")
        else:
            self._check_chain()

    def _check_arrays(self) -> None:
        """Refuse arrays of the wrong form, and an overlap limit above the least radius."""
        count = self.radius.size
        if self.radius.ndim != 1 or count == 0 or np.any(self.radius <= 0):
            raise InputError(f"radius = {self.radius}: must be one-dimensional, not empty, all > 0")
        if self.centre.shape != (count, self.dim):
            raise InputError(f"centre has shape {self.centre.shape}: must be {(count, self.dim)}")
        if self.dim == 3 and count > 1:
            raise InputError(f"radius has {count} patches: arcs chain in 2D only, a 3D shape here is one sphere")
        seams = 0 if count == 1 else count
        if self.seam.shape != (seams, 2):
            raise InputError(f"seam has shape {self.seam.shape}: must be {(seams, 2)} for {count} patches")
        least = float(self.radius.min())
        if self.overlap_limit > least * (1 + CHAIN_TOLERANCE):  # it bounds the depth at which contacts are unique
            raise InputError(f"overlap_limit = {self.overlap_limit}: must not exceed the least radius, {least}")

    def _check_chain(self) -> None:
        """Refuse arcs that do not join with a common normal or do not cover 2 pi once."""
        length = np.linalg.norm(self.seam, axis=1)
        if np.any(np.abs(length - 1) > UNIT_TOLERANCE):
            raise InputError(f"seam has lengths {length}: must be unit vectors to {UNIT_TOLERANCE}")
        following = np.roll(self.seam, -1, axis=0)
        if np.any(cross_2d(self.seam, following) <= 0):
            bad = int(np.argmin(cross_2d(self.seam, following)))
            raise InputError(
                f"seam {bad} to {(bad + 1) % self.patch_count}: an arc must turn by more than 0, less than pi"
            )
        total = float(self._spans()[1].sum())
        if abs(total - 2 * np.pi) > 1e-6:
            raise InputError(f"seam turns by {total} rad in all: the arcs must cover 2 pi once")
        drop = (self.radius - np.roll(self.radius, -1))[:, None] * following
        jump = np.linalg.norm(np.roll(self.centre, -1, axis=0) - self.centre - drop, axis=1)
        allowed = CHAIN_TOLERANCE * 2 * self.bounding_radius
        if np.any(jump > allowed):
            bad = int(np.argmax(jump))
            raise InputError(
                f"centre: the outline jumps by {jump[bad]:.3g} between arc {bad} and the next, which share a "
                f"normal: at most {allowed:.3g} is allowed"
            )

    def _spans(self) -> tuple[NDArray, NDArray]:
        """Angle of the first normal of each arc and the angle it turns by, both (patches,) [rad]."""
        if self.patch_count == 1:
            return np.zeros(1), np.full(1, 2 * np.pi)
        following = np.roll(self.seam, -1, axis=0)
        span = np.arctan2(cross_2d(self.seam, following), np.sum(self.seam * following, axis=1))
        return np.arctan2(self.seam[:, 1], self.seam[:, 0]), span

    @property
    def kind(self) -> str:
        """The contact geometry that reads the surface: chain."""
        return "chain"

    @property
    def patch_count(self) -> int:
        """Number of patches; 1 for a disc or a sphere."""
        return self.radius.size

    def _content(self) -> tuple[str, ...]:
        """Number of arcs; nothing for a disc or a sphere."""
        return (counted(self.patch_count, "arc", "arcs"),) if self.patch_count > 1 else ()

    def patches(self) -> Patches:
        """See `GrainShape.patches`; the patch of a disc or a sphere has the half-angle pi."""
        if self.patch_count == 1:
            return self.centre, self.radius, np.eye(self.dim)[:1], np.array([np.pi])
        low, high = self.seam, np.roll(self.seam, -1, axis=0)
        middle = low + high
        axis = middle / np.linalg.norm(middle, axis=1, keepdims=True)
        return self.centre, self.radius, axis, np.arccos(np.clip((axis * low).sum(axis=1), -1.0, 1.0))

    def support(self, normals: ArrayLike) -> NDArray:
        """Support function h(n) = max over the outline of x . n.

        Parameters
        ----------
        normals : array_like, (k, dim)
            Outward unit normals, body frame.

        Returns
        -------
        ndarray, (k,)
            Distance of the tangent line (2D) or plane (3D) from the origin [diameter].
        """
        n = np.asarray(normals, dtype=np.float64)
        if self.patch_count == 1:
            return n @ self.centre[0] + self.radius[0]
        low, high = self.seam, np.roll(self.seam, -1, axis=0)
        after_low = low[:, 0] * n[:, 1, None] - low[:, 1] * n[:, 0, None] >= 0
        before_high = n[:, 0, None] * high[:, 1] - n[:, 1, None] * high[:, 0] > 0
        arc = np.argmax(after_low & before_high, axis=1)  # the one arc whose half-open cone holds the normal
        return np.sum(n * self.centre[arc], axis=1) + self.radius[arc]

    def outline(self, points: int = 96) -> NDArray:
        """Closed polygon on the outline.

        Parameters
        ----------
        points : int
            Least number of different vertices, >= 3.

        Returns
        -------
        ndarray, (k, 2)
            Vertices [diameter], counter-clockwise, the last equal to the first, body frame; k - 1 >= points, and every
            seam is a vertex.

        Raises
        ------
        InputError
            For a 3D shape or fewer than 3 points.

        Notes
        -----
        Half of the vertices follow arc length and half follow the turning of the normal, so that flat sides and sharp
        corners are both drawn smoothly.
        """
        if self.dim != 2:
            raise InputError(f"dim = {self.dim}: only a 2D shape has an outline")
        check_at_least("points", points, 3)
        first, span = self._spans()
        length = self.radius * span
        share = 0.5 * (span / span.sum() + length / length.sum())
        count = np.maximum(1, np.ceil(points * share - 1e-9)).astype(int)  # a rounding error adds no vertex
        arc = np.repeat(np.arange(self.patch_count), count)
        step = np.arange(arc.size) - np.repeat(np.cumsum(count) - count, count)
        angle = first[arc] + span[arc] * step / count[arc]
        vertices = self.centre[arc] + self.radius[arc, None] * unit_normals(angle)
        return np.concatenate([vertices, vertices[:1]])

    def scaled_outline(self, position: ArrayLike, angle: float, diameter: float, points: int = 96) -> NDArray:
        """Outline of a grain of this shape in the world frame.

        Parameters
        ----------
        position : array_like, (2,)
            Where its centre of mass lies [m].
        angle : float
            By which it is turned [rad].
        diameter : float
            Its equivalent diameter [m].
        points : int
            Least number of different vertices, >= 3.

        Returns
        -------
        ndarray, (k, 2)
            Vertices [m] as those of `outline`.

        Raises
        ------
        InputError
            For a 3D shape or fewer than 3 points.
        """
        c, s = np.cos(angle), np.sin(angle)
        rotated = self.outline(points) @ np.array([[c, s], [-s, c]])
        return np.asarray(position, dtype=np.float64) + diameter * rotated


def disc() -> ArcChain:
    """The disc of diameter 1.

    Returns
    -------
    ArcChain
        One full patch of radius 1/2: area pi/4, polar second moment pi/32.
    """
    return _ball("disc", 2, np.pi / 4, [np.pi / 32])


def sphere() -> ArcChain:
    """The sphere of diameter 1.

    Returns
    -------
    ArcChain
        One full patch of radius 1/2: volume pi/6, second moments (2/5) (pi/6) (1/2)^2 = pi/60.
    """
    return _ball("sphere", 3, np.pi / 6, [np.pi / 60] * 3)


def _ball(name: str, dim: int, measure: float, inertia: list[float]) -> ArcChain:
    """A disc or sphere of radius 1/2 about the origin."""
    return ArcChain(
        name=name,
        dim=dim,
        centre=np.zeros((1, dim)),
        radius=np.array([0.5]),
        seam=np.zeros((0, 2)),
        measure=measure,
        inertia=np.array(inertia),
        bounding_radius=0.5,
        overlap_limit=0.5,
        lever=0.0,
    )
