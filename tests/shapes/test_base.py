"""What all shapes have in common: how they print, how they scale, and what they refuse."""

import re
from dataclasses import replace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import angular_aggregate, place_part


@pytest.fixture(scope="module")
def angular():
    return lsm.shapes.random_angular_shapes(1, 3)[0]


def test_a_shape_prints_on_one_line_what_its_surface_consists_of(angular):
    grains = {
        lsm.sphere(): "ArcChain('sphere', overlap limit 0.5, bounding radius 0.5)",
        lsm.shapes.regular_disc_of_arcs(
            9
        ): "ArcChain('disc of 9 arcs', 9 arcs, overlap limit 0.5, bounding radius 0.5)",
        angular: f"ArcChain('angular 3-0', {angular.patch_count} arcs, overlap limit 0.05, bounding radius 0.",
        lsm.shapes.regular_polyhedron(
            6
        ): "BallPolyhedron('regular polyhedron of 6 faces', 6 faces, 12 edges, 8 vertices, "
        "overlap limit 0.05, bounding radius 0.",
        lsm.shapes.clump([(0, 0), (1, 0)], [1.0, 1.0]): "PatchGrain('clump', 2 patches, overlap limit 0.3",
        lsm.shapes.clump([(0, 0)], [1.0]): "PatchGrain('clump', 1 patch, overlap limit 0.5, bounding radius 0.5)",
        lsm.shapes.crossed_bars(): "Union('cross 3', 2 parts, 16 patches, overlap limit 0.0511, bounding radius 0.",
        angular_aggregate(5, 2, 0.05): "Aggregate(5 pieces, ",
    }
    for grain, start in grains.items():
        assert repr(grain).startswith(start)
        assert repr(grain).endswith(")") and len(repr(grain)) < 140 and "\n" not in repr(grain)


def test_equal_fields_do_not_make_shapes_equal():
    assert lsm.disc() != lsm.disc() and len({lsm.disc(), lsm.disc()}) == 2


def test_rescaling_multiplies_lengths_and_keeps_the_form(angular):
    cones = lsm.shapes.from_chain(angular)
    for shape in (angular, cones):
        large = lsm.shapes.rescaled(shape, 3.0)
        assert type(large) is type(shape)
        assert large.measure == pytest.approx(9 * shape.measure) and large.inertia == pytest.approx(81 * shape.inertia)
        for field in ("centre", "radius", "bounding_radius", "overlap_limit", "lever"):
            assert getattr(large, field) == pytest.approx(3 * getattr(shape, field)), field
    solid = lsm.shapes.regular_polyhedron(4)
    assert lsm.shapes.from_planes(np.vstack([np.eye(3), -np.eye(3)]), np.ones(6), 0.1).measure == pytest.approx(
        np.pi / 6
    )
    assert solid.rescaled(2.0).inertia == pytest.approx(32 * solid.inertia)
    assert solid.rescaled(2.0).normalised().measure == pytest.approx(np.pi / 6)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.inf, np.nan])
def test_a_factor_that_is_no_length_is_refused(angular, factor):
    message = re.escape(f"factor = {factor}: must be finite and > 0")
    with pytest.raises(InputError, match=message):
        lsm.shapes.rescaled(angular, factor)
    with pytest.raises(InputError, match=message):
        lsm.shapes.regular_polyhedron(4).rescaled(factor)
    with pytest.raises(InputError, match=message):
        place_part(angular, (0.0, 0.0), 0.0, factor)


def test_only_chains_and_patches_are_rescaled_by_the_function():
    with pytest.raises(InputError, match="must be an ArcChain or a PatchGrain"):
        lsm.shapes.rescaled(lsm.shapes.regular_polyhedron(4), 2.0)


@pytest.mark.parametrize("value", ["a disc", [[0.0, 0.0], [1.0]], None])
def test_what_is_no_array_of_numbers_is_refused_by_name(value):
    with pytest.raises(InputError, match="centre"):
        replace(lsm.disc(), centre=value)
    with pytest.raises(InputError, match="vertices"):
        lsm.shapes.from_polygon(value, 0.1)
    with pytest.raises(InputError, match="radii"):
        lsm.shapes.arc_chain([0.0, 2.0, 4.0], value)


def test_half_width_is_that_of_the_thinnest_part():
    box = lsm.shapes.from_polygon([(0, 0), (6, 0), (6, 1), (0, 1)], 0.1, normalise=False)
    plate = 0.5 * np.array([20.0, 10.0, 1.0])
    flake = lsm.shapes.from_planes(np.vstack([np.eye(3), -np.eye(3)]), np.tile(plate, 2), 0.2, normalise=False)
    triangle = lsm.shapes.from_polygon([(0, 0), (2, 0), (1, 3**0.5)], 0.01, 1e-3, normalise=False)
    cross = lsm.shapes.union([lsm.shapes.place_part(box, (0.0, 0.0), angle) for angle in (0.0, 1.0)])
    for shape, half in ((box, 0.5), (flake, 0.5), (triangle, 0.5 * 3**0.5), (lsm.sphere(), 0.5), (lsm.disc(), 0.5)):
        assert shape.half_width == pytest.approx(half, rel=0.02), shape
    assert lsm.shapes.from_chain(box).half_width == pytest.approx(0.5, rel=0.02)
    assert cross.half_width == pytest.approx(cross.parts[0].half_width)
    assert cross.half_width < 0.3 * cross.bounding_radius


def test_a_rounded_square_is_spanned_by_balls_at_its_corners():
    square = lsm.shapes.from_polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], 0.1)
    centre, radius = square.spanning_balls()
    assert radius == pytest.approx(square.overlap_limit)
    for angle in np.linspace(0.0, 2 * np.pi, 37):
        n = np.array([np.cos(angle), np.sin(angle)])
        assert (centre @ n + radius).max() == pytest.approx(float(square.support([n])[0]), abs=1e-3)


@pytest.mark.parametrize(
    ("shape", "below"),
    [
        (lsm.sphere(), 1e-15),
        (lsm.shapes.ball_polyhedron([(0, 0, 0)], [0.4], 0.1), 1e-12),
        (lsm.shapes.regular_polyhedron(6), 0.57**2 / 40),  # sagitta c^2/(8 R): half a diagonal of a face, R = 5
        (lsm.shapes.random_angular_shapes(1, 3)[0], 0.004),
    ],
    ids=["sphere", "ball", "cube", "polygon"],
)
def test_the_hull_of_the_spanning_balls_lies_inside_the_grain_and_near_its_surface(shape, below):
    n = np.random.default_rng(0).standard_normal((2000, shape.dim))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    centre, radius = shape.spanning_balls()
    short = shape.support(n) - (n @ centre.T + radius).max(axis=1)
    assert short.min() > -1e-9 and short.max() < below


def test_the_balls_of_a_breakable_grain_span_all_its_pieces():
    grain = angular_aggregate(5, 2, 0.05)
    centre, radius = grain.spanning_balls()
    assert len(centre) == len(radius) == sum(len(piece.spanning_balls()[1]) for piece in grain.shapes)
    n = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0.0, 2 * np.pi, 50)])
    pieces = [p @ n.T + d * s.support(n) for p, d, s in zip(grain.position, grain.diameter, grain.shapes)]
    assert (n @ centre.T + radius).max(axis=1) == pytest.approx(np.max(pieces, axis=0), abs=0.004)
    assert (np.linalg.norm(centre, axis=1) + radius).max() == pytest.approx(grain.reach, abs=0.004)
