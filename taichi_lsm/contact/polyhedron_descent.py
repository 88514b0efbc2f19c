"""Minimum of h_A(n) + h_B(-n) of two ball-polyhedra over all directions n, by Newton's method with backtracking."""

from typing import Any

from ..core.rotation import unrotate
from ..core.runtime import current, ti
from .feature_pairs import LEAST_CURVATURE, LONGEST_STEP, across_axis, contact_along

ITERATIONS = 60  # of the descent; most searches take fewer than ten
SUFFICIENT_DECREASE = 1e-4  # fraction of the predicted decrease that a step must reach (Armijo)
ROUNDING = 1e-15  # of the sizes: an increase below it is rounding
SHORTEST = 1e-6  # length of a step, relative to that of Newton, at which backtracking ends


@ti.func
def tangent_basis(n):
    """Two unit vectors e and o = n x e that span the plane normal to the unit vector n."""
    # Across the x axis, unless n is close to it.
    e = ti.Vector([0.0 * n[0], n[2], -n[1]])
    if ti.abs(n[0]) > 0.7:
        e = ti.Vector([-n[2], 0.0 * n[0], n[0]])
    e = e.normalized()
    return e, n.cross(e)


@ti.func
def support_hessian(n, axis, rho, core, e, o):
    """Second derivatives (ee, eo, oo) [m] of a feature's support function along the tangents e and o of n.

    A ball of the radius `core` gives core I; the circle of an edge adds (rho/q) t t^T, t = axis x (n across the axis)
    its unit tangent at the farthest point and q the length of n across the axis.
    """
    h = ti.Vector([core, 0.0 * core, core])
    if rho > 0.0:
        across, q = across_axis(n, axis)
        t = axis.cross(across)
        t_e, t_o = t.dot(e), t.dot(o)
        h[0] += rho / q * t_e * t_e
        h[1] += rho / q * t_e * t_o
        h[2] += rho / q * t_o * t_o
    return h


@ti.func
def newton_step(f, gradient, h, e, o, size):
    """Step s in the tangent plane of n, its slope g . s [m] and |g| [m]: (H + max(-f, floor) I) s = -g.

    On the unit sphere the Hessian of a support function extended to degree one is reduced by its value: hence -f I.
    The floor LEAST_CURVATURE * size keeps the matrix positive definite, so that s is a descent direction. h (3,) [m]:
    sum of the Hessians of both features; size [m]: sum of the radii. A step longer than LONGEST_STEP is shortened.
    """
    gap = ti.max(-f, LEAST_CURVATURE * size)
    ee, eo, oo = h[0] + gap, h[1], h[2] + gap
    g_e, g_o = gradient.dot(e), gradient.dot(o)
    det = ee * oo - eo * eo
    s_e, s_o = (eo * g_o - oo * g_e) / det, (eo * g_e - ee * g_o) / det
    shorten = ti.min(1.0, LONGEST_STEP / ti.max(ti.sqrt(s_e * s_e + s_o * s_o), 1e-30))
    return shorten * (s_e * e + s_o * o), shorten * (s_e * g_e + s_o * g_o), ti.sqrt(g_e * g_e + g_o * g_o)


@ti.data_oriented
class PolyhedronDescent:
    """General search for the direction of least h_A(n) + h_B(-n), from the line of centres.

    Parameters
    ----------
    table : PolyhedronTable
        Features of all parts.
    grains
        State of the grains.

    Notes
    -----
    It is needed where a contact begins or its features jump. The descent runs on the cores, the grains without the
    dilation that rounds edges and vertices: the dilations add a constant to the sum, hence the minimum is the same, and
    the cores of touching grains are apart, so that f = h_A(n) + h_B(-n) of the cores is negative there.
    """

    def __init__(self, table: Any, grains: Any) -> None:
        self.table, self.grains = table, grains
        self.real = current().real
        self.gradient_tolerance = 1e-13 if self.real == ti.f64 else 1e-6  # relative to the size of the grains

    @ti.func
    def minimise(self, a, b, k, l, d, i, j):
        """Direction n and features i, j of part a of grain k and part b of grain l with the least h_A(n) + h_B(-n).

        d = c_l - c_k [m]; i and j start the search for the features along n. The descent ends where the gradient in
        the tangent plane vanishes, or at the first direction that separates the grains: then they do not touch.
        """
        g, t = self.grains, self.table
        q_k, q_l = ti.cast(g.orientation[k], self.real), ti.cast(g.orientation[l], self.real)
        dilation_k, dilation_l = t.dilation[a] * g.diameter[k], t.dilation[b] * g.diameter[l]
        size = g.radius[k] + g.radius[l]
        n = d.normalized()
        # The last direction that was accepted, the value there, and the step from it with its slope and length.
        from_n, step, slope, length = n, 0.0 * n, 0.0 * size, ti.cast(1.0, self.real)
        least = 1e30 * size
        searching = 1
        for _ in range(ITERATIONS):
            if searching == 1:
                # Value and gradient at n, on the features whose cones hold n and -n.
                i = t.feature_of(a, unrotate(q_k, n), i)
                j = t.feature_of(b, -unrotate(q_l, n), j)
                c_i, axis_i, rho_i, r_i = t.feature_placement(a, i, q_k, g.diameter[k])
                c_j, axis_j, rho_j, r_j = t.feature_placement(b, j, q_l, g.diameter[l])
                core_i, core_j = r_i - dilation_k, r_j - dilation_l
                f, x_i, x_j = contact_along(n, c_i, axis_i, rho_i, core_i, d + c_j, axis_j, rho_j, core_j)
                if f + dilation_k + dilation_l < 0.0:
                    searching = 0
                elif f > least + SUFFICIENT_DECREASE * length * slope + ROUNDING * size:
                    # Too little decrease: try half of the step.
                    length *= 0.5
                    n = (from_n + length * step).normalized()
                    if length < SHORTEST:
                        searching = 0
                else:
                    # Accept n and take the next Newton step from here.
                    e, o = tangent_basis(n)
                    h = support_hessian(n, axis_i, rho_i, core_i, e, o)
                    h += support_hessian(n, axis_j, rho_j, core_j, e, o)
                    new_step, new_slope, slope_norm = newton_step(f, x_i - x_j, h, e, o, size)
                    if slope_norm < self.gradient_tolerance * size:
                        searching = 0
                    else:
                        step, slope = new_step, new_slope
                        least, from_n, length = f, n, 1.0
                        n = (n + step).normalized()
        return n, i, j
