"""Where two rounded features face each other: pure geometry of points and circles that are dilated by a ball.

A face or a vertex is a ball about a point, an edge a tube about a circle (centre, unit axis, radius rho). n is the
unit direction from the first grain to the second along which both surfaces turn to each other: there the sum of
the support functions h_A(n) + h_B(-n) is stationary. `w` is the vector between the centres of the two features [m].
"""

from ..core.runtime import ti

RING_ITERATIONS = 12


@ti.func
def around(n, axis):
    """(unit direction of `n` across the axis, length of that component of n)."""
    flat = n - n.dot(axis) * axis
    length = flat.norm()
    return flat / length, length


@ti.func
def core_point(n, axis, rho):
    """Point of a circle that lies farthest along n, from its centre [m]; the centre itself of a ball (rho = 0)."""
    x = 0.0 * n
    if rho > 0.0:
        e, _ = around(n, axis)
        x = rho * e
    return x


@ti.func
def point_towards_ring(w, axis, rho):
    """(vector from a point to the nearest point of a circle whose centre lies at w, 1 if the point is outside of it).

    From inside the circle's cylinder the nearest point is not the one whose normal points back: no contact there.
    """
    e, q = around(-w, axis)
    return w + rho * e, ti.select(q > rho, 1, 0)


@ti.func
def ring_towards_ring(w, a, rho_a, b, rho_b, n, tolerance):
    """(n, found) of two circles, centres w apart, unit axes a and b, by Newton's method on the unit sphere.

    f(n) = -w.n + rho_a |n across a| + rho_b |n across b| has the gradient x_A - x_B and the Hessian
    (rho/|n across|) t t^T of each circle, t the tangent; -f I comes from the sphere. tolerance [-]: of the last step,
    after which the error is its square.
    """
    found = 0
    for _ in range(RING_ITERATIONS):
        if found == 0:
            e_a, q_a = around(n, a)
            e_b, q_b = around(n, b)
            g = rho_a * e_a + rho_b * e_b - w
            f = g.dot(n)
            t = a.cross(e_a)  # unit and across n
            s = n.cross(t)
            t_b = b.cross(e_b)
            c, z = t_b.dot(t), t_b.dot(s)
            gap = ti.max(-f, 1e-3 * (rho_a + rho_b))
            k_b = rho_b / q_b
            h_tt = rho_a / q_a + k_b * c * c + gap
            h_ts = k_b * c * z
            h_ss = k_b * z * z + gap
            g_t, g_s = g.dot(t), g.dot(s)
            det = h_tt * h_ss - h_ts * h_ts
            d_t = (h_ts * g_s - h_ss * g_t) / det
            d_s = (h_ts * g_t - h_tt * g_s) / det
            size = ti.sqrt(d_t * d_t + d_s * d_s)
            if size < tolerance:
                found = ti.select(f < 0.0, 1, 2)
            shorten = ti.min(1.0, 0.7 / ti.max(size, 1e-30))
            n = (n + shorten * (d_t * t + d_s * s)).normalized()
    return n, ti.select(found == 1, 1, 0)


@ti.func
def stationary_normal(w, a, rho_a, b, rho_b, n, tolerance):
    """(n, found) for features w apart: balls where rho = 0, else circles. The given n starts the iteration."""
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
