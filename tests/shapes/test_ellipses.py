"""Ellipses and superellipses as chains of arcs."""

import math

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError


def test_the_error_of_ellipses_falls_faster_than_the_square_of_the_arcs():
    t = np.linspace(0, 2 * np.pi, 997)
    n = np.stack([np.cos(t), np.sin(t)], axis=1)
    b = 0.5 / np.sqrt(2.0)
    exact = np.hypot(2 * b * n[:, 0], b * n[:, 1])
    errors = [np.abs(lsm.shapes.ellipse(2.0, arcs).support(n) - exact).max() for arcs in (12, 24, 48)]
    assert errors[0] > 3 * errors[1] > 9 * errors[2]


def test_a_superellipse_touches_its_box_on_both_axes():
    """At 0 and 90 degrees h = a and b, whose product follows from the area pi/4; no radius exceeds 10 diameters."""
    shape = lsm.shapes.superellipse(2.0, 4.0, 60)
    a, b = shape.support(np.eye(2))
    area_over_ab = 4 * math.gamma(1.25) ** 2 / math.gamma(1.5)
    assert a / b == pytest.approx(2.0, rel=5e-3)
    assert a * b == pytest.approx(np.pi / 4 / area_over_ab, rel=5e-3)


@pytest.mark.parametrize(
    ("field", "value"), [("aspect", 0.9), ("aspect", 21.0), ("exponent", 1.1), ("arcs", 7), ("corner_radius", 0.5)]
)
def test_what_is_out_of_range_is_refused(field, value):
    with pytest.raises(InputError, match=f"{field} = {value}"):
        lsm.shapes.superellipse(**{"aspect": 1.5, "exponent": 3.0, "arcs": 30, field: value})
