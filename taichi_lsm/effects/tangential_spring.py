"""Tangential springs: vectors that belong to a contact and turn with it, their energy and their stable step.

A spring has one component in 2D, along the normal turned by 90 degrees, and three in 3D, in the world frame. It is the
first entry of the history of every effect that uses these functions.
"""

import numpy as np

from ..core.runtime import ti
from .base import Bodies


def stable_spring_step(stiffness: float, bodies: Bodies) -> float:
    """Stable step 2/omega [s] of a tangential spring k_t [N m-1], omega^2 = 2 C k_t/m (1 + R^2 m/I).

    C contacts on the lightest grain and on its partner, as for a normal spring; R^2 m/I is the leverage of rotation.
    """
    per_contact = stiffness / bodies.least_mass * (1.0 + bodies.rotation_factor)
    # Both grains of a contact move, which doubles its frequency squared.
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
    """Tangential vector carried along with the contact plane: turned to the new normal n, then rotated about it.

    The least rotation from the last normal n_0 to n takes xi, across n_0, to xi - (xi.n) (n + n_0)/(1 + n.n_0). With
    n_0 = n - c, c = `contact.normal_change` across n, the quotient is n - c/2 up to the square of the angle. The length
    errs by an eighth of the fourth power of the angle, and by a 24th of that of the rotation about the normal; it never
    grows, which would create energy.
    """
    flat = xi - xi.dot(n) * (n - 0.5 * contact.normal_change)
    # Cosine and sine of the rotation of the step about the normal, of less than a radian.
    angle = ti.max(-1.0, ti.min(1.0, contact.normal_angular_velocity * contact.dt))
    square = angle * angle
    return (1.0 - 0.5 * square) * flat + (angle * (1.0 - square / 6.0)) * n.cross(flat)


@ti.func
def spring_of(contact, history):
    """The tangential vector with which a history begins, turned with the contact since the last step.

    One component in 2D, along the normal turned by 90 degrees: it turns with the contact by itself.
    """
    if ti.static(contact.normal.n == 2):
        return ti.Vector([history[0]])
    else:
        return transported(ti.Vector([history[0], history[1], history[2]]), contact.normal, contact)


@ti.func
def slip_of(contact):
    """Slip of the step [m], in the components of `spring_of`."""
    n = contact.normal
    if ti.static(n.n == 2):
        return ti.Vector([ti.Vector([-n[1], n[0]]).dot(contact.slip) * contact.dt])
    else:
        return contact.slip * contact.dt


@ti.func
def in_space(contact, xi):
    """World vector with the components of `spring_of`."""
    n = contact.normal
    if ti.static(n.n == 2):
        return xi[0] * ti.Vector([-n[1], n[0]])
    else:
        return xi


@ti.func
def limited(trial, limit):
    """(the spring `trial`, shortened to `limit` if it is longer; 1 if it was, else 0)."""
    xi, slides = trial, 0
    if ti.static(trial.n == 1):
        xi[0] = ti.max(-limit, ti.min(limit, trial[0]))
        slides = ti.cast(xi[0] != trial[0], ti.i32)
    else:
        size2 = trial.dot(trial)
        if size2 > limit * limit:
            xi = trial * (limit / ti.sqrt(size2))
            slides = 1
    return xi, slides


@ti.func
def remember(history: ti.template(), xi):
    """Write the spring xi to the beginning of a history."""
    for axis in ti.static(range(xi.n)):
        history[axis] = xi[axis]
