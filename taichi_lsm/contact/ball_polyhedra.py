"""Contact of rounded ball-polyhedra (3D): faces, edges and vertices whose normal cones tile the sphere."""

import numpy as np

from ..core.fields import allocate, fill_rows, rounded_capacity
from ..core.rotation import rotate, unrotate
from ..core.runtime import current, ti, when_allocated
from ..core.schema import Variable
from .error_flags import OVERLAP
from .feature_pairs import across_axis, core_point, stationary_normal
from .primitives import SPHERE_OVERLAP_LIMIT

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
SPARE = 1.2  # room for other shapes of the same kind that a simulation may load later
WALK = 24  # features that a search visits before it tries all of them
PAIR_WALK = 12  # pairs of features that are tried before the general descent
DESCENT = 60  # iterations of the general descent, a few of which are the rule


@ti.data_oriented
class PolyhedronTable:
    """Shared table of rounded ball-polyhedra; every part is stored once and scaled per grain."""

    def __init__(self, parts):
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

    def fill(self, parts):
        """Write the table; the parts must fit the capacity it was made with. Each part ends with a row that only says
        where its last bounds end.
        """
        tables = [_features(p) for p in parts]
        counts = np.array([len(t["feature_radius"]) for t in tables])
        bounds = np.array([len(t["bound_offset"]) for t in tables])
        before = np.cumsum(bounds) - bounds
        fill_rows(self.first_row, np.cumsum(counts + 1) - counts - 1)
        fill_rows(self.features, counts)
        fill_rows(self.dilation, np.array([p.overlap_limit for p in parts]))

        def padded(name):
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

    def contact(self, grains, pairs, error_flags, domain):
        """The geometry that reads this table."""
        return PolyhedronContact(self, grains, pairs, error_flags)


def _features(part):
    """Feature arrays of a ball-polyhedron; a plain sphere is one face without bounds."""
    names = ("feature_centre", "feature_radius", "ring_axis", "ring_radius", "first_bound")
    names += ("bound", "bound_offset", "bound_next")
    if part.kind == "polyhedron":
        return {name: np.asarray(getattr(part, name)) for name in names}
    none = np.zeros((0, 3))
    values = (part.centre, part.radius, np.zeros((1, 3)), np.zeros(1), np.zeros(2, int), none, none[:, 0], none[:, 0])
    return dict(zip(names, values))


@ti.data_oriented
class PolyhedronContact:
    """Finds where two ball-polyhedra touch; the features and the normal are remembered in the pair's slot.

    The depth is the minimum over all directions n of h_A(n) + h_B(-n): unique below the cap, and its gradient is the
    force. Of two features the stationary direction is known (see features.py); it is the minimum if it lies in the
    normal cones of both. Otherwise the feature whose cone it misses by more gives way to the one beyond that bound.
    """

    def __init__(self, table, grains, pairs, error_flags):
        self.table, self.grains, self.pairs, self.error_flags = table, grains, pairs, error_flags
        self.real = current().real
        precise = self.real == ti.f64
        # Normals this far outside a cone still count as inside: surfaces are G1, so the force barely notices, and
        # rounding cannot send the search to and fro between neighbours.
        self.seam_tolerance = 1e-12 if precise else 1e-5
        self.step_tolerance = 1e-9 if precise else 3e-4  # of Newton's method; the next error is its square
        self.gradient_tolerance = 1e-13 if precise else 1e-6  # of the descent, relative to the grains

    @ti.func
    def placed(self, a, f, k, orientation):
        """Feature f of part a in the world: centre from grain k's, unit axis, ring radius, surface radius [m]."""
        g, t = self.grains, self.table
        row = t.first_row[a] + f
        turn = ti.cast(orientation, self.real)
        rho = t.ring_radius[row] * g.diameter[k]
        axis = t.ring_axis[row]
        if rho > 0.0:
            axis = rotate(turn, axis)
        return rotate(turn, t.centre[row]) * g.diameter[k], axis, rho, t.surface_radius[row] * g.diameter[k]

    @ti.func
    def worst_bound(self, a, f, u):
        """(by how much the body direction u leaves the cone of feature f of part a, the feature beyond) [-]."""
        t = self.table
        row = t.first_row[a] + f
        worst = ti.cast(-2.0, self.real)
        beyond = f
        for c in range(t.first_bound[row], t.first_bound[row + 1]):
            miss = t.bound[c].dot(u) - t.offset[c]
            if miss > worst:
                worst, beyond = miss, t.beyond[c]
        return worst, beyond

    @ti.func
    def feature_of(self, a, u, f):
        """The feature of part a whose cone holds the body direction u; the search starts at feature f."""
        t = self.table
        worst, beyond = self.worst_bound(a, f, u)
        walked = 0
        while worst > self.seam_tolerance and walked < WALK:
            f = beyond
            worst, beyond = self.worst_bound(a, f, u)
            walked += 1
        if worst > self.seam_tolerance:
            for other in range(t.features[a]):
                miss, _ = self.worst_bound(a, other, u)
                if miss < worst:
                    worst, f = miss, other
        return f

    @ti.func
    def feature_along(self, a, k, u):
        """The feature of part a of grain k whose normals hold the world direction u."""
        return self.feature_of(a, unrotate(ti.cast(self.grains.orientation[k], self.real), u), 0)

    @ti.func
    def surface_point(self, a, k, f, turn, n):
        """(point with the normal n of feature f of part a, continued beyond its bounds, from the centre of grain k
        turned by `turn`; its radius) [m].
        """
        c, axis, rho, radius = self.placed(a, f, k, turn)
        return c + core_point(n, axis, rho) + radius * n, radius

    @ti.func
    def overlap(self, a, b, k, l, s, d):
        """(depth [m], unit normal k -> l, contact point relative to grain k [m]) of part a of k and part b of l."""
        g, pairs = self.grains, self.pairs
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        cap = g.overlap_limit[k] + g.overlap_limit[l]
        if self.table.features[a] + self.table.features[b] == 2:  # two balls
            cap *= SPHERE_OVERLAP_LIMIT
        i, j = pairs.feature[s][0], pairs.feature[s][1]
        n = pairs.normal[s]
        if i < 0:
            n = d.normalized()
            i, j = self.feature_of(a, unrotate(q_k, n), 0), self.feature_of(b, -unrotate(q_l, n), 0)
        depth = 0.0 * d[0]
        x_i, x_j = 0.0 * d, 0.0 * d
        tries, facing = 0, 0
        while facing == 0 and tries < PAIR_WALK:
            c_i, axis_i, rho_i, r_i = self.placed(a, i, k, g.orientation[k])
            c_j, axis_j, rho_j, r_j = self.placed(b, j, l, g.orientation[l])
            w = d + c_j - c_i
            m, found = stationary_normal(w, axis_i, rho_i, axis_j, rho_j, n, self.step_tolerance)
            tries = ti.select(found == 1, tries + 1, PAIR_WALK)
            if found == 1:
                n = m
                miss_i, beyond_i = self.worst_bound(a, i, unrotate(q_k, n))
                miss_j, beyond_j = self.worst_bound(b, j, -unrotate(q_l, n))
                if ti.max(miss_i, miss_j) <= self.seam_tolerance:
                    facing = 1
                    x_i = c_i + core_point(n, axis_i, rho_i) + r_i * n
                    x_j = d + c_j + core_point(-n, axis_j, rho_j) - r_j * n
                    depth = (x_i - x_j).dot(n)
                elif miss_i >= miss_j:
                    i = beyond_i
                else:
                    j = beyond_j
        if facing == 0 or depth >= cap:
            n, i, j = self.descend(a, b, k, l, d, i, j)
            c_i, axis_i, rho_i, r_i = self.placed(a, i, k, g.orientation[k])
            c_j, axis_j, rho_j, r_j = self.placed(b, j, l, g.orientation[l])
            x_i = c_i + core_point(n, axis_i, rho_i) + r_i * n
            x_j = d + c_j + core_point(-n, axis_j, rho_j) - r_j * n
            depth = (x_i - x_j).dot(n)
            if depth >= cap:
                self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        pairs.normal[s] = n
        if i != pairs.feature[s][0] or j != pairs.feature[s][1]:
            pairs.feature[s] = ti.Vector([i, j])
        return depth, n, 0.5 * (x_i + x_j)

    @ti.func
    def leaving(self, a, f, u, u_before):
        """Part of the step since the body direction u, once u_before, left the cone of feature f of part a; or 0."""
        t = self.table
        row = t.first_row[a] + f
        part = 0.0 * u[0]
        for c in range(t.first_bound[row], t.first_bound[row + 1]):
            miss = t.bound[c].dot(u) - t.offset[c]
            room = t.offset[c] - t.bound[c].dot(u_before)
            if miss > 0.0 and room > 0.0:
                part = ti.max(part, miss / (miss + room))
        return part

    @ti.func
    def continued(self, a, b, k, l, features, d, q_k, q_l, n):
        """(depth [m], unit normal, contact point from k [m]) of features continued past their bounds,
        for grains placed otherwise than now; depth -1 where there is none. The normal n starts the search.
        """
        c_i, axis_i, rho_i, r_i = self.placed(a, features[0], k, q_k)
        c_j, axis_j, rho_j, r_j = self.placed(b, features[1], l, q_l)
        n, found = stationary_normal(d + c_j - c_i, axis_i, rho_i, axis_j, rho_j, n, self.step_tolerance)
        x_i = c_i + core_point(n, axis_i, rho_i) + r_i * n
        x_j = d + c_j + core_point(-n, axis_j, rho_j) - r_j * n
        depth = (x_i - x_j).dot(n)
        return ti.select(found == 1, depth, -1.0 + 0.0 * depth), n, 0.5 * (x_i + x_j)

    @ti.func
    def crossing(self, a, b, k, l, d, before, last_n, dt):
        """What the features `before`, continued beyond their bounds, give now: (fraction of the step since the contact
        left them, depth [m], unit normal, contact point relative to grain k [m]).
        """
        g = self.grains
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        depth, n, x = self.continued(a, b, k, l, before, d, g.orientation[k], g.orientation[l], last_n)
        # the last normal as the bodies saw it, when they were turned less
        seen_k = last_n + dt * ti.cast(g.angular_velocity[k], self.real).cross(last_n)
        seen_l = last_n + dt * ti.cast(g.angular_velocity[l], self.real).cross(last_n)
        part = ti.max(
            self.leaving(a, before[0], unrotate(q_k, n), unrotate(q_k, seen_k)),
            self.leaving(b, before[1], -unrotate(q_l, n), -unrotate(q_l, seen_l)),
        )
        return part, depth, n, x

    @ti.func
    def bend(self, n, axis, rho, core, t, s):
        """Second derivatives (tt, ts, ss) [m] of a feature's support function along the tangents t and s of n."""
        tt, ts, ss = core, 0.0 * core, core
        if rho > 0.0:
            e, q = across_axis(n, axis)
            z = axis.cross(e)
            z_t, z_s = z.dot(t), z.dot(s)
            tt += rho / q * z_t * z_t
            ts += rho / q * z_t * z_s
            ss += rho / q * z_s * z_s
        return tt, ts, ss

    @ti.func
    def descend(self, a, b, k, l, d, i, j):
        """(n, feature of a, feature of b) of least h_A(n) + h_B(-n), by Newton's method with backtracking from d.

        Of use where a contact begins or its features jump; it stops as soon as a direction separates the grains.
        """
        g, t = self.grains, self.table
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        round_k, round_l = t.dilation[a] * g.diameter[k], t.dilation[b] * g.diameter[l]
        size = g.radius[k] + g.radius[l]
        n = d.normalized()
        from_n, step, slope, length = n, 0.0 * n, 0.0 * size, ti.cast(1.0, self.real)
        least = 1e30 * size
        searching = 1
        for _ in range(DESCENT):
            if searching == 1:
                i = self.feature_of(a, unrotate(q_k, n), i)
                j = self.feature_of(b, -unrotate(q_l, n), j)
                c_i, axis_i, rho_i, r_i = self.placed(a, i, k, g.orientation[k])
                c_j, axis_j, rho_j, r_j = self.placed(b, j, l, g.orientation[l])
                core_i, core_j = r_i - round_k, r_j - round_l
                apart = c_i + core_point(n, axis_i, rho_i) + core_i * n
                apart -= d + c_j + core_point(-n, axis_j, rho_j) - core_j * n
                f = apart.dot(n)
                if f + round_k + round_l < 0.0:
                    searching = 0
                elif f > least + 1e-4 * length * slope + 1e-15 * size:
                    length *= 0.5
                    n = (from_n + length * step).normalized()
                    if length < 1e-6:
                        searching = 0
                else:
                    e = ti.Vector([0.0 * f, n[2], -n[1]])
                    if ti.abs(n[0]) > 0.7:
                        e = ti.Vector([-n[2], 0.0 * f, n[0]])
                    e = e.normalized()
                    o = n.cross(e)
                    tt_i, ts_i, ss_i = self.bend(n, axis_i, rho_i, core_i, e, o)
                    tt_j, ts_j, ss_j = self.bend(n, axis_j, rho_j, core_j, e, o)
                    gap = ti.max(-f, 1e-3 * size)
                    tt, ts, ss = tt_i + tt_j + gap, ts_i + ts_j, ss_i + ss_j + gap
                    g_t, g_s = apart.dot(e), apart.dot(o)
                    det = tt * ss - ts * ts
                    d_t, d_s = (ts * g_s - ss * g_t) / det, (ts * g_t - tt * g_s) / det
                    shorten = ti.min(1.0, 0.7 / ti.max(ti.sqrt(d_t * d_t + d_s * d_s), 1e-30))
                    if ti.sqrt(g_t * g_t + g_s * g_s) < self.gradient_tolerance * size:
                        searching = 0
                    else:
                        step = shorten * (d_t * e + d_s * o)
                        slope = shorten * (d_t * g_t + d_s * g_s)
                        least, from_n, length = f, n, 1.0
                        n = (n + step).normalized()
        return n, i, j
