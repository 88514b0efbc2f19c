"""Grains bounded by a chain of arcs (2D), and the disc and the sphere.

The outline is a closed chain of circular arcs with a continuous normal (G1). Arc i has centre p_i,
radius r_i and the outward normals from seam i counter-clockwise to seam i + 1, and neighbours obey

    p_(i+1) - p_i = (r_i - r_(i+1)) n_(i+1),    n_(i+1) the seam between them.

The normal cones then tile the circle once, which is what gives two grains one contact and keeps the energy.
Discs and spheres are the case of one patch and no seam.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .base import GrainShape, frozen_array

UNIT_TOLERANCE = 1e-12  # of a seam's length: cos and sin of one angle miss it by 1e-16
CHAIN_TOLERANCE = 1e-9  # of the bounding diameter: beyond it a seam is a visible step in the outline
ORIGIN_TOLERANCE = 1e-12  # of the bounding radius: how far a lone patch may lie from the centre of mass


def _cross(a: NDArray, b: NDArray) -> NDArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@dataclass(frozen=True, eq=False)
class ArcChain(GrainShape):
    """A convex grain bounded by a closed chain of arcs (2D); a disc or a sphere is the chain of one patch.

    centre  (patches, dim) centres p_i of the patches
    radius  (patches,) radii r_i
    seam    (patches, 2) unit vector of the lowest-angle normal of arc i, which ends at seam i + 1 (the last at
            seam 0); (0, 2) for a single patch

    Raises ValueError if the arcs are not a closed G1 chain that turns once.
    """

    kind = "chain"

    centre: NDArray
    radius: NDArray
    seam: NDArray

    def __post_init__(self):
        super().__post_init__()
        for field in ("centre", "radius", "seam"):
            object.__setattr__(self, field, frozen_array(field, getattr(self, field)))
        self._check_arrays()
        if self.patch_count == 1:
            offset = float(np.linalg.norm(self.centre))
            if offset > ORIGIN_TOLERANCE * self.bounding_radius:
                raise ValueError(f"centre = {self.centre[0]}: a single patch must lie at the centre of mass (0)")
        else:
            self._check_chain()

    def _check_arrays(self):
        count = self.radius.size
        if self.radius.ndim != 1 or count == 0 or np.any(self.radius <= 0):
            raise ValueError(f"radius = {self.radius}: must be one-dimensional, not empty, all > 0")
        if self.centre.shape != (count, self.dim):
            raise ValueError(f"centre has shape {self.centre.shape}: must be {(count, self.dim)}")
        if self.dim == 3 and count > 1:
            raise ValueError(f"radius has {count} patches: arcs chain in 2D only, a 3D shape here is one sphere")
        seams = 0 if count == 1 else count
        if self.seam.shape != (seams, 2):
            raise ValueError(f"seam has shape {self.seam.shape}: must be {(seams, 2)} for {count} patches")
        least = float(self.radius.min())
        if self.overlap_limit > least * (1 + CHAIN_TOLERANCE):  # it bounds the depth at which contacts are unique
            raise ValueError(f"cap_radius = {self.overlap_limit}: must not exceed the least radius, {least}")

    def _check_chain(self):
        length = np.linalg.norm(self.seam, axis=1)
        if np.any(np.abs(length - 1) > UNIT_TOLERANCE):
            raise ValueError(f"seam has lengths {length}: must be unit vectors to {UNIT_TOLERANCE}")
        following = np.roll(self.seam, -1, axis=0)
        if np.any(_cross(self.seam, following) <= 0):
            bad = int(np.argmin(_cross(self.seam, following)))
            raise ValueError(
                f"seam {bad} to {(bad + 1) % self.patch_count}: an arc must turn by more than 0, less than pi"
            )
        turn = float(self._spans()[1].sum())
        if abs(turn - 2 * np.pi) > 1e-6:
            raise ValueError(f"seam turns by {turn} in all: the arcs must cover 2 pi once")
        drop = (self.radius - np.roll(self.radius, -1))[:, None] * following
        jump = np.linalg.norm(np.roll(self.centre, -1, axis=0) - self.centre - drop, axis=1)
        allowed = CHAIN_TOLERANCE * 2 * self.bounding_radius
        if np.any(jump > allowed):
            bad = int(np.argmax(jump))
            raise ValueError(
                f"centre: the outline jumps by {jump[bad]:.3g} between arc {bad} and the next, which share a "
                f"normal: at most {allowed:.3g} is allowed"
            )

    def _spans(self) -> tuple[NDArray, NDArray]:
        """Angle of the first normal of each arc and the angle it turns by, both (patches,) [rad]."""
        if self.patch_count == 1:
            return np.zeros(1), np.full(1, 2 * np.pi)
        following = np.roll(self.seam, -1, axis=0)
        span = np.arctan2(_cross(self.seam, following), np.sum(self.seam * following, axis=1))
        return np.arctan2(self.seam[:, 1], self.seam[:, 0]), span

    @property
    def patch_count(self) -> int:
        """Number of patches; 1 for a disc or a sphere."""
        return self.radius.size

    def patches(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """See GrainShape; a full patch has the half-angle pi."""
        if self.patch_count == 1:
            return self.centre, self.radius, np.eye(self.dim)[:1], np.array([np.pi])
        low, high = self.seam, np.roll(self.seam, -1, axis=0)
        middle = low + high
        axis = middle / np.linalg.norm(middle, axis=1, keepdims=True)
        return self.centre, self.radius, axis, np.arccos(np.clip((axis * low).sum(axis=1), -1.0, 1.0))

    def support(self, normals: ArrayLike) -> NDArray:
        """Support function h(n) = max over the outline of x . n, for unit normals (k, 2) in the body frame; 2D."""
        n = np.asarray(normals, dtype=np.float64)
        if self.patch_count == 1:
            return n @ self.centre[0] + self.radius[0]
        low, high = self.seam, np.roll(self.seam, -1, axis=0)
        after_low = low[:, 0] * n[:, 1, None] - low[:, 1] * n[:, 0, None] >= 0
        before_high = n[:, 0, None] * high[:, 1] - n[:, 1, None] * high[:, 0] > 0
        arc = np.argmax(after_low & before_high, axis=1)
        return np.sum(n * self.centre[arc], axis=1) + self.radius[arc]

    def outline(self, points: int = 96) -> NDArray:
        """Closed polygon (k, 2) on the outline, counter-clockwise, last vertex = first, in the body frame.

        k - 1 >= points, and every seam is a vertex. Half of the vertices follow arc length and half follow
        the turn of the normal, so that flat sides and sharp corners are both drawn smoothly.
        Raises ValueError for a 3D shape or fewer than 3 points.
        """
        if self.dim != 2:
            raise ValueError(f"dim = {self.dim}: only a 2D shape has an outline")
        if points < 3:
            raise ValueError(f"points = {points}: must be at least 3")
        first, span = self._spans()
        length = self.radius * span
        share = 0.5 * (span / span.sum() + length / length.sum())
        count = np.maximum(1, np.ceil(points * share - 1e-9)).astype(int)  # a rounding error adds no vertex
        arc = np.repeat(np.arange(self.patch_count), count)
        step = np.arange(arc.size) - np.repeat(np.cumsum(count) - count, count)
        angle = first[arc] + span[arc] * step / count[arc]
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        vertices = self.centre[arc] + self.radius[arc, None] * normal
        return np.concatenate([vertices, vertices[:1]])

    def scaled_outline(self, position: ArrayLike, angle: float, scale: float, points: int = 96) -> NDArray:
        """`outline` of a grain at position (2,) [m], turned by angle [rad], of scale [m]; world frame [m]."""
        c, s = np.cos(angle), np.sin(angle)
        rotated = self.outline(points) @ np.array([[c, s], [-s, c]])
        return np.asarray(position, dtype=np.float64) + scale * rotated


def disc() -> ArcChain:
    """The disc of diameter 1: area pi/4, polar second moment pi/32."""
    return _ball("disc", 2, np.pi / 4, [np.pi / 32])


def sphere() -> ArcChain:
    """The sphere of diameter 1: volume pi/6, second moments (2/5) (pi/6) (1/2)^2 = pi/60."""
    return _ball("sphere", 3, np.pi / 6, [np.pi / 60] * 3)


def _ball(name: str, dim: int, measure: float, inertia: list[float]) -> ArcChain:
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
