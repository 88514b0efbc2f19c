"""The free rotor in 3D against closed forms: precession, growth about the middle axis, energy over a million steps."""

import numpy as np
import pytest

from taichi_lsm.core.rotation import angular_velocity_of, free_rotor, momentum_of
from taichi_lsm.core.runtime import ti
from tests.helpers import scenes

pytestmark = pytest.mark.skipif(scenes.PRECISION == "f32", reason="the state of the rotation is always f64")


@ti.data_oriented
class Rotor:
    """One rigid body without forces; every `every` steps its energy and its angular velocity in the body frame."""

    def __init__(self, samples):
        self.orientation, self.momentum = ti.Vector.field(4, ti.f64, ()), ti.Vector.field(3, ti.f64, ())
        self.inertia = ti.Vector.field(3, ti.f64, ())
        self.rows = ti.Vector.field(5, ti.f64, samples)  # energy, angular velocity about the principal axes, |q|

    def start(self, inertia, angular_velocity, orientation=(1.0, 0.0, 0.0, 0.0)):
        self.inertia[None], self.orientation[None] = inertia, orientation
        self.set_angular_velocity(*angular_velocity)

    @ti.kernel
    def set_angular_velocity(self, x: ti.f64, y: ti.f64, z: ti.f64):
        self.momentum[None] = momentum_of(self.orientation[None], ti.Vector([x, y, z]), self.inertia[None])

    @ti.kernel
    def run(self, samples: ti.i32, every: ti.i32, dt: ti.f64):
        ti.loop_config(serialize=True)
        for i in range(samples):
            q, p, inverse = self.orientation[None], self.momentum[None], 1.0 / self.inertia[None]
            for _ in range(every):
                q = free_rotor(q, p, inverse, dt)
            self.orientation[None] = q
            omega = angular_velocity_of(q, p, inverse)
            u = ti.Vector([q[1], q[2], q[3]])
            t = 2.0 * omega.cross(u)
            body = omega + q[0] * t + t.cross(u)
            self.rows[i] = ti.Vector([0.5 * omega.dot(p), body[0], body[1], body[2], q.norm()])

    def watch(self, samples, every, dt):
        """Rows (samples, 5) of energy, body angular velocity (3) and norm of the quaternion."""
        self.run(samples, every, dt)
        return self.rows.to_numpy()[:samples]


@pytest.fixture(scope="module")
def rotor(runtime):
    return Rotor(1000)


def test_a_symmetric_top_precesses_at_the_rate_of_the_closed_form(rotor):
    inertia, angular_velocity = np.array([2.0, 2.0, 3.0]), (0.3, 0.0, 1.5)
    rotor.start(inertia, angular_velocity)
    dt, every = 1e-3, 20
    rows = rotor.watch(1000, every, dt)
    angle = np.unwrap(np.arctan2(rows[:, 2], rows[:, 1]))
    rate = np.polyfit(np.arange(1000) * every * dt, angle, 1)[0]
    expected = angular_velocity[2] * (inertia[2] - inertia[0]) / inertia[0]
    assert rate == pytest.approx(expected, rel=1e-3)
    assert np.hypot(rows[:, 1], rows[:, 2]) == pytest.approx(0.3, rel=1e-6)


def test_a_disturbance_of_the_middle_axis_grows_at_the_rate_of_the_closed_form(rotor):
    i_1, i_2, i_3 = inertia = np.array([1.0, 2.0, 3.5])
    omega = 2.0
    growth = omega * np.sqrt((i_2 - i_1) * (i_3 - i_2) / (i_1 * i_3))
    mode = 1e-7 * np.array([1.0, -np.sqrt(i_1 * (i_2 - i_1) / (i_3 * (i_3 - i_2)))])
    rotor.start(inertia, (mode[0], omega, mode[1]))
    dt, every = 1e-3, 10
    rows = rotor.watch(300, every, dt)
    size = np.hypot(rows[:, 1], rows[:, 3])
    grown = (size > 1e-6) & (size < 1e-3)
    rate = np.polyfit((np.arange(300) * every * dt)[grown], np.log(size[grown]), 1)[0]
    assert grown.sum() > 100
    assert rate == pytest.approx(growth, rel=1e-3)


def test_energy_of_an_asymmetric_top_has_no_trend_over_a_million_steps(rotor):
    rotor.start(np.array([1.0, 2.0, 3.0]), (0.3, 1.0, 0.4))
    energy = rotor.watch(1000, 1000, 0.05)[:, 0]
    slope = np.polyfit(np.arange(1000) / 1000, energy, 1)[0]
    ripple = np.ptp(energy)
    assert ripple < 1e-3 * energy.mean()
    assert abs(slope) < 0.02 * ripple
    assert rotor.rows.to_numpy()[:, 4] == pytest.approx(1.0, abs=1e-12)


def test_the_error_falls_as_the_square_of_the_step(rotor):
    ends = []
    for steps in (100, 200, 400, 6400):
        rotor.start(np.array([1.0, 2.0, 3.0]), (0.5, 1.0, 0.8))
        rotor.watch(1, steps, 4.0 / steps)
        ends.append(rotor.orientation.to_numpy())
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.05)
