"""Contact of rounded ball-polyhedra (3D): the pair of faces, edges or vertices that face each other."""

from typing import Any

from ..core.rotation import unrotate
from ..core.runtime import current, ti
from .error_flags import OVERLAP
from .feature_pairs import NO_NORMAL, contact_along, core_point, stationary_normal
from .polyhedron_descent import PolyhedronDescent
from .primitives import SPHERE_OVERLAP_LIMIT

PAIR_WALK = 12  # pairs of features that are tried before the general descent


@ti.data_oriented
class PolyhedronContact:
    """Finds where two ball-polyhedra touch; the features and the normal are remembered in the pair's slot.

    Parameters
    ----------
    table : PolyhedronTable
        Features of all parts.
    grains
        State of the grains.
    pairs : Pairs
        Storage of the pairs; it remembers features and normal.
    error_flags : ErrorFlags
        Receives depths at the overlap limit.

    Notes
    -----
    The depth is the minimum over all directions n of h_A(n) + h_B(-n), h the support functions: unique below the
    overlap limit, and its gradient is the direction of the force. Of two features the stationary direction is known
    (`feature_pairs.py`); it is the minimum if it lies in the cones of normals of both. Otherwise the feature whose cone
    it misses by more is replaced by the one beyond that bound.
    """

    def __init__(self, table: Any, grains: Any, pairs: Any, error_flags: Any) -> None:
        self.table, self.grains, self.pairs, self.error_flags = table, grains, pairs, error_flags
        self.descent = PolyhedronDescent(table, grains)
        self.real = current().real
        self.step_tolerance = 1e-9 if self.real == ti.f64 else 3e-4  # of Newton's method; the next error is its square

    @ti.func
    def feature_along(self, a, k, u):
        """The feature of part a of grain k whose cone of normals holds the world direction u."""
        return self.table.feature_of(a, unrotate(ti.cast(self.grains.orientation[k], self.real), u), 0)

    @ti.func
    def surface_point(self, a, k, f, q, n):
        """Point [m] with the normal n of feature f of part a of grain k at the orientation q, and its radius [m].

        The feature is continued beyond its bounds; the point is relative to the centre of the grain, world frame.
        """
        c, axis, rho, radius = self.table.feature_placement(a, f, q, self.grains.diameter[k])
        return c + core_point(n, axis, rho) + radius * n, radius

    @ti.func
    def overlap(self, a, b, k, l, s, d):
        """Depth [m], unit normal k -> l and contact point from grain k [m] of part a of k and part b of l.

        d = c_l - c_k [m]; the contact point is the middle between the two surface points. Both searches are exact: the
        walk is cheap where the contact moved little in a step, the descent converges from anywhere.
        """
        g, t, pairs = self.grains, self.table, self.pairs
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        limit = g.overlap_limit[k] + g.overlap_limit[l]
        if t.features[a] + t.features[b] == 2:  # two balls
            limit *= SPHERE_OVERLAP_LIMIT
        # Start from what the pair remembers, a new pair from the line of centres.
        i, j = pairs.feature[s][0], pairs.feature[s][1]
        n = pairs.normal[s]
        if i < 0:
            n = d.normalized()
            i, j = t.feature_of(a, unrotate(q_k, n), 0), t.feature_of(b, -unrotate(q_l, n), 0)
        facing, depth, n, x_i, x_j, i, j = self.walk_features(a, b, k, l, d, q_k, q_l, n, i, j)
        # The walk found nothing, or a pair on the far sides: descend from the line of centres.
        if facing == 0 or depth >= limit:
            n, i, j = self.descent.minimise(a, b, k, l, d, i, j)
            c_i, axis_i, rho_i, r_i = t.feature_placement(a, i, q_k, g.diameter[k])
            c_j, axis_j, rho_j, r_j = t.feature_placement(b, j, q_l, g.diameter[l])
            depth, x_i, x_j = contact_along(n, c_i, axis_i, rho_i, r_i, d + c_j, axis_j, rho_j, r_j)
            if depth >= limit:
                self.error_flags.report(OVERLAP, g.id[k], g.id[l])
        # The normal changes in every step, the features in few: they are written only then.
        pairs.normal[s] = n
        if i != pairs.feature[s][0] or j != pairs.feature[s][1]:
            pairs.feature[s] = ti.Vector([i, j])
        return depth, n, 0.5 * (x_i + x_j)

    @ti.func
    def walk_features(self, a, b, k, l, d, q_k, q_l, n, i, j):
        """Walk from the features i and j to the pair whose stationary normal lies in the cones of both.

        Returns 1 if it was found, else 0, then depth [m], normal, surface points of k and l from the centre of k [m],
        and the two features. The walk gives up after PAIR_WALK pairs, or where a pair has no stationary normal.
        """
        g, t = self.grains, self.table
        depth = 0.0 * d[0]
        x_i, x_j = 0.0 * d, 0.0 * d
        tries, facing = 0, 0
        while facing == 0 and tries < PAIR_WALK:
            c_i, axis_i, rho_i, r_i = t.feature_placement(a, i, q_k, g.diameter[k])
            c_j, axis_j, rho_j, r_j = t.feature_placement(b, j, q_l, g.diameter[l])
            w = d + c_j - c_i
            m, found = stationary_normal(w, axis_i, rho_i, axis_j, rho_j, n, self.step_tolerance)
            tries = ti.select(found == 1, tries + 1, PAIR_WALK)
            # The stationary normal is the minimum if both cones hold it; else cross the bound it exceeds most.
            if found == 1:
                n = m
                miss_i, beyond_i = t.worst_bound(a, i, unrotate(q_k, n))
                miss_j, beyond_j = t.worst_bound(b, j, -unrotate(q_l, n))
                if ti.max(miss_i, miss_j) <= t.seam_tolerance:
                    facing = 1
                    depth, x_i, x_j = contact_along(n, c_i, axis_i, rho_i, r_i, d + c_j, axis_j, rho_j, r_j)
                elif miss_i >= miss_j:
                    i = beyond_i
                else:
                    j = beyond_j
        return facing, depth, n, x_i, x_j, i, j

    @ti.func
    def continued(self, a, b, k, l, features, d, q_k, q_l, n):
        """Depth [m], unit normal and contact point from grain k [m] of features continued beyond their bounds.

        The grains have the orientations q_k and q_l and lie d [m] apart, which may differ from the present state. The
        normal n starts the search; the depth is NO_NORMAL where there is no stationary normal, and then no depth.
        """
        g, t = self.grains, self.table
        c_i, axis_i, rho_i, r_i = t.feature_placement(a, features[0], q_k, g.diameter[k])
        c_j, axis_j, rho_j, r_j = t.feature_placement(b, features[1], q_l, g.diameter[l])
        n, found = stationary_normal(d + c_j - c_i, axis_i, rho_i, axis_j, rho_j, n, self.step_tolerance)
        depth, x_i, x_j = contact_along(n, c_i, axis_i, rho_i, r_i, d + c_j, axis_j, rho_j, r_j)
        return ti.select(found == 1, depth, NO_NORMAL + 0.0 * depth), n, 0.5 * (x_i + x_j)

    @ti.func
    def crossing(self, a, b, k, l, d, before, last_n, dt):
        """What the features `before`, continued beyond their bounds, give now that the contact has left them.

        Returns the fraction of the step since it left them, depth [m], unit normal and contact point from grain k [m].
        last_n: unit normal a step of dt [s] ago, world frame.
        """
        g, t = self.grains, self.table
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        depth, n, x = self.continued(a, b, k, l, before, d, g.orientation[k], g.orientation[l], last_n)
        # The last normal, rotated with each body, has now the body components that it had a step ago.
        last_n_k = last_n + dt * ti.cast(g.angular_velocity[k], self.real).cross(last_n)
        last_n_l = last_n + dt * ti.cast(g.angular_velocity[l], self.real).cross(last_n)
        fraction = ti.max(
            t.fraction_outside(a, before[0], unrotate(q_k, n), unrotate(q_k, last_n_k)),
            t.fraction_outside(b, before[1], -unrotate(q_l, n), -unrotate(q_l, last_n_l)),
        )
        return fraction, depth, n, x

    @ti.func
    def radii(self, a, b, k, l, s):
        """Radii [m] of the balls, or of the tubes about edges, with which both grains face each other in slot s."""
        g, t = self.grains, self.table
        feature = ti.max(self.pairs.feature[s], 0)
        r_i = t.surface_radius[t.first_row[a] + feature[0]] * g.diameter[k]
        return r_i, t.surface_radius[t.first_row[b] + feature[1]] * g.diameter[l]
