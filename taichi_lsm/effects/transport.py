"""Tangential springs: vectors that belong to a contact and turn with it, their energy and their stable step."""

import numpy as np

from ..runtime import ti


def stable_spring_step(stiffness, bodies):
    """Stable step [s] of a tangential spring [N m-1]: as of a normal one, with the leverage R^2 m/I of spinning."""
    per_contact = stiffness / bodies.least_mass * (1.0 + bodies.spin_factor)
    return 2.0 / np.sqrt(2.0 * bodies.coordination * per_contact)


@ti.func
def square_of(contact, history):
    """Square of the tangential vector with which a history begins: one number in 2D, three in 3D."""
    square = history[0] * history[0]
    if ti.static(contact.normal.n == 3):
        square += history[1] * history[1] + history[2] * history[2]
    return square


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
