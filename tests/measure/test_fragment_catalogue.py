"""Masses, sizes, shapes and new surface of fragments whose pieces lie where closed forms know them."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm

M, D = 2.0, 0.3  # of a ball [kg], [m]
TURNED = Rotation.from_rotvec([0.3, -0.8, 0.5])


def snapshots(position, inertia, scale, intact, bonds, orientation=None, **patches):
    """The part of grains.nc that says what fragments are; grain 0 is glued."""
    count, times = len(position), len(intact)
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)) if orientation is None else orientation
    ends = np.array(bonds)
    data = {
        "mass": ("grain", np.full(count, M)),
        "inertia": (("grain", "space") if np.ndim(inertia) == 2 else "grain", inertia),
        "kind": ("grain", np.arange(count) == 0),
        "shape_index": ("grain", np.zeros(count, int)),
        "shape_scale": ("grain", np.full(count, scale)),
        "position": (("time", "grain", "space"), np.tile(position, (times, 1, 1))),
        "orientation": (("time", "grain", "quaternion"), np.tile(orientation, (times, 1, 1))),
        "bond_first": ("bond", ends[:, 0]),
        "bond_second": ("bond", ends[:, 1]),
        "bond_area": ("bond", 0.01 * (1.0 + np.arange(len(ends)))),
        "bond_intact": (("time", "bond"), intact),
        "shear_strain": ("time", 0.5 * np.arange(times)),
    }
    return xr.Dataset(data | patches, {"time": 0.1 * np.arange(times)})


def test_three_balls_in_a_row_that_part_one_after_the_other():
    """A ball has m (d/2)^2/5 along each axis, a row of three 2 m d^2 more along itself."""
    row = 5.0 + TURNED.apply(np.arange(4)[:, None] * [D, 0.0, 0.0])
    ball = M * D**2 / 10.0
    file = snapshots(row, np.full((4, 3), ball), D, [[1, 1], [1, 0]], [(1, 2), (2, 3)])
    found = lsm.fragment_catalogue(file)
    assert found.snapshot.values.tolist() == [0, 1, 1] and found.time.values.tolist() == [0.0, 0.1, 0.1]
    assert found.pieces.values.tolist() == [3, 2, 1] and found.parent.values.tolist() == [0, 0, 0]
    assert found.mass.values == pytest.approx([3 * M, 2 * M, M], rel=1e-14)
    assert found.diameter.values == pytest.approx(D * np.cbrt([3.0, 2.0, 1.0]), rel=1e-14)
    across = np.array([3, 2, 1]) / 20.0
    along = across + np.array([2.0, 0.5, 0.0])
    assert found.elongation.values == pytest.approx(np.sqrt(across / along), rel=1e-9)
    assert found.flatness.values == pytest.approx(1.0, rel=1e-9)
    size = np.cbrt([3.0, 2.0, 1.0]) ** 2 * np.array([3, 2, 1]) * 0.15
    assert found.compactness.values == pytest.approx(size / (along + 2.0 * across), rel=1e-9)
    assert found.new_surface.values == pytest.approx([0.0, 0.02, 0.02])


def test_a_turned_brick_has_its_three_axes_and_so_has_the_one_that_two_make():
    """Of 1 x 3 x 2, side by side along the first side: 2 x 3 x 2."""
    sides = np.array([1.0, 3.0, 2.0])
    inertia = np.tile(M * (np.sum(sides**2) - sides**2) / 12.0, (3, 1))
    turned = np.tile(TURNED.as_quat(scalar_first=True), (3, 1))
    places = TURNED.apply([[9.0, 0.0, 0.0], [-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    found = lsm.fragment_catalogue(snapshots(places, inertia, D, [[1], [0]], [(1, 2)], turned))
    assert found.elongation.values == pytest.approx([2.0 / 3.0] * 3, rel=1e-12)
    assert found.flatness.values == pytest.approx([1.0, 0.5, 0.5], rel=1e-12)


def test_an_ellipse_in_2d_has_its_aspect_and_no_flatness():
    shape = lsm.shapes.ellipse(2.0)
    centre, radius, axis, half = shape.patches()
    patches = {"patch_centre": (("patch", "space"), centre), "patch_axis": (("patch", "space"), axis)}
    patches |= {"patch_radius": ("patch", radius), "patch_angle": ("patch", half)}
    patches |= {"patch_count": ("shape", [len(radius)])}
    file = snapshots(np.eye(3, 2), np.full(3, M * D**2 * shape.inertia[0]), D, [[0]], [(1, 2)], **patches)
    found = lsm.fragment_catalogue(file)
    assert found.elongation.values == pytest.approx([0.5, 0.5], rel=0.01)
    assert "flatness" not in found and found.diameter.values == pytest.approx([D, D])


def test_a_file_without_bonds_is_refused():
    with pytest.raises(lsm.InputError, match="has no bond_first, bond_second"):
        lsm.fragment_catalogue(xr.Dataset({"orientation": ("grain", [1.0]), "shear_strain": ("time", [0.0])}))
