"""The outlines of all grains of a grains.nc, at the time that is asked for."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers.shaped_grains import append_snapshot, grains_file

TETRAHEDRON = lsm.shapes.regular_polyhedron(4)


def area_of(x):
    y = np.roll(x, -1, axis=0)
    return 0.5 * np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])


@pytest.fixture
def plane(tmp_path):
    """A square and a disc in 2D, at three times; the square turns by a tenth of a turn from one to the next."""
    writer = grains_file(tmp_path / "grains.nc", [lsm.disc(), lsm.shapes.regular_polygon(4)], [1, 0], [2e-3, 1e-3])
    for i in range(3):
        half = 0.5 * (2.0 * np.pi / 10.0) * i
        turned = [[np.cos(half), 0.0, 0.0, np.sin(half)], [1.0, 0.0, 0.0, 0.0]]
        append_snapshot(writer, 0.1 * i, [[1e-3 * i, 0.0], [5e-3, 2e-3]], orientation=turned)
    return tmp_path / "grains.nc"


def test_outlines_in_2d_lie_where_the_grains_are(plane):
    dataset = lsm.open_run(plane)
    square, disc = lsm.outlines(dataset, 0.1)
    assert area_of(square) == pytest.approx(np.pi / 4 * (2e-3) ** 2, rel=1e-3)
    assert area_of(disc) == pytest.approx(np.pi / 4 * (1e-3) ** 2, rel=1e-3)
    assert np.linalg.norm(disc - (5e-3, 2e-3), axis=1) == pytest.approx(0.5e-3)
    body = 2e-3 * lsm.shapes.regular_polygon(4).outline(2000)
    corner = body[np.argmax(np.linalg.norm(body, axis=1))]  # the farthest point, turned by a tenth of a turn
    angle = np.arctan2(corner[1], corner[0]) + 2.0 * np.pi / 10.0
    at = np.linalg.norm(corner) * np.array([np.cos(angle), np.sin(angle)]) + (1e-3, 0.0)
    assert np.linalg.norm(square - at, axis=1).min() < 2e-5


def test_the_nearest_snapshot_is_taken_and_the_last_without_a_time(plane):
    dataset = lsm.open_run(plane)
    for time, snapshot in ((0.04, 0), (0.06, 1), (0.9, 2), (None, 2)):
        square, _ = lsm.outlines(dataset, time)
        assert square.mean(axis=0)[0] == pytest.approx(1e-3 * snapshot, abs=1e-5)
    assert np.array_equal(lsm.outlines(dataset.isel(time=1))[0], lsm.outlines(dataset, 0.1)[0])


def test_meshes_in_3d_are_rotated_by_the_orientation(tmp_path):
    """The corners of a tetrahedron are where an independent rotation takes them; a sphere without one is a sphere."""
    rotation = Rotation.from_rotvec([0.3, -1.1, 0.7])
    writer = grains_file(tmp_path / "grains.nc", [TETRAHEDRON, lsm.sphere()], [0, 1], [2e-3, 1e-3])
    turned = [rotation.as_quat(scalar_first=True), [1.0, 0.0, 0.0, 0.0]]
    place = np.array([[1e-3, 2e-3, 3e-3], [9e-3, 0.0, 0.0]])
    append_snapshot(writer, 0.0, place, orientation=turned)
    solid, ball = lsm.outlines(lsm.open_run(tmp_path / "grains.nc"))
    assert solid.volume == pytest.approx(np.pi / 6 * (2e-3) ** 3, rel=1e-3)
    assert ball.volume == pytest.approx(np.pi / 6 * (1e-3) ** 3, rel=1e-3)
    # The surface of a tetrahedron is farthest from its centre along its four corners.
    corners = TETRAHEDRON.feature_centre[-TETRAHEDRON.vertex_count :].copy()
    for along in rotation.apply(corners) / np.linalg.norm(corners, axis=1)[:, None]:
        reach = ((solid.vertices - place[0]) @ along).max()
        assert reach == pytest.approx(2e-3 * TETRAHEDRON.bounding_radius, rel=5e-3)


def test_files_of_the_recorder_hold_what_the_outlines_need(sheared):
    folder, params, _ = sheared("angular")
    dataset = lsm.open_run(folder / "grains.nc")
    area = sum(map(area_of, lsm.outlines(dataset)))
    assert area * params.density * params.diameter == pytest.approx(float(dataset.mass.sum()), rel=1e-3)


@pytest.mark.parametrize(
    ("shape", "parts", "edge_radius"),
    [(lsm.shapes.crossed_bars(), [0] * 8 + [1] * 8, 0.0), (TETRAHEDRON, [0] * 8, TETRAHEDRON.dilation)],
    ids=["cross", "tetrahedron"],
)
def test_the_recorder_tells_the_part_of_every_patch_and_the_radius_of_its_edges(shape, parts, edge_radius):
    from taichi_lsm.io.layer_recorder import _constants

    scene = lsm.Scene(
        dim=shape.dim, position=np.zeros((1, shape.dim)), shapes=[shape], diameter=1e-3, density=2650.0, effects=[]
    )
    constants = _constants(scene)
    assert constants["patch_part"].tolist() == parts and constants["patch_part"].dtype == np.int32
    assert constants["patch_edge_radius"].tolist() == [edge_radius] * len(parts)


def test_what_is_no_grains_file_is_refused(plane):
    dataset = lsm.open_run(plane)
    with pytest.raises(lsm.InputError, match=r"lacks patch_part, must be a grains.nc of this version"):
        lsm.outlines(dataset.drop_vars("patch_part"))
    with pytest.raises(lsm.InputError, match="time = 'noon': must be a time"):
        lsm.outlines(dataset, "noon")
    with pytest.raises(lsm.InputError, match="holds no snapshot"):
        lsm.outlines(dataset.isel(time=slice(0)))
    with pytest.raises(lsm.InputError, match="do not belong together"):
        lsm.outlines(dataset.assign(shape_index=("grain", [0, 2])))
    with pytest.raises(lsm.InputError, match="holds what is no rotation"):
        lsm.outlines(dataset.assign(orientation=0.0 * dataset.orientation))


def test_a_file_is_read_when_it_is_used(plane):
    with lsm.opened_run(plane) as lazy:
        assert not lazy.position._in_memory and lazy.sizes["time"] == 3
        snapshot = lazy.isel(time=1).load()
    assert snapshot.position.values[0, 0] == pytest.approx(1e-3)
    with pytest.raises(lsm.InputError, match="no such file"), lsm.opened_run(plane.parent / "none.nc"):
        pass
