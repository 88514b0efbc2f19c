"""Arc chains: mass properties against closed forms, the tiling of normals, and the fit to polygons."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from shapely import Polygon

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import arc_chain, from_polygon, regular_disc_of_arcs

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def regular_polygon(sides, apothem=0.5):
    angle = 2 * np.pi / sides * np.arange(sides)
    return apothem / np.cos(np.pi / sides) * np.column_stack([np.cos(angle), np.sin(angle)])


def random_polygon(seed, points):
    cloud = np.random.default_rng(seed).standard_normal((points, 2))
    return cloud[ConvexHull(cloud).vertices]


def half_planes(polygon):
    side = np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([side[:, 1], -side[:, 0]]) / np.linalg.norm(side, axis=1)[:, None]
    return normal, np.sum(normal * polygon, axis=1)


def inscribed_radius(polygon):
    normal, distance = half_planes(polygon)
    rows = np.column_stack([normal, np.ones(len(normal))])
    return linprog([0, 0, -1], A_ub=rows, b_ub=distance, bounds=(None, None)).x[2]


def arcs_that_own(shape, direction):
    """How many arcs claim each direction (k, 2): the half-open test of a contact."""
    low, high = shape.seam[:, None], np.roll(shape.seam, -1, axis=0)[:, None]
    after = low[..., 0] * direction[:, 1] - low[..., 1] * direction[:, 0]
    before = direction[:, 0] * high[..., 1] - direction[:, 1] * high[..., 0]
    return np.sum((after >= 0) & (before > 0), axis=0)


def support(shape, normal):
    """h(n) = max of x . n: for a chain the greatest of its arcs' p . n + r over the arc that owns n."""
    low, high = shape.seam[:, None], np.roll(shape.seam, -1, axis=0)[:, None]
    after = low[..., 0] * normal[:, 1] - low[..., 1] * normal[:, 0]
    before = normal[:, 0] * high[..., 1] - normal[:, 1] * high[..., 0]
    own = (after >= 0) & (before > 0)
    return np.where(own, shape.centre @ normal.T + shape.radius[:, None], -np.inf).max(axis=0)


def excess_over(polygon, shape):
    """How far the shape sticks out of the polygon where it fits best; negative if there is space to spare."""
    normal, distance = half_planes(polygon)
    rows = np.column_stack([normal, -np.ones(len(normal))])
    free = distance - support(shape, normal)
    return linprog([0, 0, 1], A_ub=rows, b_ub=free, bounds=(None, None)).x[2]


def assert_closed_g1(shape):
    following = np.roll(shape.seam, -1, axis=0)
    end = shape.centre + shape.radius[:, None] * following
    start = np.roll(shape.centre + shape.radius[:, None] * shape.seam, -1, axis=0)
    assert np.abs(end - start).max() < 1e-13 * shape.radius.max() / shape.bounding_radius


def assert_normals_tile_the_circle(shape):
    angle = 2 * np.pi / 1000 * (np.arange(1000) + 0.123)
    direction = np.concatenate([np.column_stack([np.cos(angle), np.sin(angle)]), shape.seam])
    assert np.all(arcs_that_own(shape, direction) == 1)


@pytest.mark.parametrize("n", [3, 4, 30, 200])
def test_disc_of_arcs(n):
    uneven = np.sort(2 * np.pi * (np.arange(n) + 0.4 * np.random.default_rng(n).random(n)) / n)
    for shape in (regular_disc_of_arcs(n), arc_chain(uneven, np.full(n, 7.0))):
        assert shape.patch_count == n
        assert np.abs(shape.centre).max() < 1e-15
        assert shape.radius == pytest.approx(0.5, rel=1e-14)
        assert shape.measure == pytest.approx(np.pi / 4, rel=1e-14)
        assert shape.inertia == pytest.approx([np.pi / 32], rel=1e-14)
        assert (shape.bounding_radius, shape.overlap_limit) == pytest.approx((0.5, 0.5), rel=1e-14)
        assert shape.lever < 1e-15
        assert_normals_tile_the_circle(shape)


@pytest.mark.parametrize(("small", "large", "half_angle"), [(0.3, 2.0, 1.2), (0.01, 50.0, 1.55), (1.0, 1.5, 0.2)])
def test_oval_of_four_arcs_against_the_steiner_formula(small, large, half_angle):
    """The oval is a lens of radii large - small widened by r = small: area = A_lens + P_lens r + pi r^2."""
    blunt = np.pi / 2 - half_angle
    breaks = [-half_angle, half_angle, half_angle + 2 * blunt, np.pi + half_angle]
    shape = arc_chain(breaks, [small, large, small, large], normalise=False)
    core = large - small
    lens = core**2 * (2 * blunt - np.sin(2 * blunt))
    assert shape.measure == pytest.approx(lens + 4 * core * blunt * small + np.pi * small**2, rel=1e-12)
    tip, waist = core * np.sin(blunt) + small, large - core * np.cos(blunt)
    assert shape.bounding_radius == pytest.approx(max(tip, waist), rel=1e-12)
    assert shape.overlap_limit == small
    # p cross n of a centre on an axis of symmetry grows away from that axis, so the seam has the greatest
    assert shape.lever == pytest.approx(core * np.sin(blunt) * np.cos(blunt), rel=1e-12)
    assert np.abs(shape.centre.sum(axis=0)).max() < 1e-13 * large
    assert_closed_g1(shape)


def test_mass_properties_against_a_fine_polygon():
    shape = from_polygon(random_polygon(3, 8), 0.1, arcs_per_corner=2)
    a = shape.outline(200_000)[:-1]
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    polar = np.sum(cross * np.sum(a * a + a * b + b * b, axis=1)) / 12
    assert shape.inertia[0] == pytest.approx(polar, rel=1e-8)
    assert shape.measure == pytest.approx(0.5 * cross.sum(), rel=1e-8)
    assert np.abs((a + b).T @ cross).max() / 6 < 1e-8
    assert shape.bounding_radius == pytest.approx(np.linalg.norm(a, axis=1).max(), rel=1e-8)
    chord = b - a
    line = np.abs(np.sum((a + b) / 2 * chord, axis=1)) / np.linalg.norm(chord, axis=1)  # |x cross n| = |x . t|
    assert shape.lever == pytest.approx(line.max(), rel=1e-4)
    assert line.max() < shape.lever


def test_reach_of_random_chains_against_a_fine_outline():
    """Ovals of many arcs: both extremes occur inside an arc as well as at a seam."""
    rng = np.random.default_rng(0)
    inside_bounding = inside_lever = 0
    for _ in range(200):
        n = rng.integers(8, 20)
        breaks = (np.arange(n) + rng.uniform(0, 0.2, n) + rng.random()) * 2 * np.pi / n
        seam = np.column_stack([np.cos(breaks), np.sin(breaks)])
        step = np.roll(seam, -1, axis=0) - seam
        middle = breaks + 0.5 * np.diff(breaks, append=breaks[0] + 2 * np.pi)
        radii = 1.0 + 0.6 * rng.random() * np.cos(2 * middle) + rng.uniform(-0.01, 0.01, n)
        radii -= np.linalg.lstsq(step.T, step.T @ radii, rcond=None)[0]
        shape = arc_chain(breaks, radii)
        first, span = shape._spans()
        angle = first[:, None] + span[:, None] * np.linspace(0, 1, 2001)
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        x = shape.centre[:, None] + shape.radius[:, None, None] * normal
        distance = np.linalg.norm(x, axis=2)
        lever = np.abs(x[..., 0] * normal[..., 1] - x[..., 1] * normal[..., 0])
        assert shape.bounding_radius == pytest.approx(distance.max(), abs=1e-7)
        assert shape.lever == pytest.approx(lever.max(), abs=1e-7)
        inside_bounding += distance[:, 0].max() < shape.bounding_radius - 1e-5
        inside_lever += lever[:, 0].max() < shape.lever - 1e-5
    assert inside_bounding > 5 and inside_lever > 5


def test_flat_sides_do_not_spoil_the_centre_of_mass():
    """Radii of 500 sides put the first centre far away; yet where the chain begins must not matter."""
    fit = from_polygon(random_polygon(5, 7), 0.1, 1e-3, largest_radius=1e4, normalise=False)
    assert fit.radius.max() > 500
    first, span = fit._spans()
    breaks = first[0] + np.concatenate([[0], np.cumsum(span)[:-1]])
    for k in range(1, fit.patch_count):
        start = np.concatenate([breaks[k:], breaks[:k] + 2 * np.pi])
        shape = arc_chain(start, np.roll(fit.radius, -k), normalise=False)
        assert shape.centre == pytest.approx(np.roll(fit.centre, -k, axis=0), abs=1e-11)


def test_cutting_an_arc_in_two_changes_nothing():
    breaks, radii = np.array([0.1, 1.3, 2.6, 3.2, 4.4, 5.8]), np.array([0.2, 2.0, 0.2, 2.0, 0.2, 2.0])
    step = np.diff(np.exp(1j * np.append(breaks, breaks[0])))
    closing = np.linalg.solve([step[1::4].real, step[1::4].imag], [-(radii @ step).real, -(radii @ step).imag])
    radii[1::4] += closing
    whole = arc_chain(breaks, radii)
    cut = arc_chain(np.insert(breaks, 2, 2.0), np.insert(radii, 2, radii[1]))
    assert cut.patch_count == whole.patch_count + 1
    for name in ("measure", "bounding_radius", "overlap_limit", "lever", "inertia"):
        assert getattr(cut, name) == pytest.approx(getattr(whole, name), rel=1e-13), name
    assert cut.centre[2] == pytest.approx(cut.centre[1], abs=1e-15)


def test_normalising_only_rescales():
    raw = from_polygon(7 * SQUARE, 0.5, normalise=False)
    unit = from_polygon(7 * SQUARE, 0.5)
    scale = np.sqrt(unit.measure / raw.measure)
    assert unit.measure == pytest.approx(np.pi / 4, rel=1e-14)
    assert unit.centre == pytest.approx(scale * raw.centre, abs=1e-13)
    assert unit.inertia == pytest.approx(scale**4 * raw.inertia, rel=1e-12)
    assert raw.overlap_limit == pytest.approx(0.5, rel=1e-12)


def test_open_chains_and_wrong_angles_are_refused():
    third = 2 * np.pi / 3 * np.arange(3)
    with pytest.raises(InputError, match="open by"):
        arc_chain(third, [1.0, 1.0, 1.1])
    with pytest.raises(InputError, match="less than pi"):
        arc_chain([0.0, 1.0, 2.0], np.ones(3))
    with pytest.raises(InputError, match="more than 0"):
        arc_chain(third[::-1], np.ones(3))
    with pytest.raises(InputError, match="n >= 3"):
        arc_chain([0.0, np.pi], [1.0, 1.0])
    with pytest.raises(InputError, match="n >= 3"):
        arc_chain(third, np.ones(4))
    with pytest.raises(InputError, match="breaks = "):
        arc_chain([0.0, 2.0, np.nan], np.ones(3))
    with pytest.raises(InputError, match="radii = "):
        arc_chain(third, [1.0, 0.0, 1.0])
    with pytest.raises(InputError, match="n = 2"):
        regular_disc_of_arcs(2)


@pytest.mark.parametrize("sides", range(3, 9))
def test_regular_polygon_against_the_closed_form(sides):
    """All corners sharp, all supports met: the side's radius follows from G1 and the corner's axis alone."""
    apothem, corner, half_width = 0.5, 0.05, np.radians(5)
    wide, narrow = np.sin(np.pi / sides), np.sin(np.pi / sides - half_width)
    flat = (apothem * wide - corner * narrow) / (wide - narrow)
    shape = from_polygon(regular_polygon(sides, apothem), corner, half_width, normalise=False)
    assert shape.radius[0::2] == pytest.approx(flat, rel=1e-9)
    assert shape.radius[1::2] == pytest.approx(corner, rel=1e-12)


def test_narrow_side_arcs_approach_the_rounded_square():
    corner = 0.1
    area = 1 - (4 - np.pi) * corner**2
    # the square less its four corner squares, plus four quarter discs about (q, q)
    q = 0.5 - corner
    quarter, arm = np.pi * corner**2 / 4, 4 * corner / (3 * np.pi)
    squares = 4 * 2 * corner * (0.5**3 - q**3) / 3
    discs = 4 * (np.pi * corner**4 / 8 + 2 * quarter * (q**2 + 2 * q * arm))
    polar = 1 / 6 - squares + discs
    errors = []
    for half_width in (2e-2, 1e-2, 5e-3):
        shape = from_polygon(SQUARE, corner, half_width, largest_radius=1e3, normalise=False)
        errors.append((area - shape.measure, polar - shape.inertia[0]))
    errors = np.array(errors)
    assert np.all(errors > 0)  # inside, so always a little less
    assert errors[:-1] / errors[1:] == pytest.approx(2.0, rel=0.02)  # the bulge of a side is its width x angle / 4
    extrapolated = 2 * errors[2] - errors[1]
    assert np.abs(extrapolated).max() < 1e-5


@given(seed=st.integers(0, 10**6), points=st.integers(3, 14), share=st.floats(0.02, 0.98), arcs=st.integers(1, 4))
@settings(max_examples=60, derandomize=True)
def test_any_convex_polygon(seed, points, share, arcs):
    polygon = random_polygon(seed, points)
    inscribed = inscribed_radius(polygon)
    if inscribed < 0.02 * np.sqrt(Polygon(polygon).area):
        return  # slivers are covered by the refusals
    shape = from_polygon(polygon, share * inscribed, arcs_per_corner=arcs, normalise=False)
    assert shape.patch_count == len(polygon) * (1 + arcs)
    assert_closed_g1(shape)
    assert_normals_tile_the_circle(shape)
    size = np.sqrt(4 / np.pi * Polygon(polygon).area)
    assert share * inscribed * (1 - 1e-9) <= shape.overlap_limit
    longest = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).max()
    assert longest > 1.2 * size or shape.radius.max() <= 10 * size * (1 + 1e-9)
    outline = Polygon(shape.outline(500))
    assert outline.convex_hull.area == pytest.approx(outline.area, rel=1e-9)
    # inside the polygon after some shift, and touching it: the least greatest excess over the sides is zero
    assert abs(excess_over(polygon, shape)) < 1e-8 * size


@pytest.mark.parametrize("seed", [244, 294])
def test_slivers_close_to_rounding(seed):
    """The linear programme leaves these open by more than 1e-8, beyond what a shape may be."""
    polygon = random_polygon(seed, 30) * [1.0, 0.003]
    assert_closed_g1(from_polygon(polygon, 0.5 * inscribed_radius(polygon), 0.003, arcs_per_corner=3))


def test_no_longer_chain_fits():
    """Every small change that closes, keeps the corners blunt and lengthens the chain makes it stick out."""
    polygon = random_polygon(11, 9)
    fit = from_polygon(polygon, 0.05, normalise=False)
    first, span = fit._spans()
    breaks = first[0] + np.concatenate([[0], np.cumsum(span)[:-1]])
    step = np.roll(fit.seam, -1, axis=0) - fit.seam
    bound = fit.radius < 0.05 * (1 + 1e-9)
    free = np.flatnonzero(~bound)
    rng = np.random.default_rng(0)
    longer = 0
    for _ in range(200):
        change = rng.standard_normal(fit.radius.size)
        change[bound] = 0.1 * np.abs(change[bound])
        change[free] -= np.linalg.lstsq(step[free].T, step.T @ change, rcond=None)[0]
        if change @ span <= 0:
            continue
        longer += 1
        other = arc_chain(breaks, fit.radius + 1e-3 * change, normalise=False)
        assert excess_over(polygon, other) > 1e-9
    assert longer > 50


def test_more_arcs_per_corner_are_equal_arcs():
    one, three = (from_polygon(SQUARE, 0.1, arcs_per_corner=k) for k in (1, 3))
    assert three.patch_count == 16
    assert three.inertia == pytest.approx(one.inertia, rel=1e-10)  # a square gains nothing from finer corners
    assert three._spans()[1][1:4] == pytest.approx((np.pi / 2 - 2 * np.radians(3)) / 3)


def test_vertices_may_run_either_way_and_repeat():
    plain = from_polygon(SQUARE, 0.1)
    for vertices in (SQUARE[::-1], np.insert(SQUARE, 1, [(0.5, 0.0), (1.0, 0.0)], axis=0), SQUARE + 1e3):
        shape = from_polygon(vertices, 0.1)
        assert shape.patch_count == 8
        assert shape.inertia == pytest.approx(plain.inertia, rel=1e-9)
        assert shape.bounding_radius == pytest.approx(plain.bounding_radius, rel=1e-9)


def test_largest_radius_is_a_bound():
    diameter = np.sqrt(4 / np.pi)
    free = from_polygon(SQUARE, 0.05, 0.01, largest_radius=100, normalise=False)
    held = from_polygon(SQUARE, 0.05, 0.01, largest_radius=10, normalise=False)
    assert free.radius.max() > 20 * diameter
    assert held.radius.max() == pytest.approx(10 * diameter, rel=1e-9)
    assert held.measure < free.measure


def test_largest_corner_radius_gives_the_inscribed_disc():
    shape = from_polygon(SQUARE, 0.5, normalise=False)
    assert shape.radius == pytest.approx(0.5, rel=1e-9)
    with pytest.raises(InputError, match=r"corner_radius = 0.51: .* at most 0.5 fits"):
        from_polygon(SQUARE, 0.51)
    with pytest.raises(InputError, match=r"at most 50 fits"):
        from_polygon(100 * SQUARE, 51)


def test_polygons_that_are_not_convex_and_wrong_parameters_are_refused():
    arrow = [(0, 0), (2, 0), (0.5, 0.5), (0, 2)]
    star = regular_polygon(5)[[0, 2, 4, 1, 3]]
    for vertices in (arrow, star):
        with pytest.raises(InputError, match="convex"):
            from_polygon(vertices, 0.01)
    with pytest.raises(InputError, match="area 0"):
        from_polygon([(0, 0), (1, 1), (2, 2)], 0.01)
    with pytest.raises(InputError, match="k >= 3"):
        from_polygon([(0, 0), (1, 1)], 0.01)
    for corner_radius in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="corner_radius = "):
            from_polygon(SQUARE, corner_radius)
    with pytest.raises(InputError, match="side_half_width = 2"):
        from_polygon(SQUARE, 0.1, 2.0)
    with pytest.raises(InputError, match="arcs_per_corner = 0"):
        from_polygon(SQUARE, 0.1, arcs_per_corner=0)
    with pytest.raises(InputError, match=r"largest_radius = 0.01"):
        from_polygon(SQUARE, 0.1, largest_radius=0.01)
