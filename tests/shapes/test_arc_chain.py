"""The shape record: its closed-form cases, its drawing, and what it refuses."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from shapely import Polygon

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import disc, regular_disc_of_arcs, sphere


def test_disc_and_sphere_have_equivalent_diameter_one():
    assert disc().measure == pytest.approx(np.pi * 0.5**2, rel=1e-15)
    assert disc().inertia == pytest.approx([0.5 * np.pi * 0.5**4], rel=1e-15)
    assert sphere().measure == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=1e-15)
    assert sphere().inertia == pytest.approx([2 / 5 * sphere().measure * 0.5**2] * 3, rel=1e-15)
    for shape, dim in ((disc(), 2), (sphere(), 3)):
        assert (shape.patch_count, shape.centre.shape, shape.seam.shape) == (1, (1, dim), (0, 2))
        assert (shape.bounding_radius, shape.overlap_limit, shape.lever) == (0.5, 0.5, 0.0)


def test_shapes_cannot_be_changed():
    centre = np.zeros((1, 2))
    shape = replace(disc(), centre=centre)
    centre += 1.0  # the record holds its own copy
    assert np.all(shape.centre == 0)
    with pytest.raises(FrozenInstanceError):
        shape.measure = 2.0
    for array in (shape.centre, shape.radius, shape.seam, shape.inertia):
        assert array.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1.0


@pytest.mark.parametrize("shape", [disc(), regular_disc_of_arcs(3), regular_disc_of_arcs(30)])
def test_outline_is_a_closed_counter_clockwise_polygon_on_the_surface(shape):
    outline = shape.outline(points=240)
    assert np.array_equal(outline[0], outline[-1])
    assert np.linalg.norm(outline, axis=1) == pytest.approx(0.5, rel=1e-14)
    polygon = Polygon(outline)
    assert polygon.exterior.is_ccw
    assert len(outline) == 241  # all arcs alike: nothing is rounded up
    assert polygon.area == pytest.approx(0.5 * 240 * 0.25 * np.sin(2 * np.pi / 240), rel=1e-12)


def test_outline_meets_every_seam():
    shape = regular_disc_of_arcs(7)
    outline = shape.outline(points=50)
    assert len(outline) > 50
    distance = np.linalg.norm(outline[:, None] - 0.5 * shape.seam, axis=2).min(axis=0)
    assert distance.max() < 1e-15


def test_scaled_outline_turns_counter_clockwise_then_moves():
    shape = regular_disc_of_arcs(3)
    body, world = shape.outline(30), shape.scaled_outline((2.0, -1.0), np.pi / 2, 4.0, 30)
    assert world == pytest.approx(np.array([2.0, -1.0]) + 4 * np.column_stack([-body[:, 1], body[:, 0]]))


def test_outline_refuses_spheres_and_too_few_points():
    with pytest.raises(InputError, match="dim = 3"):
        sphere().outline()
    with pytest.raises(InputError, match="points = 2"):
        disc().outline(points=2)


ARCS = regular_disc_of_arcs(5)
TWICE = np.array([[np.cos(a), np.sin(a)] for a in 4 * np.pi / 5 * np.arange(5)])
REFUSED = [
    (disc(), {"dim": 1}, "dim = 1"),
    (disc(), {"measure": 0.0}, "measure = 0"),
    (disc(), {"measure": np.nan}, "measure = nan"),
    (disc(), {"lever": -1.0}, "lever = -1"),
    (disc(), {"lever": 0.6}, "lever = 0.6"),
    (disc(), {"overlap_limit": 0.6}, "overlap_limit = 0.6"),
    (disc(), {"radius": [-0.5]}, "radius"),
    (disc(), {"radius": []}, "radius"),
    (disc(), {"radius": [np.inf]}, "radius"),
    (disc(), {"centre": [[0.0, 0.0, 0.0]]}, "centre has shape"),
    (disc(), {"centre": [[1e-6, 0.0]]}, "centre of mass"),
    (disc(), {"inertia": [1.0, 1.0, 1.0]}, "inertia"),
    (disc(), {"seam": [[1.0, 0.0]]}, "seam has shape"),
    (sphere(), {"radius": [0.5, 0.5], "centre": np.zeros((2, 3))}, "2 patches"),
    (sphere(), {"inertia": [1.0]}, "inertia"),
    (ARCS, {"seam": ARCS.seam * 1.001}, "unit vectors"),
    (ARCS, {"seam": ARCS.seam[::-1]}, "turn by more than 0"),
    (ARCS, {"seam": TWICE}, "cover 2 pi once"),
    (ARCS, {"centre": ARCS.centre + np.eye(5, 2) * 1e-8}, "jumps by"),
    (ARCS, {"radius": ARCS.radius + np.eye(1, 5)[0] * 1e-8}, "jumps by"),
]


@pytest.mark.parametrize(("shape", "change", "message"), REFUSED)
def test_refuses_what_is_not_a_shape(shape, change, message):
    with pytest.raises(InputError, match=message):
        replace(shape, **change)
