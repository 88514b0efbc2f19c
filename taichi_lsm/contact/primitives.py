"""Where two patches touch: pure geometry of spheres and arcs, Eqs. (1)-(9) of Abe & Mora (2003), corrected.

All vectors are relative to the centre of the first grain of the pair. The unit normal `n` points from grain k to
grain l, as Eq. (3) should read.
"""

from ..core.runtime import ti

# Greatest depth of two full circles or spheres over the sum of their radii. The rest is more than `Guards.displacement`
# allows in a step, so that no pair reaches coincident centres unreported.
SPHERE_OVERLAP_LIMIT = 0.9


@ti.func
def cross2(a, b):
    """Cross product a x b of two plane vectors: the signed area between them."""
    return a[0] * b[1] - a[1] * b[0]


@ti.func
def sphere_overlap(w, r_i, r_j):
    """Depth [m], unit normal, and distance [m] of the contact point from p_i along it, Eqs. (2), (3), (6), (9).

    w = p_j - p_i [m]: from centre to centre; r_i, r_j [m]: radii. The depth d = r_i + r_j - |w| is positive if the
    spheres touch, n = w/|w|, and the contact point r_i - d/2 lies in the middle of the overlap.
    Coincident centres have no normal: callers report depths beyond SPHERE_OVERLAP_LIMIT, and the run stops.
    """
    distance = w.norm()
    depth = r_i + r_j - distance
    return depth, w * (1.0 / distance), r_i - 0.5 * depth


@ti.func
def cone_step(u, low, high):
    """Direction along the chain in which the normal `u` leaves an arc, and how far: Eqs. (4), (5) in 2D.

    u, low, high: unit vectors; the normals of the arc run counter-clockwise from low to high, less than pi apart.
    Returns (step, distance): step 0 inside, else -1 or +1 towards the nearer seam; distance 1 - cos of the angle to
    that seam. Half-open: a direction on a seam belongs to the arc that begins there, so that it is counted once.
    """
    step = 0
    distance = 0.0 * u[0]
    if cross2(low, u) < 0.0 or cross2(u, high) <= 0.0:
        to_low, to_high = u.dot(low), u.dot(high)
        step = ti.select(to_low > to_high, -1, 1)
        distance = 1.0 - ti.max(to_low, to_high)
    return step, distance


@ti.func
def cone_violation(u, low, high):
    """Distance of the unit direction `u` from the normals of an arc [-], 0 inside.

    The sine of the angle to the nearer seam; 2, more than any sine, where u points away from the arc altogether.
    """
    miss = ti.max(0.0, ti.max(-cross2(low, u), -cross2(u, high)))
    if u.dot(low + high) < 0.0:
        miss = 0.0 * miss + 2.0
    return miss
