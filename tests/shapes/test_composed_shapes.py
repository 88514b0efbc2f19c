"""Grains of general patches, clumps and unions; smooth outlines; storage of shapes bit for bit."""

from dataclasses import fields

import netCDF4
import numpy as np
import pytest
import shapely
import xarray as xr

import taichi_lsm as lsm
from taichi_lsm.shapes.union import placed, union


@pytest.fixture(scope="module")
def angular():
    return lsm.random_angular_shapes(1, 3)[0]


def test_patches_of_a_chain_tile_and_have_its_mass(angular):
    shape = lsm.GrainShape.from_patches(*angular.patches())
    assert sum(shape.coverage()) < 1e-12
    assert shape.measure == pytest.approx(angular.measure, rel=1e-12)
    assert shape.inertia == pytest.approx(angular.inertia, rel=1e-12)
    assert shape.centre == pytest.approx(angular.centre, abs=1e-12)
    assert shape.bounding_radius == pytest.approx(angular.bounding_radius, rel=1e-12)


def test_coverage_counts_missed_and_doubly_covered_angles(angular):
    patches = angular.patch_count
    assert lsm.from_chain(angular, 1e-3).coverage().uncovered == pytest.approx(patches * 2e-3 / (2 * np.pi), rel=1e-9)
    assert lsm.from_chain(angular, -1e-3).coverage().doubly_covered == pytest.approx(
        patches * 2e-3 / (2 * np.pi), rel=1e-9
    )
    n = np.concatenate([np.eye(3), -np.eye(3)])
    cube = lsm.GrainShape.from_patches(0 * n, np.full(6, 0.5), n, np.full(6, np.pi / 4), measure=1.0, inertia=[1, 1, 1])
    covered = 6 * (1 - np.cos(np.pi / 4)) / 2  # the six cones touch and leave the corners out
    assert cube.coverage().uncovered == pytest.approx(1 - covered, abs=1e-3)
    with pytest.raises(ValueError, match="measure, inertia: must be given"):
        lsm.GrainShape.from_patches(0 * n, np.full(6, 0.5), n, np.full(6, np.pi / 4))


def test_clumps_have_the_mass_of_their_union():
    two = lsm.clump([(0, 0), (1, 0)], [1.0, 1.0], normalise=False)
    assert two.measure == pytest.approx(2 * np.pi - (2 * np.pi / 3 - np.sqrt(3) / 2), rel=1e-12)
    pair = lsm.clump([(0, 0, 0), (1, 0, 0)], [1.0, 1.0], normalise=False)
    assert pair.measure == pytest.approx(8 / 3 * np.pi - 5 * np.pi / 12, rel=2e-3)
    assert len(two.parts) == 2 and two.part_bounds()[1] == pytest.approx([1.0, 1.0])


def test_discs_need_many_more_elements_than_arcs_for_the_same_outline(angular):
    errors = [lsm.outline_error(angular, lsm.equal_clump(angular, n)) for n in (30, 60)]
    assert 0.02 < errors[0] < 0.06 and 0.3 < errors[1] / errors[0] < 0.7


def test_a_union_has_the_mass_of_what_it_covers():
    bar = lsm.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.1, normalise=False)
    parts = [placed(bar, (0.0, 0.0)), placed(bar, (1.0, 1.0), 0.5 * np.pi)]
    shape = union(parts, normalise=False)
    body = shapely.union_all([shapely.Polygon(p.outline(20000)) for p in parts])
    assert shape.measure == pytest.approx(body.area, rel=1e-7)
    moved = shapely.union_all([shapely.Polygon(p.outline(20000)) for p in shape.members])
    assert np.array(moved.centroid.coords[0]) == pytest.approx((0, 0), abs=1e-6)
    assert lsm.cross().stiffness_peak == 2.0
    with pytest.raises(ValueError, match="hang together"):
        union([placed(bar, (0.0, 0.0)), placed(bar, (9.0, 0.0))])


def test_ellipses_converge_and_polygons_have_their_corners():
    t = np.linspace(0, 2 * np.pi, 997)
    n = np.stack([np.cos(t), np.sin(t)], axis=1)
    b = 0.5 / np.sqrt(2.0)
    exact = np.hypot(2 * b * n[:, 0], b * n[:, 1])
    errors = [np.abs(lsm.ellipse(2.0, arcs).support(n) - exact).max() for arcs in (12, 24, 48)]
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert lsm.regular_polygon(5, 0.07).overlap_limit == pytest.approx(0.07, abs=1e-9)
    y, x = np.mgrid[-30:31, -30:31]
    shape, misfit = lsm.from_outline(lsm.outline_of_image(np.hypot(x / 1.5, y), 15.0))
    assert misfit.greatest_distance < 0.01 and shape.measure == pytest.approx(np.pi / 4)
    with pytest.raises(ValueError, match="not convex"):
        lsm.from_outline([(0, 0), (2, 0), (2, 2), (1, 0.3), (0, 2)])


def same(a, b):
    for field in fields(a):
        mine, other = getattr(a, field.name), getattr(b, field.name)
        if field.name == "members":
            for x, y in zip(mine, other, strict=True):
                same(x, y)
        else:
            assert np.array_equal(mine, other), field.name


def test_shapes_come_back_from_a_file_bit_for_bit(tmp_path, angular):
    path = tmp_path / "shapes.nc"
    shapes = [lsm.disc(), lsm.sphere(), angular, lsm.regular_polyhedron(6), lsm.from_chain(angular, 0.01), lsm.cross()]
    lsm.save_shapes(path, shapes)
    for before, after in zip(shapes, lsm.load_shapes(path), strict=True):
        assert type(before) is type(after)
        same(before, after)
    assert xr.open_dataset(path).attrs["title"] == "Grain shapes"
    with netCDF4.Dataset(path, "a") as file:
        file["shape_2"].variables["radius"][3] = np.nan
    with pytest.raises(ValueError, match="shapes.nc: shape_2: radius"):
        lsm.load_shapes(path)
    (tmp_path / "text.nc").write_text("nothing")
    for name, words in (("text.nc", "cannot be read"), ("none.nc", "no such file")):
        with pytest.raises(ValueError, match=words):
            lsm.load_shapes(tmp_path / name)
