"""Points of a sweep: grids, columns that go together, samples of ranges, and their combinations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taichi_lsm.core.errors import InputError
from workflows.sweep.factors import METHODS, Range, points_of, unit_sample


def test_a_grid_is_every_combination_and_the_last_varies_fastest():
    points = points_of({"grid": {"shape": ["round", "angular"], "friction": [0.1, 0.5]}})
    assert points == [
        {"shape": "round", "friction": 0.1},
        {"shape": "round", "friction": 0.5},
        {"shape": "angular", "friction": 0.1},
        {"shape": "angular", "friction": 0.5},
    ]


def test_columns_go_together_and_are_combined_with_the_grid():
    table = {"together": {"length": [10, 20], "width": [5, 8]}, "grid": {"seed": [1, 2]}}
    assert points_of(table) == [
        {"seed": seed, "length": length, "width": width} for seed in (1, 2) for length, width in ((10, 5), (20, 8))
    ]


def test_ranges_are_spaced_evenly_or_by_a_factor_and_whole_where_the_parameter_is():
    spans = {
        "friction": {"from": 0.0, "to": 1.0, "count": 5},
        "inertial_number": {"from": 1e-4, "to": 1e-2, "count": 3, "spacing": "log"},
        "grains": {"from": 100, "to": 200, "count": 4},
    }
    found = {
        name: [p[name] for p in points_of({"grid": {name: span}}, frozenset({"grains"}))]
        for name, span in spans.items()
    }
    assert found["friction"] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert found["inertial_number"] == pytest.approx([1e-4, 1e-3, 1e-2], rel=1e-11)
    assert found["grains"] == [100, 133, 167, 200] and all(type(n) is int for n in found["grains"])


@pytest.mark.parametrize("method", METHODS)
def test_a_sample_has_one_point_in_each_layer_of_every_axis(method):
    """That is what a Latin hypercube is; a balanced sequence of 2^n points has it too."""
    points = unit_sample(method, 32, 3, 7)
    assert np.array_equal(np.sort(np.floor(32 * points).astype(int), axis=0), np.arange(32)[:, None] * [1, 1, 1])
    assert np.array_equal(points, unit_sample(method, 32, 3, 7))
    assert not np.array_equal(points, unit_sample(method, 32, 3, 8))


@given(st.floats(1e-9, 1e9), st.floats(1.001, 1e6), st.floats(0, 1), st.booleans())
def test_a_range_stays_within_its_ends(low, factor, share, log):
    span = Range(low, low * factor, log)
    assert low * (1 - 1e-9) <= span.at(share) <= low * factor * (1 + 1e-9)
    assert span.at(0.0) == pytest.approx(low) and span.at(1.0) == pytest.approx(low * factor)


def test_nothing_that_varies_is_one_point():
    assert points_of({}) == [{}]


RANGES = {"friction": {"from": 0.1, "to": 0.9}}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"grid": [1]}, r"^sweep.grid = \[1\]: must be a table"),
        ({"grid": {"friction": 0.5}}, r"^sweep.grid.friction = 0.5: must be a list"),
        ({"grid": {"friction": []}}, r"^sweep.grid.friction = \[\]: must be a list"),
        ({"grid": {"friction": [0.5, 0.5]}}, r"^sweep.grid.friction: 0.5 is there twice.*replicas"),
        ({"grid": {"friction": {"from": 0.1, "to": 0.5}}}, r"friction.count = None: must be a whole number from 2"),
        ({"grid": {"friction": {"from": 0.1, "to": 0.1, "count": 2}}}, r"friction.to = 0.1: must be > from = 0.1"),
        ({"grid": {"friction": {"from": 0, "to": 1, "count": 2, "spacing": "log"}}}, r"from = 0: must be > 0 with"),
        ({"grid": {"friction": {"from": 0, "to": 1, "count": 2, "step": 1}}}, r"friction.step: unknown, must be one"),
        ({"grid": {"friction": {"from": "a", "to": 1, "count": 2}}}, r"friction.from = 'a': must be a number"),
        ({"grid": {n: {"from": 0, "to": 1, "count": 999} for n in "ab"}}, r"^sweep: 998001 points, must be at most"),
        ({"together": {"length": [1, 2], "width": [1]}}, r"different lengths \(length 2, width 1\)"),
        ({"sample": {"ranges": RANGES}}, r"^sweep.sample.count = None: must be"),
        ({"sample": {"count": 4}}, r"^sweep.sample.ranges: must be given"),
        ({"sample": {"count": 4, "ranges": RANGES, "method": "random"}}, r"method = 'random': must be one of latin"),
        (
            {"sample": {"count": 5, "ranges": RANGES, "method": "sobol"}},
            r"count = 5: must be a power of two, such as 4",
        ),
        ({"sample": {"count": 4, "ranges": RANGES, "seed": -1}}, r"seed = -1: must be a whole number from 0"),
        ({"sample": {"count": 4, "ranges": RANGES, "number": 1}}, r"^sweep.sample.number: unknown"),
        ({"grid": {"friction": [0.1]}, "sample": {"count": 4, "ranges": RANGES}}, r"friction: varied in more than one"),
    ],
)
def test_mistakes_are_named(table, message):
    with pytest.raises(InputError, match=message):
        points_of(table)
