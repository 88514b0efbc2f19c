"""Random polygons meet their corner radius, elongation and angularity."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes.ellipses import unit_normals
from taichi_lsm.shapes.random_polygons import FLATTEST, tangent_arcs

EVEN = unit_normals(np.linspace(0.0, np.pi, 361))


def aspect(shape):
    """Longest over shortest distance of two parallel tangents."""
    width = shape.support(EVEN) + shape.support(-EVEN)
    return width.max() / width.min()


def cornered(shape):
    """Share of the turning of the outline in its corners."""
    return shape._spans()[1][shape.radius < 1.001 * shape.overlap_limit].sum() / (2.0 * np.pi)


@pytest.mark.parametrize("elongation", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("angularity", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("corner_radius", [0.02, 0.1])
def test_what_is_asked_for_is_met(elongation, angularity, corner_radius):
    for shape in lsm.shapes.random_polygons(4, 3, corner_radius, (6, 10), elongation, angularity):
        assert shape.overlap_limit == pytest.approx(corner_radius, abs=2e-10)
        assert shape.measure == pytest.approx(np.pi / 4, rel=1e-12)
        assert aspect(shape) == pytest.approx(elongation, rel=0.2)
        assert shape.patch_count in range(12, 21, 2)


def test_corners_take_over_with_angularity():
    share = [np.mean([cornered(s) for s in lsm.shapes.random_polygons(8, 1, angularity=a)]) for a in (0.0, 0.5, 1.0)]
    assert share[0] < 0.25 < share[1] < 0.75 < share[2]


def test_sides_are_as_flat_as_asked():
    """In sizes of the ellipse, to which the equivalent disc is nearly in the same ratio; the corners stay."""
    for flat, usual in zip(lsm.shapes.random_polygons(3, 2, flatness=100.0), lsm.shapes.random_polygons(3, 2)):
        assert flat.radius.max() / usual.radius.max() == pytest.approx(100.0 / FLATTEST, rel=0.03)
        assert usual.radius.max() == pytest.approx(FLATTEST, rel=0.1)
        assert flat.overlap_limit == pytest.approx(0.05, abs=2e-10)


def test_a_square_of_arcs_is_that_of_its_discs():
    """Four discs of radius 3 that touch (1, 0) and so on: the corner is where two of them meet, rounded by 0.1."""
    axes = unit_normals(0.5 * np.pi * np.arange(4))
    shape = tangent_arcs(axes, axes, np.full(4, 3.0), 0.1, "square")
    corner = (-2.0 + np.sqrt(2.9**2 * 2 - 4.0)) / 2.0 * np.sqrt(2.0)  # of x = y, (x + 2)^2 + y^2 = 2.9^2, from 0
    ratio = shape.support(unit_normals([0.25 * np.pi])) / shape.support(unit_normals([0.0]))
    assert ratio == pytest.approx((corner + 0.1) / 1.0, rel=1e-12)


def test_shapes_of_a_seed_do_not_depend_on_the_count():
    one, three = lsm.shapes.random_polygons(1, 5), lsm.shapes.random_polygons(3, 5)
    assert np.array_equal(one[0].seam, three[0].seam)
    assert not np.array_equal(one[0].radius, lsm.shapes.random_polygons(1, 6)[0].radius)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("count", -1),
        ("corner_radius", 0.0),
        ("corner_radius", 0.5),
        ("sides", (3, 5)),
        ("sides", (7, 5)),
        ("elongation", 0.9),
        ("elongation", 4.1),
        ("angularity", -0.1),
        ("angularity", 1.1),
        ("flatness", 0.0),
    ],
)
def test_what_is_out_of_range_is_refused(field, value):
    with pytest.raises(InputError, match=field):
        lsm.shapes.random_polygons(**{"count": 1, "seed": 1, field: value})


def test_no_grain_is_an_error():
    with pytest.raises(InputError, match="no grain in 20 draws"):
        lsm.shapes.random_polygons(1, 1, corner_radius=0.45, elongation=4.0)
