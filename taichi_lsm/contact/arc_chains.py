"""Contact of arc chains (2D): the shared table of their arcs, and the one pair of arcs that face each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.allocation import when_allocated
from ..core.fields import allocate, fill_rows, rounded_capacity
from ..core.rotation import rotate, rotational_velocity, unrotate
from ..core.runtime import current, ti
from ..core.schema import Variable
from .error_flags import OVERLAP
from .primitives import SPHERE_OVERLAP_LIMIT, cone_step, cone_violation, cross2, sphere_overlap

PART_ROWS = [
    Variable("first_row", ("part",), "i32", "1", "first patch of the part"),
    Variable("patches", ("part",), "i32", "1", "number of patches of the part"),
]
PATCH_ROWS = [
    Variable("centre", ("patch", "space"), "real", "1", "patch centre in units of the grain's scale, body frame"),
    Variable("patch_radius", ("patch",), "real", "1", "patch radius in units of the grain's scale"),
    Variable("seam", ("patch", "space"), "real", "1", "unit normal where the patch begins, body frame"),
]


@ti.data_oriented
class ChainTable:
    """Shared table of arc chains; every shape is stored once and scaled per grain.

    Parameters
    ----------
    parts : sequence of GrainShape
        Arc chains and discs: the parts of all shapes.

    Notes
    -----
    Each chain has patches + 1 rows: the last repeats the first, so that an arc and its successor read the very same
    seam vector and a normal on the seam belongs to exactly one of them.
    """

    def __init__(self, parts: Sequence[Any]) -> None:
        table = allocate(PART_ROWS, rounded_capacity(len(parts)), {})
        patch = allocate(PATCH_ROWS, rounded_capacity(sum(p.patch_count + 1 for p in parts)), {"space": 2})
        for name, field in {**vars(table), **vars(patch)}.items():
            setattr(self, name, field)
        when_allocated(lambda: self.fill(parts))

    def fill(self, parts: Sequence[Any]) -> None:
        """Write the table. Raises InputError if the parts exceed the capacity that it was made with."""
        counts = np.array([p.patch_count for p in parts])
        first_row = np.concatenate([[0], np.cumsum(counts + 1)])
        closed = [np.append(np.arange(n), 0) for n in counts]
        fill_rows(self.first_row, first_row[:-1])
        fill_rows(self.patches, counts)
        fill_rows(self.centre, np.concatenate([p.centre[i] for p, i in zip(parts, closed)]))
        fill_rows(self.patch_radius, np.concatenate([p.radius[i] for p, i in zip(parts, closed)]))
        seams = [p.seam[i] if len(p.seam) else np.zeros((2, 2)) for p, i in zip(parts, closed)]
        fill_rows(self.seam, np.concatenate(seams))

    def contact(self, grains: Any, pairs: Any, error_flags: Any, domain: Any) -> "ChainContact":
        """Geometry of the contacts of arc chains, which reads this table."""
        return ChainContact(self, grains, pairs, error_flags, domain)


@ti.data_oriented
class ChainContact:
    """Finds where two chains touch; the pair of arcs is remembered in `pairs.feature`.

    Parameters
    ----------
    table : ChainTable
        Arcs of all parts.
    grains
        State of the grains.
    pairs : Pairs
        Storage of the pairs.
    error_flags : ErrorFlags
        Receives depths at the overlap limit.
    domain : Domain
        The cell, for velocities across its sheared borders.
    """

    def __init__(self, table: ChainTable, grains: Any, pairs: Any, error_flags: Any, domain: Any) -> None:
        self.table, self.grains, self.pairs, self.error_flags, self.domain = table, grains, pairs, error_flags, domain
        self.real = current().real
        # A direction this far outside an arc [-] is accepted: rounding can leave one between two arcs.
        self.seam_tolerance = 1e-12 if self.real == ti.f64 else 1e-5

    @ti.func
    def contact_now(self, a, b, k, l, i, j, d):
        """`contact_of_arcs` at the present orientations of the grains."""
        g = self.grains
        return self.contact_of_arcs(a, b, k, l, i, j, d, g.orientation[k], g.orientation[l])

    @ti.func
    def contact_of_arcs(self, a, b, k, l, i, j, d, q_k, q_l):
        """Contact of arc i of part a of grain k and arc j of part b of grain l, taken as full circles.

        d = c_l - c_k [m]; q_k, q_l: orientations. Returns the contact point relative to grain k [m], Eqs. (6), (19),
        the depth [m], and the unit normal k -> l in the world frame, in body k and, reversed, in body l.
        """
        g, t = self.grains, self.table
        row_i, row_j = t.first_row[a] + i, t.first_row[b] + j
        q_k, q_l = ti.cast(q_k, self.real), ti.cast(q_l, self.real)
        # Centre of the first circle and vector from it to that of the second, Eq. (19); then two circles touch.
        p_i = rotate(q_k, t.centre[row_i]) * g.diameter[k]
        w = d + rotate(q_l, t.centre[row_j]) * g.diameter[l] - p_i
        r_i, r_j = t.patch_radius[row_i] * g.diameter[k], t.patch_radius[row_j] * g.diameter[l]
        depth, n, at = sphere_overlap(w, r_i, r_j)
        return p_i + at * n, depth, n, unrotate(q_k, n), -unrotate(q_l, n)

    @ti.func
    def arc_towards(self, a, k, u):
        """The arc of part a of grain k whose normals hold the unit direction u; world frame."""
        g, t = self.grains, self.table
        first_row = t.first_row[a]
        u_k = unrotate(ti.cast(g.orientation[k], self.real), u)
        arc = 0
        for i in range(t.patches[a]):
            step, _ = cone_step(u_k, t.seam[first_row + i], t.seam[first_row + i + 1])
            if step == 0:
                arc = i
        return arc

    @ti.func
    def feature_along(self, a, k, u):
        """The feature of part a of grain k whose normals hold the world direction u: the name all surfaces share."""
        return self.arc_towards(a, k, u)

    @ti.func
    def surface_point(self, a, k, i, q, n):
        """Point [m] with the normal n of arc i of part a of grain k at the orientation q, and its radius [m].

        The arc is continued as a circle; the point is relative to the centre of the grain, world frame.
        """
        g, t = self.grains, self.table
        row = t.first_row[a] + i
        radius = t.patch_radius[row] * g.diameter[k]
        return rotate(ti.cast(q, self.real), t.centre[row]) * g.diameter[k] + radius * n, radius

    @ti.func
    def overlap(self, a, b, k, l, s, d):
        """Depth [m], unit normal k -> l and contact point from grain k [m] of the arcs whose normals face each other.

        The search starts from the last pair of arcs. As long as the direction between the centres of the arcs leaves a
        cone, the arc that it misses by more is replaced by its neighbour: a descent of the depth along the merged
        cones. Arcs of large radius also face each other on the far sides of the grains; there the depth exceeds the
        overlap limit, and all pairs are tried.
        """
        g, t, pairs = self.grains, self.table, self.pairs
        # Start from the last arcs, a new pair from the line of centres.
        feature = pairs.feature[s]
        i, j = feature[0], feature[1]
        if i < 0:
            i, j = self.arc_towards(a, k, d / d.norm()), self.arc_towards(b, l, -d / d.norm())
        n_i, n_j = t.patches[a], t.patches[b]
        first_i, first_j = t.first_row[a], t.first_row[b]
        limit = g.overlap_limit[k] + g.overlap_limit[l]
        x, depth, n, u_k, u_l = self.contact_now(a, b, k, l, i, j, d)
        # Each step moves one arc; more steps than arcs mean that the walk goes in circles.
        most_steps = n_i + n_j
        steps = 0
        while steps < most_steps:
            # On which side, and how far, the normal leaves either arc; a full circle holds every normal.
            step_i, step_j = 0, 0
            far_i, far_j = 0.0 * depth, 0.0 * depth
            if n_i > 1:
                step_i, far_i = cone_step(u_k, t.seam[first_i + i], t.seam[first_i + i + 1])
            if n_j > 1:
                step_j, far_j = cone_step(u_l, t.seam[first_j + j], t.seam[first_j + j + 1])
            if step_i == 0 and step_j == 0:
                break
            if step_j == 0 or (step_i != 0 and far_i >= far_j):
                i = (i + step_i + n_i) % n_i
            else:
                j = (j + step_j + n_j) % n_j
            steps += 1
            x, depth, n, u_k, u_l = self.contact_now(a, b, k, l, i, j, d)
        # No end of the walk, or arcs that face each other on the far sides: try all pairs.
        if steps == most_steps or depth >= limit:
            i, j = self.least_violation(a, b, k, l, d, limit)
            x, depth, n, u_k, u_l = self.contact_now(a, b, k, l, i, j, d)
        # Two full circles face each other at any depth; nearly concentric ones have no normal.
        if n_i + n_j == 2 and depth >= SPHERE_OVERLAP_LIMIT * limit:
            self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        if i != feature[0] or j != feature[1]:
            pairs.feature[s] = ti.Vector([i, j])
        return depth, n, x

    @ti.func
    def time_outside(self, a, i, u, rate):
        """Time [s] since the body direction u left arc i of part a, or 0; it rotates at `rate` [rad s-1].

        The sine of the angle to the seam stands for the angle, which is small within a step.
        """
        t = self.table
        time = 0.0 * rate
        if t.patches[a] > 1:
            row = t.first_row[a] + i
            # It can have left only over the seam towards which it rotates.
            step, _ = cone_step(u, t.seam[row], t.seam[row + 1])
            if step < 0 and rate < 0.0:
                time = cross2(t.seam[row], u) / rate
            elif step > 0 and rate > 0.0:
                time = cross2(t.seam[row + 1], u) / rate
        return time

    @ti.func
    def continued(self, a, b, k, l, features, d, q_k, q_l, n):
        """Depth [m], unit normal and contact point from grain k [m] of two arcs continued as circles.

        The grains have the orientations q_k and q_l and lie d [m] apart, which may differ from the present state.
        """
        x, depth, n, u_k, u_l = self.contact_of_arcs(a, b, k, l, features[0], features[1], d, q_k, q_l)
        return depth, n, x

    @ti.func
    def crossing(self, a, b, k, l, d, before, unused, dt):
        """What the arcs `before`, continued as circles, give now that the contact has left them.

        Returns the fraction of the step of dt [s] since it left them, depth [m], unit normal and contact point from
        grain k [m].
        """
        g, t = self.grains, self.table
        i, j = before[0], before[1]
        x, depth, n, u_k, u_l = self.contact_now(a, b, k, l, i, j, d)
        # Centres p of both circles from their grains, the vector w between them and its rate of change v.
        omega_k, omega_l = ti.cast(g.angular_velocity[k], self.real), ti.cast(g.angular_velocity[l], self.real)
        p_i = x - n * (t.patch_radius[t.first_row[a] + i] * g.diameter[k] - 0.5 * depth)
        p_j = x - d + n * (t.patch_radius[t.first_row[b] + j] * g.diameter[l] - 0.5 * depth)
        w = p_j + d - p_i
        v = (
            ti.cast(g.velocity[l] - g.velocity[k], self.real)
            + rotational_velocity(omega_l, p_j)
            - rotational_velocity(omega_k, p_i)
        )
        if ti.static(self.domain.sheared):
            v[0] -= ti.cast(self.domain.border_speed(g.position[k], g.position[l]), self.real)
        if ti.static(self.domain.driven):
            v[1] += ti.cast(self.domain.stretch_rate(), self.real) * d[1]
        # The normal rotates at (w x v)/w^2 in the world frame, less by omega in that of a body.
        rate = cross2(w, v) / w.dot(w)
        time = ti.max(self.time_outside(a, i, u_k, rate - omega_k[0]), self.time_outside(b, j, u_l, rate - omega_l[0]))
        return time / dt, depth, n, x

    @ti.func
    def radii(self, a, b, k, l, s):
        """Radii of curvature [m] of both surfaces where they face each other; those of their arcs."""
        g, t = self.grains, self.table
        feature = ti.max(self.pairs.feature[s], 0)
        r_i = t.patch_radius[t.first_row[a] + feature[0]] * g.diameter[k]
        return r_i, t.patch_radius[t.first_row[b] + feature[1]] * g.diameter[l]

    @ti.func
    def least_violation(self, a, b, k, l, d, limit):
        """Of all pairs of arcs less deep than `limit` [m] the one whose cones the normal between them misses least.

        The first with no violation if there is one. An error is reported if even the least violation is more than
        rounding: the grains then overlap so deeply that no pair of arcs faces each other.
        """
        g, t = self.grains, self.table
        n_i, n_j = t.patches[a], t.patches[b]
        first_i, first_j = t.first_row[a], t.first_row[b]
        best_i, best_j = 0, 0
        least = ti.cast(4.0, self.real)
        for i in range(n_i):
            for j in range(n_j):
                _, depth, n, u_k, u_l = self.contact_now(a, b, k, l, i, j, d)
                miss = 0.0 * depth
                if n_i > 1:
                    miss = cone_violation(u_k, t.seam[first_i + i], t.seam[first_i + i + 1])
                if n_j > 1:
                    miss = ti.max(miss, cone_violation(u_l, t.seam[first_j + j], t.seam[first_j + j + 1]))
                if depth < limit and miss < least:
                    least, best_i, best_j = miss, i, j
        if least > self.seam_tolerance:
            self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        return best_i, best_j
