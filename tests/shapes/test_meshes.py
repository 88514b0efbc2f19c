"""Grains from meshes: what the misfit says is true, and unit, position and orientation of a mesh do not matter."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import from_mesh

ROTATION = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()


def stone():
    """An irregular convex body with a broken-off, flat end."""
    points = np.random.default_rng(2).normal(size=(40, 3))
    points *= np.array([1.0, 0.8, 0.6]) / np.linalg.norm(points, axis=1, keepdims=True)
    points[:, 0] = np.minimum(points[:, 0], 0.7)
    return trimesh.convex.convex_hull(points)


def moved(mesh, factor, shift):
    return trimesh.Trimesh(factor * mesh.vertices @ ROTATION.T + shift, mesh.faces)


@pytest.mark.validate
def test_unit_position_and_orientation_of_a_mesh_do_not_matter():
    mesh = stone()
    shape, misfit, _ = from_mesh(mesh, 60, 0.05)
    other, again, _ = from_mesh(moved(mesh, 1e-3, [5.0, -2.0, 1.0]), 60, 0.05)
    assert shape.face_count == other.face_count
    assert np.sort(shape.inertia) == pytest.approx(np.sort(other.inertia), rel=1e-4)
    assert misfit.rms_distance == pytest.approx(again.rms_distance, rel=0.05)  # seen along other directions
    assert abs(misfit.volume) < 0.01 and abs(again.volume) < 0.01
    assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)


def test_the_misfit_of_a_rounded_cube_follows_its_corner_radius():
    """A corner rounded with r recedes by (sqrt 3 - 1) r, which is the greatest distance; flat faces bulge by little."""
    cube = trimesh.creation.box()
    diameter = (6 / np.pi) ** (1 / 3)
    for corner_radius in (0.03, 0.08):
        shape, misfit, _ = from_mesh(cube, corner_radius=corner_radius)
        r = corner_radius * diameter
        rounded = (1 - 2 * r) ** 3 + 6 * r * (1 - 2 * r) ** 2 + 3 * np.pi * r**2 * (1 - 2 * r) + 4 / 3 * np.pi * r**3
        # The fit is widened until it has the volume of the cube, by the cube root of what rounding takes away.
        widened = rounded ** (-1 / 3)
        recedes = np.sqrt(0.75) - widened * (np.sqrt(0.75) - (np.sqrt(3) - 1) * r)
        assert misfit.greatest_distance * diameter == pytest.approx(recedes, abs=0.006)
        assert shape.face_count == 6
        assert shape.overlap_limit == pytest.approx(corner_radius, rel=1e-3)


def test_more_faces_fit_a_ball_better():
    ball = trimesh.creation.icosphere(subdivisions=3)
    few, many = (from_mesh(ball, faces)[1] for faces in (12, 40))
    assert many.rms_distance < 0.5 * few.rms_distance
    assert many.greatest_distance < 0.5 * few.greatest_distance


def test_a_mesh_turned_inside_out_is_the_same_body():
    mesh = trimesh.creation.box((1.0, 2.0, 3.0))
    inside_out = trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)
    assert inside_out.volume < 0
    a, b = from_mesh(mesh)[0], from_mesh(inside_out)[0]
    assert np.sort(a.inertia) == pytest.approx(np.sort(b.inertia), rel=1e-9)


def test_the_hull_of_a_body_that_is_not_convex_must_be_asked_for_and_its_misfit_is_to_the_body():
    outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]  # an L of area 3, its hull of area 3.5
    ends = np.array([(x, y, z) for z in (0, 1) for x, y in outline], dtype=float)
    caps = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4)]
    walls = [t for i in range(6) for t in ((i, (i + 1) % 6, 6 + i), ((i + 1) % 6, 6 + (i + 1) % 6, 6 + i))]
    bent = trimesh.Trimesh(ends, [*caps, *[(6 + a, 6 + c, 6 + b) for a, b, c in caps], *walls])
    assert bent.volume == pytest.approx(3.0)
    with pytest.raises(InputError, match=r"not convex.*16.7 %.*hull=True"):
        from_mesh(bent)
    _, misfit, _ = from_mesh(bent, hull=True)
    assert misfit.volume == pytest.approx(1 / 6, abs=0.03)


def test_an_empty_file_and_too_few_triangles_are_refused(tmp_path):
    empty = tmp_path / "empty.ply"
    empty.write_bytes(b"")
    with pytest.raises(InputError, match=r"empty.ply"):
        from_mesh(empty)
    with pytest.raises(InputError, match="3 triangles, must be at least 4"):
        from_mesh(trimesh.Trimesh(np.eye(4, 3), [(0, 1, 2), (0, 1, 3), (0, 2, 3)]))
    for faces in (3, 301):
        with pytest.raises(InputError, match=f"faces = {faces}"):
            from_mesh(trimesh.creation.box(), faces)
    for corner_radius in (0.0, 0.3, np.nan):
        with pytest.raises(InputError, match="corner_radius = "):
            from_mesh(trimesh.creation.box(), corner_radius=corner_radius)


def bodies():
    rng = np.random.default_rng(5)
    p = rng.normal(size=(40, 3))
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    return {
        "sphere": trimesh.creation.icosphere(subdivisions=3),
        "cube": trimesh.creation.box(),
        "stone": trimesh.convex.convex_hull(p * [1.0, 0.8, 0.6]),
    }


@pytest.mark.parametrize(
    ("name", "kind"), [("sphere", "stl"), ("cube", "stl"), ("stone", "stl"), ("cube", "ply"), ("cube", "obj")]
)
def test_a_mesh_comes_back_as_a_grain_of_its_volume(tmp_path, name, kind):
    path = tmp_path / f"body.{kind}"
    bodies()[name].export(path)
    shape, misfit, _ = from_mesh(path, 60)
    assert abs(misfit.volume) < 0.01 and misfit.inertia < 0.01
    assert misfit.rms_distance <= misfit.greatest_distance < 0.03
    assert shape.face_count == {"sphere": 60, "cube": 6, "stone": shape.face_count}[name] <= 60


def test_bad_meshes_get_a_clear_answer(tmp_path):
    with pytest.raises(InputError, match="mesh = 3: must be a file"):
        from_mesh(3)
    box = trimesh.creation.box()
    holed = trimesh.Trimesh(box.vertices, box.faces[:-1])
    flat = trimesh.Trimesh(box.vertices * [1, 1, 0], box.faces, process=False)
    broken = trimesh.Trimesh(np.where(box.vertices > 0, np.nan, box.vertices), box.faces, process=False)
    ring = trimesh.creation.torus(1.0, 0.3)
    many = trimesh.Trimesh(box.vertices, np.tile(box.faces, (90_000, 1)), process=False)
    for mesh, words in (
        (holed, "holes"),
        (flat, "holes|volume"),
        (broken, "finite|triangles"),
        (ring, "not convex"),
        (many, "1080000 triangles"),
        (tmp_path / "none.stl", "no such file"),
    ):
        with pytest.raises(InputError, match=words):
            from_mesh(mesh)
    text = tmp_path / "text.stl"
    text.write_text("no mesh at all")
    with pytest.raises(InputError, match=r"text.stl"):
        from_mesh(text)


def test_only_meshes_are_read_and_no_file_that_they_name(tmp_path, monkeypatch):
    path = tmp_path / "scene.gltf"
    path.write_text('{"buffers": [{"uri": "../secret"}]}')
    with pytest.raises(InputError, match=r"scene\.gltf: 35 bytes of format gltf, must be at most .* of stl, ply, obj"):
        from_mesh(path)
    path = tmp_path / "box.obj"
    trimesh.creation.box().export(path)
    path.write_text(f"mtllib secret.mtl\n{path.read_text()}")
    (tmp_path / "secret.mtl").write_text("newmtl a\n")
    opened = []
    monkeypatch.setattr(trimesh.resolvers.FilePathResolver, "get", lambda self, name: opened.append(name))
    from_mesh(path, 6)
    assert opened == []
