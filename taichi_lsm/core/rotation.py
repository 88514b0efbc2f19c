"""Rotations in 2D (unit complex number, one spin) and 3D (unit quaternion w, x, y, z; spin in the world frame)."""

from .runtime import ti


@ti.func
def rotational_velocity(omega, arm):
    """Velocity omega x arm [m s-1] of the point at `arm` [m] on a body spinning with omega [rad s-1]."""
    if ti.static(arm.n == 2):
        return ti.Vector([-omega[0] * arm[1], omega[0] * arm[0]])
    else:
        return omega.cross(arm)


@ti.func
def torque_of(arm, force):
    """Torque arm x force [N m], Eq. (15); one component in 2D."""
    if ti.static(arm.n == 2):
        return ti.Vector([arm[0] * force[1] - arm[1] * force[0]])
    else:
        return arm.cross(force)


@ti.func
def rotate(turn, a):
    """Body vector `a` seen in the world frame, Eqs. (19), (20)."""
    if ti.static(turn.n == 2):
        return ti.Vector([turn[0] * a[0] - turn[1] * a[1], turn[1] * a[0] + turn[0] * a[1]])
    else:
        u = ti.Vector([turn[1], turn[2], turn[3]])
        t = 2.0 * u.cross(a)
        return a + turn[0] * t + u.cross(t)


@ti.func
def unrotate(turn, a):
    """World vector `a` seen in the body frame: the inverse of `rotate`."""
    if ti.static(turn.n == 2):
        return ti.Vector([turn[0] * a[0] + turn[1] * a[1], turn[0] * a[1] - turn[1] * a[0]])
    else:
        u = ti.Vector([turn[1], turn[2], turn[3]])
        t = 2.0 * a.cross(u)
        return a + turn[0] * t + t.cross(u)


@ti.func
def half_tangent(angle):
    """tan(angle/2)/angle as a series, relative error below 1e-8 for |angle| < 0.5 and 1e-5 for |angle| < 1."""
    h2 = 0.25 * angle * angle
    return 0.5 * (1.0 + h2 * (1.0 / 3.0 + h2 * (2.0 / 15.0 + h2 * (17.0 / 315.0 + h2 * (62.0 / 2835.0)))))


@ti.func
def sub_rotation(q, momentum, axis: ti.template(), angle):
    """Turn about the body axis `axis` (0, 1, 2) by `angle` [rad]: (orientation, not normalised; body momentum).

    The momentum is fixed in the world, so it turns the other way round in the body frame.
    """
    t = angle * half_tangent(angle)
    s = 1.0 / (1.0 + t * t)
    c, s = (1.0 - t * t) * s, 2.0 * t * s
    a, b = momentum[(axis + 1) % 3], momentum[(axis + 2) % 3]
    momentum[(axis + 1) % 3], momentum[(axis + 2) % 3] = c * a + s * b, c * b - s * a
    w, x, y, z = q[0], q[1 + axis], q[1 + (axis + 1) % 3], q[1 + (axis + 2) % 3]
    q[0], q[1 + axis] = w - t * x, x + t * w
    q[1 + (axis + 1) % 3], q[1 + (axis + 2) % 3] = y + t * z, z - t * y
    return q, momentum


@ti.func
def free_rotor(turn, momentum, inverse_inertia, dt):
    """Orientation of a torque-free rigid body (3D) after dt [s]; its angular momentum stays as it is.

    momentum [kg m2 s-1]: world frame; inverse_inertia (3,) [kg-1 m-2]: principal axes, the body frame. Symmetric
    splitting into turns about the body axes 1, 2, 3, 2, 1 (Dullweber, Leimkuhler & McLachlan 1997): second order,
    reversible and symplectic, so that the energy of rotation has no trend.
    """
    p = unrotate(turn, momentum)
    h = 0.5 * dt
    q, p = sub_rotation(turn, p, ti.static(0), p[0] * inverse_inertia[0] * h)
    q, p = sub_rotation(q, p, ti.static(1), p[1] * inverse_inertia[1] * h)
    q, p = sub_rotation(q, p, ti.static(2), p[2] * inverse_inertia[2] * dt)
    q, p = sub_rotation(q, p, ti.static(1), p[1] * inverse_inertia[1] * h)
    q, p = sub_rotation(q, p, ti.static(0), p[0] * inverse_inertia[0] * h)
    return q / q.norm()


@ti.func
def angular_velocity_of(turn, momentum, inverse_inertia):
    """Angular velocity R I^-1 R^T L [rad s-1] in the world frame (3D)."""
    return rotate(turn, unrotate(turn, momentum) * inverse_inertia)


@ti.func
def momentum_of(turn, angular_velocity, inertia):
    """Angular momentum R I R^T omega [kg m2 s-1] in the world frame (3D); inertia (3,): principal moments."""
    return rotate(turn, unrotate(turn, angular_velocity) * inertia)


@ti.func
def advanced_orientation(turn, omega, dt):
    """Orientation after spinning with omega [rad s-1] for dt [s]; replaces Eq. (18), which leaves the rotations.

    The Cayley map keeps the norm to rounding; its argument is corrected so that the angle is |omega| dt.
    """
    if ti.static(turn.n == 2):
        t = omega[0] * dt * half_tangent(omega[0] * dt)
        s = 1.0 / (1.0 + t * t)
        c, s = (1.0 - t * t) * s, 2.0 * t * s
        q = ti.Vector([turn[0] * c - turn[1] * s, turn[1] * c + turn[0] * s])
        return q * (1.5 - 0.5 * q.dot(q))
    else:
        angle = omega.norm() * dt
        u = omega * (dt * half_tangent(angle))
        s = 1.0 / ti.sqrt(1.0 + u.dot(u))
        w = turn[0]
        v = ti.Vector([turn[1], turn[2], turn[3]])
        w_new = (w - u.dot(v)) * s
        v_new = (v + w * u + u.cross(v)) * s
        q = ti.Vector([w_new, v_new[0], v_new[1], v_new[2]])
        return q * (1.5 - 0.5 * q.dot(q))


@ti.func
def linear_orientation_change(turn, angle):
    """Change of an orientation by Eq. (18) as printed, omega * R dt; angle = omega dt [rad]. Leaves the rotations."""
    if ti.static(turn.n == 2):
        return ti.Vector([-angle[0] * turn[1], angle[0] * turn[0]])
    else:
        v = ti.Vector([turn[1], turn[2], turn[3]])
        u = 0.5 * (turn[0] * angle + angle.cross(v))
        return ti.Vector([-0.5 * angle.dot(v), u[0], u[1], u[2]])


@ti.func
def product(a, b):
    """Turn b followed by turn a: unit complex numbers (2D) or quaternions."""
    if ti.static(a.n == 2):
        return ti.Vector([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
    else:
        u, v = ti.Vector([a[1], a[2], a[3]]), ti.Vector([b[1], b[2], b[3]])
        w = a[0] * v + b[0] * u + u.cross(v)
        return ti.Vector([a[0] * b[0] - u.dot(v), w[0], w[1], w[2]])


@ti.func
def inverse(turn):
    """The turn that undoes another one."""
    result = -turn
    result[0] = turn[0]
    return result
