"""Contact of arc chains (2D): the shared table of their arcs, and the one pair of arcs that face each other."""

import numpy as np

from ..core.fields import allocate, fill_rows, rounded_capacity
from ..core.rotation import rotate, rotational_velocity, unrotate
from ..core.runtime import current, ti, when_allocated
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

    Each chain owns patches + 1 rows: the last repeats the first, so that an arc and its successor read the very
    same seam vector and a normal on the seam belongs to exactly one of them.
    """

    def __init__(self, parts):
        table = allocate(PART_ROWS, rounded_capacity(len(parts)), {})
        patch = allocate(PATCH_ROWS, rounded_capacity(sum(p.patch_count + 1 for p in parts)), {"space": 2})
        for name, field in {**vars(table), **vars(patch)}.items():
            setattr(self, name, field)
        when_allocated(lambda: self.fill(parts))

    def fill(self, parts):
        """Write the table; the parts must fit the capacity it was made with."""
        counts = np.array([p.patch_count for p in parts])
        first = np.concatenate([[0], np.cumsum(counts + 1)])
        closed = [np.append(np.arange(n), 0) for n in counts]
        fill_rows(self.first_row, first[:-1])
        fill_rows(self.patches, counts)
        fill_rows(self.centre, np.concatenate([p.centre[i] for p, i in zip(parts, closed)]))
        fill_rows(self.patch_radius, np.concatenate([p.radius[i] for p, i in zip(parts, closed)]))
        seams = [p.seam[i] if len(p.seam) else np.zeros((2, 2)) for p, i in zip(parts, closed)]
        fill_rows(self.seam, np.concatenate(seams))

    def contact(self, grains, pairs, error_flags, domain):
        """The geometry that reads this table."""
        return ChainContact(self, grains, pairs, error_flags, domain)


@ti.data_oriented
class ChainContact:
    """Finds where two chains touch; the pair of arcs is remembered in `pairs.feature`."""

    def __init__(self, table, grains, pairs, error_flags, domain):
        self.table, self.grains, self.pairs, self.error_flags, self.domain = table, grains, pairs, error_flags, domain
        self.real = current().real
        # one accepted violation of a seam, for directions that rounding leaves between two arcs
        self.seam_tolerance = 1e-12 if self.real == ti.f64 else 1e-5

    @ti.func
    def facing(self, a, b, k, l, i, j, d):
        """Arc i of part a of grain k and arc j of part b of grain l, taken as full circles: contact point relative to
        grain k [m], depth [m], and the unit direction from centre to centre in the world frame, in body k, and
        reversed in body l.
        """
        g = self.grains
        return self.placed(a, b, k, l, i, j, d, g.orientation[k], g.orientation[l])

    @ti.func
    def placed(self, a, b, k, l, i, j, d, q_k, q_l):
        """`facing` of grains that are turned otherwise than now."""
        g, t = self.grains, self.table
        row_i, row_j = t.first_row[a] + i, t.first_row[b] + j
        q_k, q_l = ti.cast(q_k, self.real), ti.cast(q_l, self.real)
        p_i = rotate(q_k, t.centre[row_i]) * g.diameter[k]
        w = d + rotate(q_l, t.centre[row_j]) * g.diameter[l] - p_i
        r_i, r_j = t.patch_radius[row_i] * g.diameter[k], t.patch_radius[row_j] * g.diameter[l]
        depth, n, at = sphere_overlap(w, r_i, r_j)
        return p_i + at * n, depth, n, unrotate(q_k, n), -unrotate(q_l, n)

    @ti.func
    def arc_towards(self, a, k, u):
        """The arc of part a of grain k whose normals hold the direction u (world frame)."""
        g, t = self.grains, self.table
        first = t.first_row[a]
        u_k = unrotate(ti.cast(g.orientation[k], self.real), u)
        arc = 0
        for i in range(t.patches[a]):
            step, _ = cone_step(u_k, t.seam[first + i], t.seam[first + i + 1])
            if step == 0:
                arc = i
        return arc

    @ti.func
    def feature_along(self, a, k, u):
        """As for every kind of surface: the patch of part a of grain k whose normals hold the world direction u."""
        return self.arc_towards(a, k, u)

    @ti.func
    def surface_point(self, a, k, i, turn, n):
        """(point with the normal n of arc i of part a, continued as a circle, from the centre of grain k turned by
        `turn`; its radius) [m].
        """
        g, t = self.grains, self.table
        row = t.first_row[a] + i
        radius = t.patch_radius[row] * g.diameter[k]
        return rotate(ti.cast(turn, self.real), t.centre[row]) * g.diameter[k] + radius * n, radius

    @ti.func
    def overlap(self, a, b, k, l, s, d):
        """Contact of two arc chains: the one pair of arcs whose normals face each other, found from the last one.

        As long as the direction between the arc centres leaves a cone, the arc that it misses by more gives way to
        its neighbour: a descent of the depth along the merged cones. Arcs of large radius also face each other on
        the far sides of the grains; there the depth exceeds its cap, and all pairs are tried.
        Returns (depth [m], unit normal k -> l, contact point relative to grain k [m]).
        """
        g, t, pairs = self.grains, self.table, self.pairs
        feature = pairs.feature[s]
        i, j = feature[0], feature[1]
        if i < 0:
            i, j = self.arc_towards(a, k, d / d.norm()), self.arc_towards(b, l, -d / d.norm())
        n_i, n_j = t.patches[a], t.patches[b]
        first_i, first_j = t.first_row[a], t.first_row[b]
        cap = g.overlap_limit[k] + g.overlap_limit[l]
        x, depth, n, u_k, u_l = self.facing(a, b, k, l, i, j, d)
        limit = n_i + n_j
        tries = 0
        while tries < limit:
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
            tries += 1
            x, depth, n, u_k, u_l = self.facing(a, b, k, l, i, j, d)
        if tries == limit or depth >= cap:
            i, j = self.least_violation(a, b, k, l, d, cap)
            x, depth, n, u_k, u_l = self.facing(a, b, k, l, i, j, d)
        if n_i + n_j == 2 and depth >= SPHERE_OVERLAP_LIMIT * cap:
            self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        if i != feature[0] or j != feature[1]:
            pairs.feature[s] = ti.Vector([i, j])
        return depth, n, x

    @ti.func
    def leaving(self, a, k, i, u, rate):
        """Time [s] since the body direction u of grain k, turning at `rate` [rad s-1], left arc i of part a; or 0."""
        t = self.table
        time = 0.0 * rate
        if t.patches[a] > 1:
            row = t.first_row[a] + i
            step, _ = cone_step(u, t.seam[row], t.seam[row + 1])
            if step < 0 and rate < 0.0:
                time = cross2(t.seam[row], u) / rate
            elif step > 0 and rate > 0.0:
                time = cross2(t.seam[row + 1], u) / rate
        return time

    @ti.func
    def continued(self, a, b, k, l, features, d, q_k, q_l, n):
        """(depth [m], unit normal, contact point relative to grain k [m]) of arcs continued as circles, for grains
        placed otherwise than now.
        """
        x, depth, n, u_k, u_l = self.placed(a, b, k, l, features[0], features[1], d, q_k, q_l)
        return depth, n, x

    @ti.func
    def crossing(self, a, b, k, l, d, before, unused, dt):
        """What the arcs `before`, continued as circles, give now: (fraction of the step since the contact left them,
        depth [m], unit normal, contact point relative to grain k [m]).
        """
        g, t = self.grains, self.table
        i, j = before[0], before[1]
        x, depth, n, u_k, u_l = self.facing(a, b, k, l, i, j, d)
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
        rate = cross2(w, v) / w.dot(w)
        time = ti.max(self.leaving(a, k, i, u_k, rate - omega_k[0]), self.leaving(b, l, j, u_l, rate - omega_l[0]))
        return time / dt, depth, n, x

    @ti.func
    def radii(self, a, b, k, l, s):
        """Radii of curvature [m] of both surfaces where they face each other."""
        g, t = self.grains, self.table
        feature = ti.max(self.pairs.feature[s], 0)
        r_i = t.patch_radius[t.first_row[a] + feature[0]] * g.diameter[k]
        return r_i, t.patch_radius[t.first_row[b] + feature[1]] * g.diameter[l]

    @ti.func
    def least_violation(self, a, b, k, l, d, cap):
        """Of all pairs of arcs less deep than the cap the first whose cones both hold the direction between them,
        else the one that misses by least.
        """
        g, t = self.grains, self.table
        n_i, n_j = t.patches[a], t.patches[b]
        first_i, first_j = t.first_row[a], t.first_row[b]
        best_i, best_j = 0, 0
        least = ti.cast(4.0, self.real)
        for i in range(n_i):
            for j in range(n_j):
                _, depth, n, u_k, u_l = self.facing(a, b, k, l, i, j, d)
                miss = 0.0 * depth
                if n_i > 1:
                    miss = cone_violation(u_k, t.seam[first_i + i], t.seam[first_i + i + 1])
                if n_j > 1:
                    miss = ti.max(miss, cone_violation(u_l, t.seam[first_j + j], t.seam[first_j + j + 1]))
                if depth < cap and miss < least:
                    least, best_i, best_j = miss, i, j
        if least > self.seam_tolerance:
            self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        return best_i, best_j
