"""The shared table of rounded ball-polyhedra (3D): their features, and the cones of normals that tile the sphere."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import when_allocated
from ..core.fields import allocate, fill_rows, rounded_capacity
from ..core.rotation import rotate
from ..core.runtime import current, ti
from ..core.schema import Variable
from .ball_polyhedra import PolyhedronContact

PART_ROWS = [
    Variable("first_row", ("part",), "i32", "1", "first feature of the part"),
    Variable("features", ("part",), "i32", "1", "number of features of the part"),
    Variable("dilation", ("part",), "real", "1", "radius that rounds edges and vertices"),
]
FEATURE_ROWS = [
    Variable("centre", ("feature", "space"), "real", "1", "centre of the feature's ball or circle, body frame"),
    Variable("surface_radius", ("feature",), "real", "1", "radius of the ball or of the tube, dilation included"),
    Variable("ring_axis", ("feature", "space"), "real", "1", "unit axis of an edge's circle, body frame"),
    Variable("ring_radius", ("feature",), "real", "1", "radius of an edge's circle, 0 for faces and vertices"),
    Variable("first_bound", ("feature",), "i32", "1", "first bound of the feature's cone of normals"),
]
BOUND_ROWS = [
    Variable("bound", ("bound", "space"), "real", "1", "normals n of the feature have bound . n <= offset"),
    Variable("offset", ("bound",), "real", "1", "offset of the bound"),
    Variable("beyond", ("bound",), "i32", "1", "feature of the normals beyond the bound"),
]
SPARE = 1.2  # spare rows, for other shapes of the same kind that a simulation may load later
WALK = 24  # features that a search visits before it tries all of them


@ti.data_oriented
class PolyhedronTable:
    """Shared table of rounded ball-polyhedra; every part is stored once and scaled per grain.

    Parameters
    ----------
    parts : sequence of GrainShape
        Ball-polyhedra and spheres: the parts of all shapes.

    Notes
    -----
    A feature is a face, an edge or a vertex. Its normals are the unit vectors n with bound . n <= offset for each of
    its bounds; `beyond` is the feature on the other side of a bound. Lengths are in units of the grain's scale, vectors
    in the body frame.
    """

    def __init__(self, parts: Sequence[Any]) -> None:
        sizes = {"space": 3}
        features = sum(len(_features(p)["feature_radius"]) + 1 for p in parts)
        bounds = max(1, sum(len(_features(p)["bound_offset"]) for p in parts))
        rows = {
            **vars(allocate(PART_ROWS, rounded_capacity(len(parts)), sizes)),
            **vars(allocate(FEATURE_ROWS, rounded_capacity(int(SPARE * features)), sizes)),
            **vars(allocate(BOUND_ROWS, rounded_capacity(int(SPARE * bounds)), sizes)),
        }
        for name, field in rows.items():
            setattr(self, name, field)
        when_allocated(lambda: self.fill(parts))
        self.real = current().real
        # Normals this far outside a cone still count as inside: surfaces are G1, so that the force hardly changes, and
        # rounding cannot send the search to and fro between neighbours.
        self.seam_tolerance = 1e-12 if self.real == ti.f64 else 1e-5

    def fill(self, parts: Sequence[Any]) -> None:
        """Write the table. Raises InputError if the parts exceed the capacity that it was made with.

        Each part ends with an empty row, which only says where its last bounds end.
        """
        tables = [_features(p) for p in parts]
        counts = np.array([len(t["feature_radius"]) for t in tables])
        bounds = np.array([len(t["bound_offset"]) for t in tables])
        before = np.cumsum(bounds) - bounds
        fill_rows(self.first_row, np.cumsum(counts + 1) - counts - 1)
        fill_rows(self.features, counts)
        fill_rows(self.dilation, np.array([p.overlap_limit for p in parts]))

        def padded(name: str) -> NDArray:
            """Rows of all parts, each part followed by an empty row."""
            return np.concatenate([np.concatenate([t[name], np.zeros_like(t[name][:1])]) for t in tables])

        fill_rows(self.centre, padded("feature_centre"))
        fill_rows(self.surface_radius, padded("feature_radius"))
        fill_rows(self.ring_axis, padded("ring_axis"))
        fill_rows(self.ring_radius, padded("ring_radius"))
        fill_rows(self.first_bound, np.concatenate([t["first_bound"] + n for t, n in zip(tables, before)]))
        if bounds.sum():
            fill_rows(self.bound, np.concatenate([t["bound"] for t in tables]))
            fill_rows(self.offset, np.concatenate([t["bound_offset"] for t in tables]))
            fill_rows(self.beyond, np.concatenate([t["bound_next"] for t in tables]))

    def contact(self, grains: Any, pairs: Any, error_flags: Any, domain: Any) -> PolyhedronContact:
        """Geometry of the contacts of ball-polyhedra, which reads this table."""
        return PolyhedronContact(self, grains, pairs, error_flags)

    @ti.func
    def feature_placement(self, a, f, orientation, scale):
        """Centre [m], unit axis, ring radius [m] and surface radius [m] of feature f of part a of a grain.

        The centre is relative to that of the grain, which has this orientation and scale [m]; world frame.
        """
        row = self.first_row[a] + f
        q = ti.cast(orientation, self.real)
        rho = self.ring_radius[row] * scale
        axis = self.ring_axis[row]
        if rho > 0.0:
            axis = rotate(q, axis)
        return rotate(q, self.centre[row]) * scale, axis, rho, self.surface_radius[row] * scale

    @ti.func
    def worst_bound(self, a, f, u):
        """Greatest excess bound . u - offset [-] of the body direction u over feature f of part a; feature beyond.

        Not positive if the cone of the feature holds u.
        """
        row = self.first_row[a] + f
        worst = ti.cast(-2.0, self.real)
        beyond = f
        for c in range(self.first_bound[row], self.first_bound[row + 1]):
            miss = self.bound[c].dot(u) - self.offset[c]
            if miss > worst:
                worst, beyond = miss, self.beyond[c]
        return worst, beyond

    @ti.func
    def feature_of(self, a, u, f):
        """The feature of part a whose cone holds the body direction u; the search starts at feature f."""
        # Walk over the bound that u exceeds most; neighbouring features are few steps apart.
        worst, beyond = self.worst_bound(a, f, u)
        walked = 0
        while worst > self.seam_tolerance and walked < WALK:
            f = beyond
            worst, beyond = self.worst_bound(a, f, u)
            walked += 1
        # A walk that does not end: try all features and take the one that u misses least.
        if worst > self.seam_tolerance:
            for other in range(self.features[a]):
                miss, _ = self.worst_bound(a, other, u)
                if miss < worst:
                    worst, f = miss, other
        return f

    @ti.func
    def fraction_outside(self, a, f, u, last_u):
        """Fraction of the step since the body direction, last_u before and u now, left the cone of feature f; or 0.

        Along each bound that it crossed, the excess is taken to be linear in time.
        """
        row = self.first_row[a] + f
        fraction = 0.0 * u[0]
        for c in range(self.first_bound[row], self.first_bound[row + 1]):
            miss = self.bound[c].dot(u) - self.offset[c]
            last_margin = self.offset[c] - self.bound[c].dot(last_u)
            if miss > 0.0 and last_margin > 0.0:
                fraction = ti.max(fraction, miss / (miss + last_margin))
        return fraction


def _features(part: Any) -> dict[str, NDArray]:
    """Feature arrays of a ball-polyhedron; a plain sphere is one face without bounds."""
    names = ("feature_centre", "feature_radius", "ring_axis", "ring_radius", "first_bound")
    names += ("bound", "bound_offset", "bound_next")
    if part.kind == "polyhedron":
        return {name: np.asarray(getattr(part, name)) for name in names}
    none = np.zeros((0, 3))
    values = (part.centre, part.radius, np.zeros((1, 3)), np.zeros(1), np.zeros(2, int), none, none[:, 0], none[:, 0])
    return dict(zip(names, values))
