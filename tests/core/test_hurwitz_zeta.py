"""The Hurwitz zeta function against its defining relations and values of Riemann's zeta function."""

import numpy as np
import pytest

from taichi_lsm.core.hurwitz_zeta import hurwitz_zeta

A = np.linspace(0.0, 1.0, 101)


@pytest.mark.parametrize("p", [0.5, 1.5, 2.5])
def test_relations(p):
    """zeta(-p, a) - zeta(-p, a + 1) = a^p; its mean over a is zero, and zeta(-p, 1/2) = (2^-p - 1) zeta(-p)."""
    assert hurwitz_zeta(p, A) - hurwitz_zeta(p, A + 1.0) == pytest.approx(A**p, abs=1e-7)
    node, weight = np.polynomial.legendre.leggauss(200)
    assert weight @ hurwitz_zeta(p, 0.5 * (node + 1.0)) == pytest.approx(0.0, abs=1e-7)
    assert hurwitz_zeta(p, 0.5) == pytest.approx((2.0**-p - 1.0) * hurwitz_zeta(p, 1.0), abs=1e-7)


def test_known_values():
    """Bernoulli's polynomials for whole numbers, Riemann's zeta function (DLMF 25.6) for halves at a = 1."""
    assert hurwitz_zeta(1.0, A) == pytest.approx(-0.5 * (A**2 - A + 1.0 / 6.0), abs=1e-13)
    assert hurwitz_zeta(2.0, A) == pytest.approx(-(A**3 - 1.5 * A**2 + 0.5 * A) / 3.0, abs=1e-12)
    assert hurwitz_zeta(1.5, 1.0) == pytest.approx(-0.02548520188983303, abs=1e-8)
    assert hurwitz_zeta(2.5, 1.0) == pytest.approx(0.008516928777849, abs=1e-8)


def test_it_is_the_error_of_the_trapezoidal_rule_for_a_force_that_begins_inside_a_step():
    """Sum of c t^1.5 at the steps after it began a fraction a before the first, times dt, less its integral: c dt^2.5
    zeta(-3/2, a) and what the end of the integral leaves."""
    dt, steps = 0.01, 400
    for a in (0.1, 0.5, 0.9):
        t = (a + np.arange(steps)) * dt
        error = dt * (np.sum(t**1.5) - 0.5 * t[-1] ** 1.5) - t[-1] ** 2.5 / 2.5
        end = dt**2 / 12.0 * 1.5 * t[-1] ** 0.5
        assert error - end == pytest.approx(dt**2.5 * hurwitz_zeta(1.5, a), abs=1e-4 * dt**2.5)
