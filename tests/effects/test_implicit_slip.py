"""The slip of a step under rate-and-state friction against bisection, over the range of all its parameters."""

import numpy as np
import pytest

from taichi_lsm.core.runtime import ti
from taichi_lsm.effects.implicit_slip import slip_of_step
from tests.helpers import scenes

COUNT = 20_000
NAMES = ("q", "rate", "r", "s", "mu_0", "b")
pytestmark = [
    pytest.mark.usefixtures("runtime"),
    pytest.mark.skipif(scenes.PRECISION == "f32", reason="compares with bisection in double precision"),
]


@ti.data_oriented
class Steps:
    """COUNT steps of contacts, one after the other for both evolutions."""

    def __init__(self):
        for name in (*NAMES, "w", "z", "state"):
            setattr(self, name, ti.field(ti.f64, COUNT))

    @ti.kernel
    def solve_ageing(self):
        for c in range(COUNT):
            self.w[c], self.z[c], self.state[c] = slip_of_step(
                True, self.q[c], self.rate[c], self.r[c], self.s[c], self.mu_0[c], self.b[c]
            )

    @ti.kernel
    def solve_slip(self):
        for c in range(COUNT):
            self.w[c], self.z[c], self.state[c] = slip_of_step(
                False, self.q[c], self.rate[c], self.r[c], self.s[c], self.mu_0[c], self.b[c]
            )

    def __call__(self, evolution, given):
        """(w, z, state) of the given parameters, {name: (COUNT,)}."""
        for name in NAMES:
            getattr(self, name).from_numpy(given[name])
        {"ageing": self.solve_ageing, "slip": self.solve_slip}[evolution]()
        return self.w.to_numpy(), self.z.to_numpy(), self.state.to_numpy()


@pytest.fixture(scope="module")
def steps(runtime):
    return Steps()


def state(evolution, given, w):
    """State after the slip w."""
    x = w * given["r"] / given["rate"]
    if evolution == "ageing":
        return np.logaddexp(given["s"] - x, np.log(-np.expm1(-x) * given["r"] / x))
    y = np.log(w / given["rate"])
    return given["s"] * np.exp(-x) + y * np.expm1(-x)


def residual(evolution, given, w, z):
    """ln V as the friction law has it, less that of w."""
    ln_2_sinh = z + np.log(-np.expm1(-2.0 * z))
    return np.log(w / given["rate"]) + given["mu_0"] + given["b"] * state(evolution, given, w) - ln_2_sinh


def drawn(evolution, softness, seed=0):
    """Parameters of COUNT steps, {name: (COUNT,)}, with B up to `softness`, and their w near the solution.

    Slip takes from 1e-12 of the trial length to all but 1e-6; mu/a up to 1e4, velocities over 16 decades.
    """
    rng = np.random.default_rng(seed)
    q, rate = 10 ** rng.uniform(-3, 4, COUNT), 10 ** rng.uniform(-8, 8, COUNT)
    odds = 10 ** rng.uniform(-12, 6, COUNT)
    w, z = q * odds / (1 + odds), q / (1 + odds)
    b = np.where(rng.random(COUNT) < 0.1, 0.0, 10 ** rng.uniform(-2, 1, COUNT))
    s = rng.uniform(-30, 40, COUNT)
    soft = softness * 10 ** rng.uniform(-8, 0, COUNT) / np.maximum(b, 1e-2)
    if evolution == "slip":
        soft /= 1 + np.abs(s + np.log(w / rate))
    given = {"q": q, "rate": rate, "r": soft * rate, "s": s, "mu_0": np.zeros(COUNT), "b": b}
    given["mu_0"] = np.maximum(-residual(evolution, given, w, z), 0.0)
    return given


def bisected(evolution, given):
    """ln w of the solution."""
    low, high = np.full(COUNT, -690.0), np.log(given["q"])
    for _ in range(70):
        middle = 0.5 * (low + high)
        w = np.exp(middle)
        beyond = residual(evolution, given, w, np.maximum(given["q"] - w, 1e-300)) > 0
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return middle


@pytest.mark.parametrize("evolution", ["ageing", "slip"])
def test_error_bound(steps, evolution):
    """What the module states of stiff contacts, B <= 0.3, for both the velocity and what remains of the spring."""
    given = drawn(evolution, 0.3)
    w, z, after = steps(evolution, given)
    exact = bisected(evolution, given)
    size = given["q"] + given["mu_0"] + given["b"] * np.abs(given["s"]) + np.abs(exact) + np.abs(np.log(given["rate"]))
    error = np.abs(np.log(w) - exact)
    assert np.all(error <= 1e-13 + 4e-16 * size)
    assert np.all(np.abs(w + z - given["q"]) <= 4e-16 * given["q"])
    expected = state(evolution, given, np.exp(exact))
    assert np.abs(after - expected).max() < 1e-10
    # friction too is exact where it is the smaller one: mu/a = asinh(V/(2 V_0) exp(...))
    p = exact - np.log(given["rate"]) + given["mu_0"] + given["b"] * expected
    friction = np.where(p > 30.0, p, np.arcsinh(0.5 * np.exp(np.minimum(p, 30.0))))
    slides = z < w
    assert slides.sum() > COUNT // 10
    assert np.abs(z / friction - 1.0)[slides].max() < 1e-9


@pytest.mark.parametrize("evolution", ["ageing", "slip"])
def test_soft_springs(steps, evolution):
    """B up to 1000: every step slips by a part of its spring, and nearly all of them solve the equation."""
    given = drawn(evolution, 1e3)
    w, z, after = steps(evolution, given)
    assert np.all(np.isfinite(after)) and np.all((w > 0) & (z > 0))
    assert np.all(np.abs(w + z - given["q"]) <= 4e-16 * given["q"])
    left = residual(evolution, given, w, z)
    soft = given["b"] * given["r"] / given["rate"] > 1
    assert soft.sum() > COUNT // 5
    assert (np.abs(left) < 1e-6 * (1.0 + given["q"])).mean() > 0.99
