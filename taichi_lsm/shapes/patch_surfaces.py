"""A grain's surface as its patches, the convex parts that they bound, and the radius of the edges between them.

That is what grains.nc holds of a shape: `patch_outlines` and `patch_meshes` make its surface of it.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .ball_polyhedron import BallPolyhedron
from .base import GrainShape

CLOSED = 1e-6  # rad: arcs whose spans add up to a full turn within this are a chain


class PatchSurface(NamedTuple):
    """Patches of one shape, or of one of its parts, in its body frame; lengths in the unit of the shape.

    Attributes
    ----------
    centre : ndarray, (patches, dim)
        Centres of the spheres or discs.
    radius : ndarray, (patches,)
        Their radii.
    axis : ndarray, (patches, dim)
        Outward unit axes of the cones of normals.
    half_angle : ndarray, (patches,)
        Half-angles of the cones [rad]; pi for a full disc or sphere.
    part : ndarray of int, (patches,)
        The convex part that each patch bounds, counted from 0.
    edge_radius : ndarray, (patches,)
        Radius of the rounded edges of that part, r of a ball-polyhedron; 0 where patches join without edges.
    """

    centre: NDArray
    radius: NDArray
    axis: NDArray
    half_angle: NDArray
    part: NDArray
    edge_radius: NDArray

    def rows(self, which: NDArray) -> PatchSurface:
        """Those of these patches alone: (patches,) bool, or their indices."""
        return PatchSurface(*(column[which] for column in self))


class Body(Enum):
    """What the patches of a part enclose."""

    BALL = "a full disc or sphere"
    CHAIN = "closed chain of arcs (2D)"
    POLYHEDRON = "ball-polyhedron (3D)"
    OPEN = "hull of patches that leave gaps"


def patch_surface(shape: GrainShape) -> PatchSurface:
    """The surface of a shape.

    Parameters
    ----------
    shape : GrainShape
        Any shape of the library.

    Returns
    -------
    PatchSurface
        Its patches [diameter], body frame, in the order of `GrainShape.patches`.
    """
    counts = [part.patch_count for part in shape.parts]
    dilation = [part.dilation if isinstance(part, BallPolyhedron) else 0.0 for part in shape.parts]
    return PatchSurface(*shape.patches(), np.repeat(np.arange(len(counts)), counts), np.repeat(dilation, counts))


def bodies_of(surface: PatchSurface) -> list[tuple[Body, PatchSurface]]:
    """The bodies whose union is the grain, each with its patches.

    Every closed part is one. Patches that close no part, those of a general cone grain, enclose what their convex hull
    encloses, all together.
    """
    found: list[tuple[Body, PatchSurface]] = []
    is_open = np.zeros(len(surface.part), bool)
    for part in np.unique(surface.part):
        own = surface.part == part
        rows = surface.rows(own)
        if len(rows.radius) == 1 and rows.half_angle[0] >= np.pi:
            found.append((Body.BALL, rows))
        elif rows.edge_radius[0] > 0.0:
            found.append((Body.POLYHEDRON, rows))
        elif rows.centre.shape[1] == 2 and abs(rows.half_angle.sum() - np.pi) < CLOSED:
            found.append((Body.CHAIN, rows))
        else:
            is_open |= own
    return [*found, *([(Body.OPEN, surface.rows(is_open))] if is_open.any() else [])]
