"""Contact of general spherical patches, the grains of Abe & Mora (2003): every pair of patches is tested by itself.

Each patch is a part of its grain, with its own slot in the neighbour list. Directions that two cones cover count
twice and those that none covers do not count: only cones that tile the sphere conserve energy. A clump is a grain of
patches of full angle.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.allocation import when_allocated
from ..core.fields import allocate, fill_rows, rounded_capacity
from ..core.rotation import rotate, unrotate
from ..core.runtime import current, ti
from ..core.schema import Variable
from .error_flags import OVERLAP
from .primitives import SPHERE_OVERLAP_LIMIT, sphere_overlap

FULL = -2.0  # cosine of a full patch: below every cosine


def patch_rows() -> list[Variable]:
    """Schema rows of one patch."""
    return [
        Variable("centre", ("patch", "space"), "real", "1", "patch centre in units of the grain's scale, body frame"),
        Variable("patch_radius", ("patch",), "real", "1", "patch radius in units of the grain's scale"),
        Variable("axis", ("patch", "space"), "real", "1", "outward unit axis of the patch, body frame"),
        Variable("cosine", ("patch",), "real", "1", "cosine of the half-angle; -2 for a full sphere"),
    ]


@ti.data_oriented
class ConeTable:
    """Shared table of patches; every shape is stored once and scaled per grain.

    Parameters
    ----------
    parts : sequence of GrainShape
        Parts of all shapes, one patch each.
    """

    def __init__(self, parts: Sequence[Any]) -> None:
        dim = parts[0].dim
        for name, field in vars(allocate(patch_rows(), rounded_capacity(len(parts)), {"space": dim})).items():
            setattr(self, name, field)
        when_allocated(lambda: self.fill(parts))

    def fill(self, parts: Sequence[Any]) -> None:
        """Write the table, one row per part. Raises InputError if they exceed the capacity that it was made with."""
        centre, radius, axis, angle = (np.concatenate(rows) for rows in zip(*(p.patches() for p in parts)))
        fill_rows(self.centre, centre)
        fill_rows(self.patch_radius, radius)
        fill_rows(self.axis, axis)
        fill_rows(self.cosine, np.where(angle < np.pi, np.cos(angle), FULL))

    def contact(self, grains: Any, pairs: Any, error_flags: Any, domain: Any) -> "ConeContact":
        """Geometry of the contacts of patches, which reads this table."""
        return ConeContact(self, grains, error_flags)


@ti.data_oriented
class ConeContact:
    """The cone test, Eqs. (2)-(9) in their corrected form, of one pair of patches."""

    def __init__(self, table: ConeTable, grains: Any, error_flags: Any) -> None:
        self.table, self.grains, self.error_flags = table, grains, error_flags
        self.real = current().real

    @ti.func
    def sphere_contact(self, a, b, k, l, d, q_k, q_l):
        """Depth [m], unit normal k -> l and contact point from grain k [m] of two patches taken as full spheres.

        q_k, q_l: orientations of the grains; d [m]: from centre to centre, world frame.
        """
        g, t = self.grains, self.table
        p_i = rotate(q_k, t.centre[a]) * g.diameter[k]
        w = d + rotate(q_l, t.centre[b]) * g.diameter[l] - p_i
        depth, n, at = sphere_overlap(w, t.patch_radius[a] * g.diameter[k], t.patch_radius[b] * g.diameter[l])
        return depth, n, p_i + at * n

    @ti.func
    def continued(self, a, b, k, l, unused, d, q_k, q_l, n):
        """As `sphere_contact`, for grains at orientations other than the present ones."""
        return self.sphere_contact(a, b, k, l, d, ti.cast(q_k, self.real), ti.cast(q_l, self.real))

    @ti.func
    def overlap(self, a, b, k, l, s, d):
        """Depth [m], unit normal k -> l and contact point from grain k [m] of patch a of k and patch b of l.

        Patches of large radius also face each other on the far sides of their grains, where the depth exceeds what the
        least radii allow: that is no contact. For two full spheres it is an error.
        """
        g, t = self.grains, self.table
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        depth, n, x = self.sphere_contact(a, b, k, l, d, q_k, q_l)
        faces = self.faces(a, b, k, l, n)
        limit = g.overlap_limit[k] + g.overlap_limit[l]
        if t.cosine[a] < -1.0 and t.cosine[b] < -1.0 and depth >= SPHERE_OVERLAP_LIMIT * limit:
            self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        if depth >= limit:
            faces = False
        # A negative depth means apart; its size does not matter.
        if not faces:
            depth = -ti.abs(depth)
        return depth, n, x

    @ti.func
    def faces(self, a, b, k, l, n):
        """Whether patch a of grain k and patch b of grain l face each other along n, Eqs. (4), (5): 0 or 1.

        The normal must lie in the cones of both, each in its body frame.
        """
        g, t = self.grains, self.table
        n_k = unrotate(ti.cast(g.orientation[k], self.real), n)
        n_l = unrotate(ti.cast(g.orientation[l], self.real), n)
        return t.axis[a].dot(n_k) >= t.cosine[a] and -t.axis[b].dot(n_l) >= t.cosine[b]

    @ti.func
    def radii(self, a, b, k, l, s):
        """Radii [m] of patch a of grain k and of patch b of grain l."""
        g, t = self.grains, self.table
        return t.patch_radius[a] * g.diameter[k], t.patch_radius[b] * g.diameter[l]
