"""Where two rounded features face each other: pure geometry of points and circles that are dilated by a ball.

A face or a vertex of a ball-polyhedron is a ball about a point, an edge a tube about a circle (centre, unit axis,
radius rho). The unit normal n points from the first grain A to the second B. At the contact the sum of the support
functions h_A(n) + h_B(-n) is stationary in n, which makes the points of both surfaces with the normals n and -n lie on
one line along n. `w` is the vector from the centre of the feature of A to that of B [m]. All in the world frame.
"""

from ..core.runtime import ti

LONGEST_STEP = 0.7  # of Newton's method on the unit sphere: 35 degrees, so that n stays in its hemisphere
LEAST_CURVATURE = 1e-3  # of the sizes: keeps the Hessian positive definite where the depth approaches zero
RING_ITERATIONS = 12  # of Newton's method for two circles; it converges in three or four from the last normal

NO_NORMAL = -1.0  # in place of a depth [m] where two features have no stationary normal


@ti.func
def across_axis(n, axis):
    """Unit direction of the component of `n` normal to the unit vector `axis`, and length of that component."""
    across = n - n.dot(axis) * axis
    length = across.norm()
    return across / length, length


@ti.func
def core_point(n, axis, rho):
    """Point of a circle that lies farthest along n, relative to its centre [m]; zero for a ball (rho = 0)."""
    x = 0.0 * n
    if rho > 0.0:
        e, _ = across_axis(n, axis)
        x = rho * e
    return x


@ti.func
def point_towards_ring(w, axis, rho):
    """Vector [m] from a point to the nearest point of a circle whose centre lies at w, and 1 if that is a contact.

    The edge is convex: only from outside the cylinder of the circle does the normal of the nearest point point back.
    """
    e, q = across_axis(-w, axis)
    return w + rho * e, ti.select(q > rho, 1, 0)


@ti.func
def ring_towards_ring(w, a, rho_a, b, rho_b, n, tolerance):
    """Stationary normal n of two circles, centres w apart, and 1 if it was found: Newton's method on the unit sphere.

    With q_a = |n - (n.a) a| and likewise q_b, f(n) = -w.n + rho_a q_a + rho_b q_b has the gradient
    g = rho_a e_a + rho_b e_b - w, the vector x_A - x_B between the points of the circles, and, of each circle, the
    Hessian (rho/q) t t^T, t the tangent of the circle; -f I comes from the curvature of the sphere. A step solves
    H d = -g in the plane normal to n. a, b: unit axes; tolerance [-]: of the last step, after which the error is its
    square. A stationary point with f >= 0 would be an overlap of the circles themselves: not a contact.
    """
    found = 0
    for _ in range(RING_ITERATIONS):
        if found == 0:
            e_a, q_a = across_axis(n, a)
            e_b, q_b = across_axis(n, b)
            # Gradient and value, and a basis (t, s) of the tangent plane in which the first Hessian is diagonal.
            g = rho_a * e_a + rho_b * e_b - w
            f = g.dot(n)
            t = a.cross(e_a)  # unit and across n
            s = n.cross(t)
            t_b = b.cross(e_b)
            c, z = t_b.dot(t), t_b.dot(s)
            # Hessian of f on the sphere.
            gap = ti.max(-f, LEAST_CURVATURE * (rho_a + rho_b))
            k_b = rho_b / q_b
            h_tt = rho_a / q_a + k_b * c * c + gap
            h_ts = k_b * c * z
            h_ss = k_b * z * z + gap
            # Newton step by Cramer's rule, shortened if it is too long to be trusted.
            g_t, g_s = g.dot(t), g.dot(s)
            det = h_tt * h_ss - h_ts * h_ts
            d_t = (h_ts * g_s - h_ss * g_t) / det
            d_s = (h_ts * g_t - h_tt * g_s) / det
            size = ti.sqrt(d_t * d_t + d_s * d_s)
            if size < tolerance:
                found = ti.select(f < 0.0, 1, 2)
            shorten = ti.min(1.0, LONGEST_STEP / ti.max(size, 1e-30))
            n = (n + shorten * (d_t * t + d_s * s)).normalized()
    return n, ti.select(found == 1, 1, 0)


@ti.func
def stationary_normal(w, a, rho_a, b, rho_b, n, tolerance):
    """Stationary normal of two features w apart, and 1 if it was found; the given n starts the iteration.

    Balls where rho = 0, else circles with the unit axes a and b. Closed forms unless both are circles.
    """
    found = 1
    if rho_a == 0.0 and rho_b == 0.0:
        n = w.normalized()
    elif rho_a == 0.0:
        v, found = point_towards_ring(w, b, rho_b)
        n = v.normalized()
    elif rho_b == 0.0:
        v, found = point_towards_ring(-w, a, rho_a)
        n = -v.normalized()
    else:
        n, found = ring_towards_ring(w, a, rho_a, b, rho_b, n, tolerance)
    return n, found


@ti.func
def contact_along(n, c_a, axis_a, rho_a, r_a, c_b, axis_b, rho_b, r_b):
    """Depth h_A(n) + h_B(-n) [m] along n, and the points x_A and x_B [m] of the features with the normals n and -n.

    Each feature is given by its centre c, the unit axis and radius rho of its circle, and the radius r of its ball or
    tube, in one frame. x = c + core_point + r n is the point of the feature farthest along n, so that h(n) = n . x and
    depth = n . (x_A - x_B), whose gradient with respect to n is x_A - x_B.
    """
    x_a = c_a + core_point(n, axis_a, rho_a) + r_a * n
    x_b = c_b + core_point(-n, axis_b, rho_b) - r_b * n
    return (x_a - x_b).dot(n), x_a, x_b
