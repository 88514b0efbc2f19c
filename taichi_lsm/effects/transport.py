"""Tangential vectors that belong to a contact and turn with it."""

from ..runtime import ti


@ti.func
def transported(xi, n, contact):
    """Tangential vector carried along with the contact plane: turned to the new normal n, then spun about it.

    Projection on the new plane with the length restored is the least rotation up to the square of the small angle
    that the normal turns in one step. The length is restored by the series of 1/sqrt(1 - x), x the square of the sine
    of that angle: to 3e-9 for a turn of 0.1, and for wild turns too short, which creates no energy.
    """
    along = xi.dot(n)
    size2 = xi.dot(xi)
    x = ti.select(size2 > 0.0, along * along / size2, 0.0)
    flat = (xi - along * n) * (1.0 + x * (0.5 + x * (0.375 + x * 0.3125)))
    return flat + (contact.spin_about_normal * contact.dt) * n.cross(flat)
