"""Outlines with the flaws of digitised ones: mended, and said so; others are refused."""

from contextlib import suppress

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import from_outline
from taichi_lsm.shapes.outline_repair import simple_outline

ANGLE = 2.0 * np.pi * np.arange(60) / 60
OVAL = np.stack([np.cos(ANGLE), 0.7 * np.sin(ANGLE)], axis=1) + 0.05 * np.stack([np.cos(3 * ANGLE)] * 2, axis=1)


def with_rows(at, rows, points=OVAL):
    return np.concatenate([points[:at], rows, points[at:]])


def swapped(*at):
    points = OVAL.copy()
    for i in at:
        points[[i, i + 1]] = points[[i + 1, i]]
    return points


TIP = 2.0 * OVAL[10]
BESIDE = 0.004 * np.array([-TIP[1], TIP[0]])
FLAWED = {
    "overshoot": (np.concatenate([OVAL, OVAL[:4] * 1.003]), "crossings, overshoots or spikes"),
    "spike": (with_rows(11, [TIP, OVAL[10]]), "crossings, overshoots or spikes"),
    "narrow spike": (with_rows(11, [TIP, OVAL[10] + BESIDE]), "spikes narrower than 2 %"),
    "crossed spike": (with_rows(11, [TIP, OVAL[10] - 0.2 * BESIDE]), "crossings, overshoots or spikes"),
    "swapped": (swapped(17), "1 pair of swapped neighbours"),
    "swapped twice": (swapped(3, 30), "2 pairs of swapped neighbours"),
    "swapped at the end": (np.roll(swapped(17), -18, axis=0), "1 pair of swapped neighbours"),
    "loop": (with_rows(20, OVAL[19] + 0.02 * np.array([(0, 3), (1, 3), (1, 0), (-2, 1)])), "crossings, overshoots"),
}


@pytest.mark.parametrize("name", FLAWED)
@pytest.mark.parametrize("hull", [True, False])
def test_flawed_outlines_give_the_clean_grain_and_say_so(name, hull):
    points, words = FLAWED[name]
    clean, _, there = from_outline(OVAL)
    shape, misfit, placement = from_outline(points, hull=hull)
    assert placement.diameter**2 == pytest.approx(there.diameter**2, rel=0.01)
    assert placement.centre == pytest.approx(there.centre, abs=0.01)
    assert shape.inertia == pytest.approx(clean.inertia, rel=0.01)
    assert shape.bounding_radius == pytest.approx(clean.bounding_radius, rel=0.01)
    assert len(misfit.repairs) == 1 and words in misfit.repairs[0]


@pytest.mark.parametrize("unit", [1.0, 1e-3, 5e-6, 1e-6])
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_unit_origin_sense_and_doubled_points_do_not_matter(unit, shift):
    clean, misfit, there = from_outline(OVAL)
    points = np.concatenate([np.repeat(OVAL, 2, axis=0)[::-1], OVAL[-1:]])  # clockwise, the first point repeated
    away = np.array([shift, -2.0 * shift])
    points = unit * (points + away)
    flat = np.column_stack([points, np.full(len(points), 3.0 * unit)])
    for given_points in (points, flat):
        shape, again, placement = from_outline(given_points)
        assert placement.diameter == pytest.approx(unit * there.diameter, rel=1e-9)
        assert placement.centre / unit == pytest.approx(there.centre + away, abs=1e-6)
        assert shape.inertia == pytest.approx(clean.inertia, rel=1e-6)
        assert again[:3] == pytest.approx(misfit[:3], abs=1e-6) and again.repairs == ()


@pytest.mark.parametrize("degrees", [5.0, 20.0, 60.0])
def test_sharp_corners_are_no_spikes(degrees):
    tip = np.array([(0.0, 0.0), (1.0, -np.tan(np.radians(degrees) / 2)), (1.0, np.tan(np.radians(degrees) / 2))])
    dented = np.concatenate([tip[:2], [(0.93, 0.0)], tip[2:]])
    body, repairs = simple_outline(dented)
    assert repairs == () and body.equals(shapely.Polygon(dented))


def test_outlines_that_enclose_nothing_or_too_much_else_are_refused():
    bow = [(0, 0), (1, 1), (1, 0), (0, 1)]
    eight = np.stack([np.sin(ANGLE), np.sin(2 * ANGLE)], axis=1)
    twice = np.concatenate([OVAL, 0.5 * OVAL + 0.7])
    for points in (bow, eight, twice):
        with pytest.raises(
            InputError, match=r"points: no simple outline \(it crosses itself, with .* % of its area in doubt"
        ):
            from_outline(points, hull=True)
    with pytest.raises(InputError, match=r"no simple outline \(they run to and fro\)"):
        from_outline(np.random.default_rng(1).normal(size=(500, 2)), hull=True)
    with pytest.raises(InputError, match="no simple outline"):
        from_outline([(0, 0), (1, 1), (2, 2), (1, 1)])
    with pytest.raises(InputError, match="extent 0, must be above 0"):
        from_outline([(2, 2)] * 5)
    with pytest.raises(InputError, match="2 different ones, must be from 3"):
        from_outline([(2, 2), (3, 2), (2, 2), (2, 2)])
    with pytest.raises(InputError, match=r"z from 0 to 1, must be constant"):
        from_outline([(0, 0, 0), (1, 0, 1), (0, 1, 0)])
    with pytest.raises(InputError, match="resolution = -1"):
        from_outline(OVAL, resolution=-1)


def test_concavities_within_the_resolution_are_none():
    steps = np.round(8.0 * OVAL / 0.5) * 0.5
    with pytest.raises(InputError, match=r"not convex.*hull=True.*resolution="):
        from_outline(steps)
    shape, misfit, placement = from_outline(steps, resolution=0.5)
    clean, _, there = from_outline(8.0 * OVAL)
    assert placement.diameter == pytest.approx(there.diameter, rel=0.02)
    assert shape.bounding_radius == pytest.approx(clean.bounding_radius, rel=0.03)
    assert misfit.repairs == ()


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(st.lists(st.tuples(*[st.sampled_from([0.0, 1.0, 2.0, 2.5, -1.0, 1e-9, 1e9, 1e-200, 1e308])] * 2), max_size=9))
def test_any_points_give_a_grain_or_a_reason(points):
    with suppress(InputError):
        shape = from_outline(points, hull=True).shape
        assert shape.measure == pytest.approx(np.pi / 4)
