"""GSD files as the library of HOOMD-blue opens them: shapes with their rounding, places, orientations."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import taichi_lsm as lsm
from tests.helpers.exported_runs import TIMES, shapes_in, write_run
from tests.helpers.shaped_grains import DT
from workflows.export.formats import export_run

hoomd = pytest.importorskip("gsd.hoomd")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """exported(dim): (grains.nc, frames) of a run."""
    made = {}

    def get(dim):
        if dim not in made:
            folder = write_run(tmp_path_factory.mktemp(f"run{dim}"), dim)
            (path,), _ = export_run(folder, folder / "gsd", "gsd")
            with hoomd.open(str(path), "r") as file:
                made[dim] = lsm.open_run(folder / "grains.nc"), list(file)
        return made[dim]

    return get


@pytest.mark.parametrize("dim", [2, 3])
def test_frames_are_the_snapshots(exported, dim):
    grains, frames = exported(dim)
    assert [frame.configuration.step for frame in frames] == [round(time / DT) for time in TIMES]
    for i, frame in enumerate(frames):
        now, box = grains.isel(time=i), frame.configuration.box
        assert frame.configuration.dimensions == dim and frame.particles.N == 9
        assert np.abs(frame.particles.position / box[:3]).max() <= 0.5 + 1e-6
        unit = float(now.shape_scale.mean())
        assert frame.log["length_unit"] == pytest.approx(unit)
        unwrapped = unit * (frame.particles.position + frame.particles.image * box[:3])
        apart = unwrapped[:, :dim] - now.position.values
        assert np.allclose(apart - apart[0], 0.0, atol=1e-8)
        assert np.allclose(frame.particles.orientation, now.orientation)
        assert np.allclose(unit * frame.particles.velocity[:, :dim], now.velocity)
        assert np.allclose(frame.particles.mass, now.mass) and np.array_equal(frame.log["particles/kind"], now.kind)
        assert frame.log["time"] == pytest.approx(TIMES[i])


def described(grains, frame, grain):
    """Shape of a grain in the file, and its diameter, both in units of the file."""
    kind = frame.particles.typeid[grain]
    return frame.particles.type_shapes[kind], float(grains.shape_scale[grain]) / float(frame.log["length_unit"][0])


def test_polygons_with_their_rounding_have_the_area_of_the_grain(exported):
    """The area of a core dilated by r is A + P r + pi r^2 (Steiner)."""
    grains, frames = exported(2)
    for grain, rounded in ((0, True), (2, False)):
        shape, scale = described(grains, frames[0], grain)
        x, r = np.array(shape["vertices"]), shape["rounding_radius"]
        y = np.roll(x, -1, axis=0)
        area = 0.5 * np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]) + np.linalg.norm(y - x, axis=1).sum() * r
        assert shape["type"] == "Polygon" and (r > 0.0) == rounded
        assert area + np.pi * r**2 == pytest.approx(np.pi / 4 * scale**2, rel=1e-3)


def test_solids_have_their_corners_where_they_are(exported):
    grains, frames = exported(3)
    shape, scale = described(grains, frames[0], 0)
    tetrahedron, core = shapes_in(3)[0], np.array(shape["vertices"])
    corners = scale * tetrahedron.feature_centre[-tetrahedron.vertex_count :]
    assert shape["type"] == "ConvexPolyhedron"
    assert shape["rounding_radius"] == pytest.approx(scale * tetrahedron.dilation, rel=1e-5)
    assert np.linalg.norm(core[:, None] - corners, axis=2).min(axis=0).max() < 1e-5 * scale
    assert len(ConvexHull(core).vertices) == len(core)


@pytest.mark.parametrize("dim", [2, 3])
def test_round_grains_are_spheres_and_those_of_two_parts_closed_surfaces(exported, dim):
    grains, frames = exported(dim)
    shape, scale = described(grains, frames[0], 1)
    assert shape["type"] == "Sphere" and shape["diameter"] == pytest.approx(scale, rel=1e-5)
    shape, scale = described(grains, frames[0], 2)
    assert shape["type"] == ("Polygon" if dim == 2 else "Mesh")
    if dim == 3:
        a, b, c = (np.array(shape["vertices"])[np.array(shape["indices"])[:, i]] for i in range(3))
        assert np.sum(np.cross(a, b) * c) / 6.0 == pytest.approx(np.pi / 6 * scale**3, rel=2e-3)


@pytest.mark.parametrize("dim", [2, 3])
def test_ovito_shows_the_shapes(dim, tmp_path):
    """Bodies are meshes at their size, spheres have a radius."""
    ovito = pytest.importorskip("ovito.io")
    folder = write_run(tmp_path / "run", dim)
    (path,), _ = export_run(folder, folder / "gsd", "gsd")
    particles = ovito.import_file(str(path)).compute(2).particles
    assert "Radius" not in particles and "Orientation" in particles and particles.count == 9
    for kind in particles.particle_types.types:
        round_grain = "shape 1" in kind.name
        assert (kind.mesh is None) == round_grain and (0.4 < kind.radius < 0.6 if round_grain else kind.radius == 1.0)
