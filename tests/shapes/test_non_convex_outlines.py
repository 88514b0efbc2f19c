"""Non-convex outlines become unions whose parts overlap inside only."""

import numpy as np
import pytest
import shapely

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import apparent_stiffness, from_polygon, non_convex_outline, place_part
from taichi_lsm.shapes.grown_parts import DRAWN_IN, RISE, grown_pieces
from taichi_lsm.shapes.polygon_parts import convex_pieces
from tests.shapes.non_convex_bodies import L_CORNERS, bone_outline, cross_outline, horseshoe_outline


def test_a_cross_is_two_bars_and_an_l_two_convex_pieces_that_cover_it():
    for corners, count in ((cross_outline(), 2), (L_CORNERS, 2)):
        body = shapely.Polygon(np.array(corners) / 2.5)
        rings, filled = convex_pieces(body, 0.01)
        assert len(rings) == count and filled.equals(body)
        pieces = [shapely.Polygon(ring) for ring in rings]
        assert all(p.convex_hull.area == pytest.approx(p.area, rel=1e-9) for p in pieces)
        assert shapely.union_all(pieces).symmetric_difference(body).area < 1e-9


def test_parts_grow_into_each_other_and_one_of_two_is_drawn_in():
    """On the long bottom of an L two parts would lie on one line: there one lies below the end of the other."""
    body = shapely.Polygon(np.array(L_CORNERS) / 2.0)
    rings, filled = convex_pieces(body, 0.01)
    grown = [shapely.Polygon(ring) for ring in grown_pieces(rings, filled, 0.03)]
    assert grown[0].intersection(grown[1]).area > 0.02
    assert shapely.union_all(grown).difference(body).area < 1e-6
    assert body.difference(shapely.union_all(grown)).area < 1e-3
    # Points of the outline that lie on both parts: none but beside the re-entrant corner, where their sides cross.
    along = shapely.get_coordinates(shapely.segmentize(body.exterior, 1e-3))
    near = [shapely.distance(p.exterior, shapely.points(along)) < 0.5 * DRAWN_IN for p in grown]
    away = np.linalg.norm(along - 0.4, axis=1) > 0.02
    assert np.any(near[0] & ~near[1]) and np.any(near[1] & ~near[0]) and not np.any(near[0] & near[1] & away)


def test_of_two_equal_pieces_the_later_one_keeps_the_outline():
    """By their order, the same in every process; the other loses two wedges of DRAWN_IN by DRAWN_IN / RISE."""
    body = shapely.box(-1.0, -0.5, 1.0, 0.5)
    left = np.array([[-1.0, -0.5], [0.0, -0.5], [0.0, 0.5], [-1.0, 0.5]])
    right = left + np.array([1.0, 0.0])
    for rings in ([left, right], [right, left]):
        grown = [shapely.Polygon(corners) for corners in grown_pieces(rings, body, 0.03)]
        first, last = (shapely.Polygon(ring).difference(one).area for ring, one in zip(rings, grown, strict=True))
        assert last == 0.0 and first > DRAWN_IN**2 / RISE


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("cross", 2),
        ("l", 2),
        pytest.param("horseshoe", 12, marks=pytest.mark.validate),
        pytest.param("bone", 5, marks=pytest.mark.validate),
    ],
)
def test_non_convex_outlines_keep_area_and_inertia_and_are_nowhere_stiffer(name, parts):
    outlines = {"cross": cross_outline, "l": lambda: L_CORNERS, "horseshoe": horseshoe_outline, "bone": bone_outline}
    shape, misfit = non_convex_outline(5.0 + 3.7 * np.array(outlines[name]()))
    print(name, misfit)
    assert shape.measure == pytest.approx(np.pi / 4) and len(shape.parts) == misfit.parts <= parts
    assert abs(misfit.measure) < 0.01 and abs(misfit.inertia) < 0.02
    assert misfit.rms_distance < misfit.greatest_distance < 0.015
    assert misfit.least_stiffness >= 0.9 and misfit.greatest_stiffness <= 1.1
    assert misfit.doubled_share == 0.0 and misfit.junction_share < 0.03
    assert 0.025 < misfit.least_radius < 0.035


def test_parts_along_one_line_are_found_to_be_twice_as_stiff():
    bar = from_polygon([(-0.6, -0.2), (0.6, -0.2), (0.6, 0.2), (-0.6, 0.2)], 0.05, 2e-3, normalise=False)
    found = apparent_stiffness([place_part(bar, (0.0, 0.0)), place_part(bar, (0.3, 0.0))])
    assert found.greatest == pytest.approx(2.0, abs=1e-3) and 0.4 < found.doubled_share < 0.7
    crossed = apparent_stiffness(lsm.shapes.crossed_bars().parts)
    assert crossed.greatest == crossed.least == pytest.approx(1.0) and crossed.junction_share > 0.0


def test_flaws_of_an_outline_are_mended_as_those_of_a_convex_one_and_told():
    plain, whole = non_convex_outline(L_CORNERS)
    corners = np.array(L_CORNERS, float)
    spike = 0.5 * (corners[0] + corners[1]) + [[0.0, 0.0], [0.0, -0.3], [0.0, 0.0]]
    shape, misfit = non_convex_outline(np.concatenate([corners[:1], spike, corners[1:]])[::-1] + 1e7)
    assert whole.repairs == () and len(misfit.repairs) == 1 and "spikes" in misfit.repairs[0]
    assert shape.inertia == pytest.approx(plain.inertia, rel=1e-3) and misfit.parts == whole.parts


def test_a_convex_outline_stays_one_part():
    shape, misfit = non_convex_outline([(0, 0), (2, 0), (2, 1), (0, 1)])
    assert isinstance(shape, lsm.shapes.ArcChain) and misfit.parts == 1
    assert abs(misfit.measure) < 1e-3 and abs(misfit.inertia) < 0.01


def test_wrong_non_convex_outlines_are_refused():
    with pytest.raises(InputError, match="no simple outline"):
        non_convex_outline([(0, 0), (1, 1), (1, 0), (0, 1)])
    with pytest.raises(InputError, match=r"tolerance = 0\.5"):
        non_convex_outline(L_CORNERS, tolerance=0.5)
    with pytest.raises(InputError, match=r"corner_radius = 0\.3"):
        non_convex_outline(L_CORNERS, 0.3)
