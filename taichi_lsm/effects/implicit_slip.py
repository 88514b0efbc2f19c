"""The slip of one step under rate-and-state friction: one equation, solved by a fixed number of iterations.

Lengths are in units of `limit` = a F_n/k_t, the stretch of the spring that changes friction by a F_n. The spring has
the trial length q. Of it w becomes slip, V = w limit/dt, and z = q - w remains, mu = a z. Friction is
mu = a asinh(V/(2 V_0) exp((mu_0 + b s)/a)), s = ln(V_0 theta/D_c) the state at the end of the step, so that h = 0 in

    h(w) = ln(w/rate) + mu_0/a + (b/a) s(w) - ln(2 sinh z),    rate = V_0 dt/limit.

h begins at -inf where nothing slips, and ends at inf where all of q does.

The unknown u is the smaller one of w and z. In the variable k = ln u + u both logarithms are nearly straight lines:
without evolution of the state |dh/dk| lies between 1/2 and 2, and the starting value errs by less than 1 in k. An
iteration is a step of Halley's method in k and one of Fritsch, Shafer & Crowley (1973) from k back to u, of third and
of fourth order. Errors of k thus go from 1 to about 1e-2, 1e-6 and less than 1e-16. A state that evolves within the
step bends h. How much it does is measured by

    B = b F_n/(k_t D_c) for the ageing law, times 1 + |ln(V theta/D_c)| for the slip law.

ds/dw lies between -B a/b and 0 for the ageing law, where s is the logarithm of a mixture of falling exponentials; so
dh/dw > 1/w + 1 - B, and for B < 1 there is one solution. After ITERATIONS, in double precision,

    |error of ln V| <= 1e-13 + 4e-16 (q + mu_0/a + (b/a) |s| + |ln w| + |ln rate|)    for B <= 0.3;

the second term is the rounding of h itself. `tests/effects/test_implicit_slip.py` compares with bisection over the
range of all parameters. If B > 1, on a soft spring, a contact may slip unstably within the step, and h have several
roots. u then stays in a bracket of one of them, and what has not slipped yet does so in the next steps.
"""

import math

from ..core.elementary import at_least, at_most, exp, log, polynomial
from ..core.runtime import ti

ITERATIONS = 3
STRAIGHT = 0.05  # least slope |dh/dk| that a step trusts
ACCEPTED = 1e-4  # a step so small, in k, is made even if rounding lets it leave the bracket
EDGE = 1.0 - 1e-6  # of q: the largest u
SERIES_BELOW = 0.01  # where 1 - e^-x would cancel
PHI_SERIES = tuple((-1.0) ** n / math.factorial(n + 1) for n in range(6))


@ti.func
def phi(x, left):
    """(1 - e^-x)/x, given left = e^-x."""
    return ti.select(x < SERIES_BELOW, polynomial(x, PHI_SERIES), (1.0 - left) / x)


@ti.func
def state_after(ageing: ti.template(), s, exp_s, y, x, r):
    """State s = ln(V_0 theta/D_c) after a step at V = V_0 e^y; x = V dt/D_c, r = V_0 dt/D_c, exp_s = e^s.

    With phi = (1 - e^-x)/x the ageing law gives theta V_0/D_c -> e^(s - x) + r phi, the slip law s -> s e^-x - y x phi.
    """
    left = exp(-x)
    mean = phi(x, left)
    if ti.static(ageing):
        old, new = exp_s * left, r * mean
        e = new / old  # where it is small the logarithm of the sum would lose it to rounding
        return ti.select(e < 1e-3, s - x + e * (1.0 - e * (0.5 - e / 3.0)), log(old + new))
    else:
        return s * left - y * (x * mean)


@ti.func
def state_and_slopes(ageing: ti.template(), rough: ti.template(), s, exp_s, y, x, r):
    """(`state_after`, its first and second derivative in y); rough as in `elementary.exp`."""
    left = exp(-x, rough)
    mean = phi(x, left)
    if ti.static(ageing):
        old = exp_s * left
        total, rest = old + r * mean, r * (left - mean)
        per_total = 1.0 / total
        first = (rest - x * old) * per_total
        second = ((x - 1.0) * x * old - rest - r * x * left) * per_total - first * first
        return log(total, rough), first, second
    else:
        first = -x * (left * (s + y) + mean)
        second = -x * left * ((1.0 - x) * (s + y) + 2.0)
        return s * left - y * (x * mean), first, second


@ti.func
def state_about(ageing: ti.template(), s, y, x, ln_r):
    """`state_after` for a starting value, to a tenth: 1/phi is about the root of 1 + x + x^2."""
    if ti.static(ageing):
        a, b = s - x, ln_r - 0.5 * log(1.0 + x + x * x, True)
        apart = ti.abs(a - b)
        return at_least(a, b) + 0.69 / (1.0 + apart * (0.72 + 0.6 * apart))  # about ln(e^a + e^b)
    else:
        left = exp(-x, True)
        return s * left - y * (1.0 - left)


@ti.func
def omega(k):
    """Root w of ln w + w = k, to 7 percent: Pade's form of Lambert's W(e^k) below 1, its asymptotic form above."""
    e = exp(at_most(k, 1.0), True)
    high = at_least(k, 1.0)
    below = e * (1.0 + 4.0 / 3.0 * e) / (1.0 + e * (7.0 / 3.0 + 5.0 / 6.0 * e))
    return ti.select(k > 1.0, high - log(high, True) * (high / (1.0 + high)), below)


@ti.func
def stretch(p):
    """asinh(e^p/2), to 0.03."""
    return ti.select(p > 0.0, p + 0.48 / (1.0 + p + 2.2 * p * p), 0.48 * exp(at_most(p, 0.0), True))


@ti.func
def starting_value(ageing: ti.template(), q, rate, r, s, mu_0, b):
    """(w, z), the smaller one near the solution; arguments as for `slip_of_step`."""
    ln_r = log(r)
    # With the state of no slip, and sinh z as for large z or as for w much less than q: ln w + w = k.
    left = exp(-2.0 * q, True)
    k = q + log(2.0 * q * phi(2.0 * q, left) * rate, True) - mu_0 - b * state_about(ageing, s, 0.0, 0.0, ln_r)
    w = omega(k)
    # Where slip takes nearly all of q: friction at that velocity, with the state after it.
    y = log(q / rate, True)
    z = at_most(stretch(y + mu_0 + b * state_about(ageing, s, y, q * (r / rate), ln_r)), 0.5 * q)
    small = w < 0.5 * q
    return ti.select(small, w, q - z), ti.select(small, q - w, z)


@ti.func
def halley_step(u, h, h_1, h_2):
    """(u after a step, size of the step in k); h, and its slopes in ln u, with a sign such that h rises with u."""
    # dk = p d ln u. The step of k is p n/d; Halley's denominator is kept from growing the step more than twofold.
    p = 1.0 + u
    per_p = 1.0 / p
    h_1 = at_least(h_1, STRAIGHT * p)
    square = h_1 * h_1
    d = at_least(square - 0.5 * h * (h_2 - h_1 * (u * per_p)), 0.5 * square)
    n = at_most(at_least(-h * h_1, -d * ((2.0 + 0.5 * u) * per_p)), d * ((2.0 + u) * per_p))
    # ln u + u = k + step: u + u (step/p) (g - step)/(g - 2 step), g = 2 p (p + 2/3 step)
    above = 2.0 * p * d + (4.0 / 3.0 * p - 1.0) * n
    below = 2.0 * p * d + (4.0 / 3.0 * p - 2.0) * n
    return u + u * (n * above / (d * below)), p * ti.abs(n) / d


@ti.func
def slip_of_step(ageing: ti.template(), q, rate, r, s, mu_0, b):
    """(w, z, state) at the end of a step, see the module: the smaller one of w and z has its full precision.

    q, rate [1]: see the module. r [1]: V_0 dt/D_c. s: state at the beginning. mu_0, b: mu_0/a and b/a.
    """
    exp_s, per_rate = exp(s), 1.0 / rate
    w, z = starting_value(ageing, q, rate, r, s, mu_0, b)
    least_w, most_w, least_z, most_z = 0.0 * q, q, 0.0 * q, q
    for iteration in ti.static(range(ITERATIONS)):
        rough = ti.static(iteration == 0)
        y = log(w * per_rate, rough)
        state, state_1, state_2 = state_and_slopes(ageing, rough, s, exp_s, y, w * (r * per_rate), r)
        left = exp(-2.0 * z, rough)
        gap = ti.select(z < 0.5 * SERIES_BELOW, 2.0 * z * polynomial(2.0 * z, PHI_SERIES), 1.0 - left)  # 1 - e^-2z
        h = y + mu_0 + b * state - z - log(gap, rough)
        # Slopes in ln w of all but the last term of h; in ln z of ln(2 sinh z): z coth z, and less z^2/sinh^2 z.
        w_1, w_2 = 1.0 + b * state_1, b * state_2
        per_gap = 1.0 / gap
        z_1 = z * (2.0 - gap) * per_gap
        pole = at_most(z, 40.0) * per_gap
        z_2 = z_1 - 4.0 * left * pole * pole
        # Slopes of h in ln u: that of the logarithm of the other one is -t.
        by_slip = w < z
        u = at_most(w, z)
        t = u / at_least(w, z)
        of_w, of_z = ti.select(by_slip, 1.0, -t), ti.select(by_slip, -t, 1.0)
        sign = ti.select(by_slip, 1.0, -1.0)
        h_1 = w_1 * of_w - z_1 * of_z
        h_2 = w_2 * of_w * of_w - z_2 * of_z * of_z + (t + t * t) * ti.select(by_slip, z_1, -w_1)
        new, size = halley_step(u, sign * h, sign * h_1, sign * h_2)
        # The bracket; a step that leaves it goes to its middle.
        beyond = h > 0.0
        least_w, most_w = ti.select(beyond, least_w, w), ti.select(beyond, w, most_w)
        least_z, most_z = ti.select(beyond, z, least_z), ti.select(beyond, most_z, z)
        least, most = ti.select(by_slip, least_w, least_z), ti.select(by_slip, most_w, most_z)
        kept = ((new > least) & (new < most)) | (size < ACCEPTED)
        u = at_most(ti.select(kept, new, ti.sqrt(at_least(least, 0.01 * most) * most)), EDGE * q)
        w, z = ti.select(by_slip, u, q - u), ti.select(by_slip, q - u, u)
    return w, z, state_after(ageing, s, exp_s, log(w * per_rate), w * (r * per_rate), r)
