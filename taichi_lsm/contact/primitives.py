"""Where two grains touch: pure geometry of spheres and of arc chains, Eqs. (1)-(9) in their corrected form.

All vectors are relative to the first grain of the pair. `n` points from grain k to grain l, as Eq. (3) should read.
"""

from ..core.runtime import ti

SPHERE_OVERLAP_LIMIT = (
    0.9  # of the radii of two full circles: no step that `Guards.displacement` allows passes the rest unseen
)


@ti.func
def cross2(a, b):
    """Signed area a x b of two plane vectors."""
    return a[0] * b[1] - a[1] * b[0]


@ti.func
def sphere_overlap(w, r_i, r_j):
    """Contact of two spherical patches whose centres are `w` = p_j - p_i apart [m], Eqs. (2), (3), (6), (9).

    r_i, r_j [m]: radii. Returns depth d = r_i + r_j - |w| [m], positive if they touch, the unit normal n = w/|w|
    and the distance of the contact point from p_i along n: r_i - d/2, the middle of the overlap.
    Coincident centres have no normal; the caller refuses depths beyond ROUND_CAP before the normal is used.
    """
    distance = w.norm()
    depth = r_i + r_j - distance
    return depth, w * (1.0 / distance), r_i - 0.5 * depth


@ti.func
def cone_step(u, low, high):
    """Which way along the chain the normal direction `u` leaves an arc, and how far: Eqs. (4), (5) in 2D.

    u, low, high: unit vectors; the arc's normals run counter-clockwise from low to high, less than pi apart.
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
    """How far the unit direction `u` lies outside the arc [-]: 0 inside, the sine of the angle to the nearer seam,
    2 if it points away from the arc altogether.
    """
    miss = ti.max(0.0, ti.max(-cross2(low, u), -cross2(u, high)))
    if u.dot(low + high) < 0.0:
        miss = 0.0 * miss + 2.0
    return miss
