"""Exponentials, logarithms and cube roots for vector code against NumPy's of higher precision."""

import numpy as np
import pytest

from taichi_lsm.core.elementary import cube_root, exp, log, polynomial
from taichi_lsm.core.runtime import ti
from tests.helpers import scenes
from tests.helpers.scenes import tolerance

COUNT = 100_000
SERIES = (1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0)
REAL = np.float64 if scenes.PRECISION == "f64" else np.float32
EPSILON = np.finfo(REAL).eps


@ti.data_oriented
class Functions:
    """The functions at COUNT places."""

    def __init__(self):
        for name in ("x", "y", "rough", "root", "sum"):
            setattr(self, name, ti.field(ti.f64, COUNT))

    @ti.kernel
    def exponentials(self):
        for i in range(COUNT):
            self.y[i], self.rough[i] = exp(self.x[i]), exp(self.x[i], True)
            self.sum[i] = polynomial(self.x[i], SERIES)

    @ti.kernel
    def logarithms(self):
        for i in range(COUNT):
            self.y[i], self.rough[i] = log(self.x[i]), log(self.x[i], True)
            self.root[i] = cube_root(self.x[i])

    def __call__(self, kernel, x):
        self.x.from_numpy(x.astype(float))
        getattr(self, kernel)()
        return self.y.to_numpy(), self.rough.to_numpy()


@pytest.fixture(scope="module")
def functions(runtime):
    return Functions()


def relative(y, exact):
    """Largest relative error."""
    return float(np.max(np.abs(y - exact) / np.abs(exact)))


def test_exponential(functions):
    low, high = tolerance(-708.0, -87.0), tolerance(709.0, 88.0)
    x = np.concatenate([np.linspace(low, high, COUNT // 2), np.linspace(-1.0, 1.0, COUNT // 2)]).astype(REAL)
    y, rough = functions("exponentials", x)
    exact = np.exp(x.astype(np.longdouble))
    assert relative(y, exact) < 2.0 * EPSILON
    assert relative(rough, exact) < 4e-6 + 2.0 * EPSILON
    x = np.linspace(10.0 * low, low, COUNT).astype(REAL)  # below the range: that of its end
    assert relative(functions("exponentials", x)[0], np.exp(np.longdouble(low))) < 2.0 * EPSILON


def test_logarithm(functions):
    x = np.concatenate(
        [np.logspace(tolerance(-307, -37), tolerance(308, 38), COUNT // 2), np.linspace(0.5, 2.0, COUNT // 2)]
    ).astype(REAL)
    x = x[np.where(x == 1.0, 0, np.arange(COUNT))]
    y, rough = functions("logarithms", x)
    exact = np.log(x.astype(np.longdouble))
    assert relative(y, exact) < 2.0 * EPSILON
    assert relative(rough, exact) < 4e-6 + 4.0 * EPSILON
    y, _ = functions("logarithms", np.array([0.0, 1.0] * (COUNT // 2)))
    assert np.all(y[1::2] == 0.0) and np.all((y[::2] < tolerance(-708.0, -87.0)) & np.isfinite(y[::2]))


def test_cube_root(functions):
    x = np.concatenate(
        [np.logspace(tolerance(-290, -30), tolerance(308, 38), COUNT // 2), np.linspace(0.1, 10, COUNT // 2)]
    )
    x = x.astype(REAL)
    functions("logarithms", x)
    assert relative(functions.root.to_numpy(), np.cbrt(x.astype(np.longdouble))) < 4.0 * EPSILON
    functions("logarithms", np.zeros(COUNT))
    assert np.all((functions.root.to_numpy() >= 0.0) & (functions.root.to_numpy() < tolerance(1e-96, 1.1e-10)))


def test_polynomial(functions):
    x = np.linspace(-2.0, 2.0, COUNT)
    functions("exponentials", x)
    error = functions.sum.to_numpy() - np.polynomial.Polynomial(SERIES)(x)
    assert np.abs(error).max() < 1e4 * EPSILON
