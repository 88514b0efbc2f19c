"""Irregular polyhedra meet their corner radius, elongation and angularity."""

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import random_angular_polyhedra, random_polyhedra
from taichi_lsm.shapes.polyhedra import FLATNESS


def test_random_angular_polyhedra_are_the_same_whatever_the_count():
    three, two = random_angular_polyhedra(3, 7), random_angular_polyhedra(2, 7)
    for a, b in zip(three, two):
        assert np.array_equal(a.feature_centre, b.feature_centre)
    for shape in three:
        assert shape.dilation == pytest.approx(0.05, abs=1e-9)
        assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)
        assert 10 <= shape.face_count <= 18
    with pytest.raises(InputError, match="corner_radius"):
        random_angular_polyhedra(1, 7, corner_radius=0.6)


@pytest.mark.parametrize(
    ("make", "inertia", "bounding_radius", "lever"),
    [
        (
            lambda: random_angular_polyhedra(1, 1),
            [0.0475320125291, 0.0562349334268, 0.0626164830011],
            0.640558929640,
            0.486559455771,
        ),
        (
            lambda: random_polyhedra(1, 3),
            [0.0521983353672, 0.0527544160953, 0.0533155651589],
            0.566933923635,
            0.285317038559,
        ),
    ],
    ids=["angular", "random"],
)
def test_seeds_keep_their_shapes(make, inertia, bounding_radius, lever):
    (shape,) = make()  # values of the first version of the makers
    assert shape.inertia == pytest.approx(inertia, rel=1e-11)
    assert (shape.bounding_radius, shape.lever) == pytest.approx((bounding_radius, lever), rel=1e-11)


def aspect(shape):
    """Longest over shortest axis of the ellipsoid of equal moments."""
    second = shape.inertia.sum() / 2 - shape.inertia
    return np.sqrt(second.max() / second.min())


@pytest.mark.parametrize("elongation", [1.0, 3.0])
@pytest.mark.parametrize("angularity", [0.0, 1.0])
def test_random_polyhedra_are_as_long_as_asked(elongation, angularity):
    for shape in random_polyhedra(2, 4, 0.07, (12, 14), elongation, angularity):
        assert aspect(shape) == pytest.approx(elongation, rel=0.1)
        assert shape.dilation == pytest.approx(0.07, abs=1e-9)
        assert 12 <= shape.face_count <= 14
        assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)


def test_angularity_moves_the_curvature_of_faces_into_edges():
    n = np.random.default_rng(0).normal(size=(20_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    shares = []
    for angularity in (0.0, 0.5, 1.0):
        shape = random_polyhedra(1, 4, angularity=angularity)[0]
        shares.append(np.mean(shape.feature_of(n) < shape.face_count))
        largest = shape.feature_radius.max()
    assert shares[0] > 1.5 * shares[1] > 4 * shares[2]  # the share of all normals that belongs to faces
    assert largest > 0.8 * FLATNESS  # in equivalent diameters, which are nearly sizes here


@pytest.mark.parametrize("make", [random_polyhedra, random_angular_polyhedra])
def test_faces_are_as_flat_as_asked(make):
    """In sizes of the body, which are a little more than its equivalent diameters; edges and vertices stay."""
    (flat,), (usual,) = make(1, 4, flatness=100.0), make(1, 4)
    assert flat.feature_radius.max() / usual.feature_radius.max() == pytest.approx(100.0 / FLATNESS, rel=0.1)
    assert flat.dilation == pytest.approx(0.05, abs=1e-9)
    for wrong in (0.0, 3e4):  # at 3e4 grains were up to a per cent off, at 1e5 six
        with pytest.raises(InputError, match=r"flatness = .*, at most 10000"):
            make(1, 4, flatness=wrong)


def test_random_polyhedra_of_a_seed_do_not_depend_on_the_count():
    one, two = random_polyhedra(1, 5, faces=(8, 8)), random_polyhedra(2, 5, faces=(8, 8))
    assert np.array_equal(one[0].feature_centre, two[0].feature_centre) and one[0].name == two[0].name
    assert not np.array_equal(two[0].inertia, two[1].inertia)
    assert not np.array_equal(one[0].inertia, random_polyhedra(1, 6, faces=(8, 8))[0].inertia)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("count", -1),
        ("faces", (5, 9)),
        ("faces", (9, 8)),
        ("elongation", 0.9),
        ("elongation", np.nan),
        ("angularity", 1.1),
        ("corner_radius", 0.0),
        ("corner_radius", np.nan),
    ],
)
def test_random_polyhedra_refuse_what_is_out_of_range(field, value):
    with pytest.raises(InputError, match=f"{field} = "):
        random_polyhedra(**{"count": 1, "seed": 1, field: value})
