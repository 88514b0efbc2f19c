"""Grains from outlines and images."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError


def test_the_outline_of_an_image_becomes_a_grain():
    y, x = np.mgrid[-30:31, -30:31]
    shape, misfit, _ = lsm.shapes.from_outline(lsm.shapes.outline_of_image(np.hypot(x / 1.5, y), 15.0))
    assert misfit.greatest_distance < 0.01 and shape.measure == pytest.approx(np.pi / 4)


def test_an_outline_that_is_not_convex_is_refused():
    with pytest.raises(InputError, match="not convex"):
        lsm.shapes.from_outline([(0, 0), (2, 0), (2, 2), (1, 0.3), (0, 2)])


def test_the_misfit_of_a_chain_from_its_own_outline_is_small():
    shape = lsm.shapes.regular_polygon(5, 0.1)
    again, misfit, _ = lsm.shapes.from_outline(7.0 * shape.outline(400) + 3.0, 0.1)
    assert again.inertia == pytest.approx(shape.inertia, rel=1e-3)
    assert -0.01 < misfit.area < 0.0  # the grain lies inside the outline
    assert misfit.rms_distance <= misfit.greatest_distance < 0.01


def test_wrong_outlines_and_images_are_refused():
    with pytest.raises(InputError, match="points has shape"):
        lsm.shapes.from_outline([(0, 0), (1, 0)])
    with pytest.raises(InputError, match="no simple outline"):
        lsm.shapes.from_outline([(0, 0), (1, 1), (1, 0), (0, 1)])
    with pytest.raises(InputError, match="image has shape"):
        lsm.shapes.outline_of_image(np.zeros((2, 9)), 0.5)
    with pytest.raises(InputError, match=r"level = 5.0: no closed contour; values range from 0.0 to 0.0"):
        lsm.shapes.outline_of_image(np.zeros((9, 9)), 5.0)
