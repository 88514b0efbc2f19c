"""Rotations of the core against NumPy, in 2D and 3D, a thousand at a time."""

import numpy as np
import pytest

from taichi_lsm.core.fields import orientation_size, rotation_size
from taichi_lsm.core.rotation import advanced_orientation, rotate, rotational_velocity, torque_of, unrotate
from taichi_lsm.core.runtime import ti

COUNT = 1000


@ti.data_oriented
class Rotor:
    """The functions of `rotation` applied to COUNT cases in one launch."""

    def __init__(self, dim):
        self.dim = dim
        self.orientation = ti.Vector.field(orientation_size(dim), ti.f64, COUNT)
        self.omega = ti.Vector.field(rotation_size(dim), ti.f64, COUNT)
        self.torque = ti.Vector.field(rotation_size(dim), ti.f64, COUNT)
        self.a, self.world, self.back, self.speed = (ti.Vector.field(dim, ti.f64, COUNT) for _ in range(4))

    @ti.kernel
    def apply(self):
        for c in range(COUNT):
            self.world[c] = rotate(self.orientation[c], self.a[c])
            self.back[c] = unrotate(self.orientation[c], self.world[c])
            self.speed[c] = rotational_velocity(self.omega[c], self.a[c])
            self.torque[c] = torque_of(self.a[c], self.speed[c])

    @ti.kernel
    def advance(self, steps: int, dt: ti.f64):
        for c in range(COUNT):
            for _ in range(steps):
                self.orientation[c] = advanced_orientation(self.orientation[c], self.omega[c], dt)


@pytest.fixture(scope="module", params=[2, 3])
def rotor(request, runtime):
    return Rotor(request.param)


def load(rotor, rng, angular_velocity):
    """Random (orientations, vectors a, angular velocities omega of size `angular_velocity`), put into the fields."""
    orientation = rng.standard_normal((COUNT, orientation_size(rotor.dim)))
    orientation /= np.linalg.norm(orientation, axis=1)[:, None]
    omega = rng.standard_normal((COUNT, rotation_size(rotor.dim)))
    omega *= np.broadcast_to(angular_velocity, COUNT)[:, None] / np.linalg.norm(omega, axis=1)[:, None]
    a = rng.standard_normal((COUNT, rotor.dim))
    for field, values in ((rotor.orientation, orientation), (rotor.omega, omega), (rotor.a, a)):
        field.from_numpy(values)
    return orientation, a, omega


def matrices(orientation):
    """Rotation matrices of unit complex numbers or unit quaternions (w, x, y, z)."""
    if orientation.shape[1] == 2:
        c, s = orientation.T
        return np.stack([[c, -s], [s, c]]).transpose(2, 0, 1)
    w, v = orientation[:, 0, None, None], orientation[:, 1:]
    cross = np.zeros((len(v), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = v
    cross[:, [1, 2, 0], [2, 0, 1]] = -v
    return (2 * w**2 - 1) * np.eye(3) + 2 * v[:, :, None] * v[:, None, :] + 2 * w * cross


def test_rotate_is_the_matrix_and_unrotate_its_inverse(rotor):
    orientation, a, _ = load(rotor, np.random.default_rng(0), 1.0)
    rotor.apply()
    assert rotor.world.to_numpy() == pytest.approx(np.einsum("cij,cj->ci", matrices(orientation), a), abs=1e-14)
    assert rotor.back.to_numpy() == pytest.approx(a, abs=1e-14)


def test_rotational_velocity_and_torque_are_cross_products(rotor):
    _, a, omega = load(rotor, np.random.default_rng(1), 3.0)
    rotor.apply()
    pad = [(0, 0), (0, 3 - rotor.dim)]
    arm, axis = np.pad(a, pad), omega if rotor.dim == 3 else np.pad(omega, [(0, 0), (2, 0)])
    speed = np.cross(axis, arm)
    torque = np.cross(arm, speed)
    assert rotor.speed.to_numpy() == pytest.approx(speed[:, : rotor.dim], abs=1e-14)
    assert rotor.torque.to_numpy() == pytest.approx(torque if rotor.dim == 3 else torque[:, 2:], abs=1e-13)


def test_advanced_orientation_keeps_the_norm_over_a_hundred_thousand_steps(rotor):
    load(rotor, np.random.default_rng(2), np.linspace(0.0, 50.0, COUNT))
    rotor.advance(100_000, 0.01)
    assert np.abs(np.linalg.norm(rotor.orientation.to_numpy(), axis=1) - 1).max() < 1e-12


def test_one_step_turns_by_the_exact_angle_about_the_axis(rotor):
    """abs(omega dt) up to 0.5: the angle to 1e-8 of itself, the axis to rounding."""
    angle = np.linspace(0.0, 0.5, COUNT)
    orientation, _, omega = load(rotor, np.random.default_rng(3), angle / 0.01)
    rotor.advance(1, 0.01)
    step = np.einsum("cij,ckj->cik", matrices(rotor.orientation.to_numpy()), matrices(orientation))
    if rotor.dim == 2:
        found = np.arctan2(step[:, 1, 0], step[:, 0, 0])
        assert found == pytest.approx(omega[:, 0] * 0.01, rel=1e-8, abs=1e-15)
    else:
        vector = 0.5 * (step[:, [2, 0, 1], [1, 2, 0]] - step[:, [1, 2, 0], [2, 0, 1]])  # axis times sin(angle)
        expected = omega / np.maximum(np.linalg.norm(omega, axis=1), 1e-300)[:, None]
        assert vector == pytest.approx(expected * np.sin(angle)[:, None], rel=1e-8, abs=1e-15)


def test_many_small_turns_add_up(rotor):
    orientation, _, omega = load(rotor, np.random.default_rng(4), 2.0)
    rotor.advance(1000, 1e-3)  # 2 rad about a fixed axis
    step = np.einsum("cij,ckj->cik", matrices(rotor.orientation.to_numpy()), matrices(orientation))
    trace = 2 * np.cos(2.0) if rotor.dim == 2 else 1 + 2 * np.cos(2.0)
    assert np.einsum("cii->c", step) == pytest.approx(np.full(COUNT, trace), abs=1e-11)
