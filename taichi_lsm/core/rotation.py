"""Rotations of rigid bodies in 2D and 3D, as Taichi functions.

An orientation `q` takes vectors from the body frame to the world frame. It is a unit complex number (cos, sin) in 2D
and a unit quaternion (w, x, y, z) in 3D. An angular velocity has one component in 2D and three, in the world frame, in
3D [rad s-1]. Equation numbers are those of Abe & Mora (2003).
"""

from .runtime import ti


@ti.func
def rotational_velocity(omega, arm):
    """Velocity omega x arm [m s-1] of the point at `arm` [m] of a body that rotates with omega [rad s-1]."""
    if ti.static(arm.n == 2):
        return ti.Vector([-omega[0] * arm[1], omega[0] * arm[0]])
    else:
        return omega.cross(arm)


@ti.func
def velocity_turned_back(omega, arm, dt):
    """Change [m s-1] of omega x arm if the arm [m], fixed to the body, is that of dt/2 [s] ago.

    It was dt/2 omega x arm less than now, up to terms of second order.
    """
    return rotational_velocity(omega, rotational_velocity(-0.5 * dt * omega, arm))


@ti.func
def torque_of(arm, force):
    """Torque arm x force [N m], Eq. (15); one component in 2D."""
    if ti.static(arm.n == 2):
        return ti.Vector([arm[0] * force[1] - arm[1] * force[0]])
    else:
        return arm.cross(force)


@ti.func
def rotate(q, a):
    """World components of the body vector `a`: R a with the rotation R of q, Eqs. (19), (20)."""
    if ti.static(q.n == 2):
        return ti.Vector([q[0] * a[0] - q[1] * a[1], q[1] * a[0] + q[0] * a[1]])
    else:
        # a + 2 w (u x a) + 2 u x (u x a), u the vector part: 18 multiplications, fewer than building R.
        u = ti.Vector([q[1], q[2], q[3]])
        t = 2.0 * u.cross(a)
        return a + q[0] * t + u.cross(t)


@ti.func
def unrotate(q, a):
    """Body components of the world vector `a`: R^T a, the inverse of `rotate`."""
    if ti.static(q.n == 2):
        return ti.Vector([q[0] * a[0] + q[1] * a[1], q[0] * a[1] - q[1] * a[0]])
    else:
        u = ti.Vector([q[1], q[2], q[3]])
        t = 2.0 * a.cross(u)
        return a + q[0] * t + t.cross(u)


@ti.func
def half_tangent(angle):
    """tan(angle/2)/angle as a series, relative error below 1e-8 for |angle| < 0.5 and 1e-5 for |angle| < 1."""
    h2 = 0.25 * angle * angle
    return 0.5 * (1.0 + h2 * (1.0 / 3.0 + h2 * (2.0 / 15.0 + h2 * (17.0 / 315.0 + h2 * (62.0 / 2835.0)))))


@ti.func
def sub_rotation(q, momentum, axis: ti.template(), angle):
    """Rotate by `angle` [rad] about the body axis `axis` (0, 1, 2): (orientation, body momentum).

    The orientation is not normalised: its norm grows by sqrt(1 + t^2), t = tan(angle/2). The momentum is fixed in the
    world frame, so its body components rotate by -angle.
    """
    # From the tangent of the half angle, so that c^2 + s^2 = 1 to rounding whatever the error of the series.
    t = angle * half_tangent(angle)
    s = 1.0 / (1.0 + t * t)
    c, s = (1.0 - t * t) * s, 2.0 * t * s
    a, b = momentum[(axis + 1) % 3], momentum[(axis + 2) % 3]
    momentum[(axis + 1) % 3], momentum[(axis + 2) % 3] = c * a + s * b, c * b - s * a
    # Quaternion product q (1, t e), e the unit vector of the axis.
    w, x, y, z = q[0], q[1 + axis], q[1 + (axis + 1) % 3], q[1 + (axis + 2) % 3]
    q[0], q[1 + axis] = w - t * x, x + t * w
    q[1 + (axis + 1) % 3], q[1 + (axis + 2) % 3] = y + t * z, z - t * y
    return q, momentum


@ti.func
def free_rotor(q, momentum, inverse_inertia, dt):
    """Orientation of a torque-free rigid body (3D) after dt [s]; its angular momentum stays as it is.

    momentum [kg m2 s-1]: world frame; inverse_inertia (3,) [kg-1 m-2]: principal axes, the body frame. Symmetric
    splitting into rotations about the body axes 1, 2, 3, 2, 1 (Dullweber, Leimkuhler & McLachlan 1997): second order,
    reversible and symplectic, so that the energy of rotation has no trend.
    """
    p = unrotate(q, momentum)
    h = 0.5 * dt
    q_new, p = sub_rotation(q, p, ti.static(0), p[0] * inverse_inertia[0] * h)
    q_new, p = sub_rotation(q_new, p, ti.static(1), p[1] * inverse_inertia[1] * h)
    q_new, p = sub_rotation(q_new, p, ti.static(2), p[2] * inverse_inertia[2] * dt)
    q_new, p = sub_rotation(q_new, p, ti.static(1), p[1] * inverse_inertia[1] * h)
    q_new, p = sub_rotation(q_new, p, ti.static(0), p[0] * inverse_inertia[0] * h)
    return q_new / q_new.norm()


@ti.func
def angular_velocity_of(q, momentum, inverse_inertia):
    """Angular velocity R I^-1 R^T L [rad s-1] in the world frame (3D)."""
    return rotate(q, unrotate(q, momentum) * inverse_inertia)


@ti.func
def momentum_of(q, angular_velocity, inertia):
    """Angular momentum R I R^T omega [kg m2 s-1] in the world frame (3D); inertia (3,): principal moments."""
    return rotate(q, unrotate(q, angular_velocity) * inertia)


@ti.func
def advanced_orientation(q, omega, dt):
    """Orientation after rotating with omega [rad s-1] for dt [s].

    It replaces Eq. (18), whose result is not a rotation. The Cayley map keeps the norm to rounding; its argument is
    corrected so that the angle is |omega| dt.
    """
    if ti.static(q.n == 2):
        t = omega[0] * dt * half_tangent(omega[0] * dt)
        s = 1.0 / (1.0 + t * t)
        c, s = (1.0 - t * t) * s, 2.0 * t * s
        q_new = ti.Vector([q[0] * c - q[1] * s, q[1] * c + q[0] * s])
        # One Newton step of 1/|q|, so that rounding of the norm does not add up.
        return q_new * (1.5 - 0.5 * q_new.dot(q_new))
    else:
        angle = omega.norm() * dt
        u = omega * (dt * half_tangent(angle))
        s = 1.0 / ti.sqrt(1.0 + u.dot(u))
        # Quaternion product (1, u) q / sqrt(1 + u^2): the rotation acts in the world frame, hence on the left.
        w = q[0]
        v = ti.Vector([q[1], q[2], q[3]])
        w_new = (w - u.dot(v)) * s
        v_new = (v + w * u + u.cross(v)) * s
        q_new = ti.Vector([w_new, v_new[0], v_new[1], v_new[2]])
        return q_new * (1.5 - 0.5 * q_new.dot(q_new))


@ti.func
def linear_orientation_change(q, angle):
    """Change of an orientation by Eq. (18) as printed, omega * R dt; angle = omega dt [rad].

    The sum of an orientation and its change is not a rotation: the norm grows with every step.
    """
    if ti.static(q.n == 2):
        return ti.Vector([-angle[0] * q[1], angle[0] * q[0]])
    else:
        v = ti.Vector([q[1], q[2], q[3]])
        u = 0.5 * (q[0] * angle + angle.cross(v))
        return ti.Vector([-0.5 * angle.dot(v), u[0], u[1], u[2]])


@ti.func
def product(a, b):
    """Rotation b followed by rotation a: product of unit complex numbers (2D) or quaternions."""
    if ti.static(a.n == 2):
        return ti.Vector([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
    else:
        u, v = ti.Vector([a[1], a[2], a[3]]), ti.Vector([b[1], b[2], b[3]])
        w = a[0] * v + b[0] * u + u.cross(v)
        return ti.Vector([a[0] * b[0] - u.dot(v), w[0], w[1], w[2]])


@ti.func
def inverse(q):
    """Inverse of a rotation: the conjugate of its complex number or quaternion."""
    conjugate = -q
    conjugate[0] = q[0]
    return conjugate
