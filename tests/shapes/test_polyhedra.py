"""Families of polyhedra, tiles of a volume, and grains from meshes."""

import numpy as np
import pytest
import trimesh

from taichi_lsm.shapes import (
    ellipsoid,
    from_mesh,
    laguerre_packing,
    random_angular_polyhedra,
    regular_polyhedron,
    superellipsoid,
)
from taichi_lsm.shapes.polyhedra import FLATNESS, random_polyhedra


@pytest.mark.parametrize(
    ("faces", "edges", "vertices"), [(4, 6, 4), (6, 12, 8), (8, 12, 6), (12, 30, 20), (20, 30, 12)]
)
def test_regular_polyhedra_have_the_features_of_plato(faces, edges, vertices):
    shape = regular_polyhedron(faces, 0.04)
    assert (shape.face_count, shape.edge_count, shape.vertex_count) == (faces, edges, vertices)
    assert shape.inertia == pytest.approx(np.full(3, shape.inertia[0]), rel=1e-6)
    assert shape.dilation == pytest.approx(0.04, abs=1e-10)


def test_an_ellipsoid_has_its_moments():
    shape = ellipsoid((1.0, 1.3, 1.7), 90, 0.02)
    a = np.array([1.0, 1.3, 1.7]) ** 2
    expected = np.sort([a[1] + a[2], a[0] + a[2], a[0] + a[1]])
    assert np.sort(shape.inertia) / shape.inertia.max() == pytest.approx(expected / expected.max(), rel=0.01)
    with pytest.raises(ValueError, match="exponent"):
        superellipsoid((1, 1, 1), 50.0)


def test_random_polyhedra_are_the_same_whatever_the_count():
    three, two = random_angular_polyhedra(3, 7), random_angular_polyhedra(2, 7)
    for a, b in zip(three, two):
        assert np.array_equal(a.feature_centre, b.feature_centre)
    for shape in three:
        assert shape.dilation == pytest.approx(0.05, abs=1e-9)
        assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)
        assert 10 <= shape.face_count <= 18
    with pytest.raises(ValueError, match="corner_radius"):
        random_angular_polyhedra(1, 7, corner_radius=0.6)


def aspect(shape):
    """Longest over shortest axis of the ellipsoid of equal moments."""
    second = shape.inertia.sum() / 2 - shape.inertia
    return np.sqrt(second.max() / second.min())


@pytest.mark.parametrize("elongation", [1.0, 3.0])
@pytest.mark.parametrize("angularity", [0.0, 1.0])
def test_random_polyhedra_are_as_long_as_asked(elongation, angularity):
    for shape in random_polyhedra(2, 4, 0.07, (12, 14), elongation, angularity):
        assert aspect(shape) == pytest.approx(elongation, rel=0.1)
        assert shape.dilation == pytest.approx(0.07, abs=1e-9)
        assert 12 <= shape.face_count <= 14
        assert shape.measure == pytest.approx(np.pi / 6, rel=1e-12)


def test_angularity_moves_the_curvature_of_faces_into_edges():
    n = np.random.default_rng(0).normal(size=(20_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    shares = []
    for angularity in (0.0, 0.5, 1.0):
        shape = random_polyhedra(1, 4, angularity=angularity)[0]
        shares.append(np.mean(shape.feature_of(n) < shape.face_count))
        largest = shape.feature_radius.max()
    assert shares[0] > 1.5 * shares[1] > 4 * shares[2]  # the part of all normals that belongs to faces
    assert largest > 0.8 * FLATNESS  # in equivalent diameters, which are nearly sizes here


def test_random_polyhedra_of_a_seed_do_not_depend_on_the_count():
    one, two = random_polyhedra(1, 5, faces=(8, 8)), random_polyhedra(2, 5, faces=(8, 8))
    assert np.array_equal(one[0].feature_centre, two[0].feature_centre) and one[0].name == two[0].name
    assert not np.array_equal(two[0].inertia, two[1].inertia)
    assert not np.array_equal(one[0].inertia, random_polyhedra(1, 6, faces=(8, 8))[0].inertia)


@pytest.mark.parametrize(
    "field, value",
    [
        ("count", -1),
        ("faces", (5, 9)),
        ("faces", (9, 8)),
        ("elongation", 0.9),
        ("elongation", np.nan),
        ("angularity", 1.1),
        ("corner_radius", 0.0),
        ("corner_radius", np.nan),
    ],
)
def test_random_polyhedra_refuse_what_is_out_of_range(field, value):
    with pytest.raises(ValueError, match=f"{field} = "):
        random_polyhedra(**{"count": 1, "seed": 1, field: value})


def test_tiles_of_a_volume_hold_their_grains_apart():
    from scipy.spatial.transform import Rotation

    shapes, position, diameter, turn = laguerre_packing(12, 2.0, 3, 0.06, 0.02)
    n = np.random.default_rng(0).normal(size=(400, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    frames = [Rotation.from_quat(q, scalar_first=True).as_matrix() for q in turn]
    gaps = []
    for k in range(12):
        for l in range(k + 1, 12):
            d = position[l] - position[k]
            d -= 2.0 * np.round(d / 2.0)
            near, width = n, 0.3
            for _ in range(8):  # the direction that separates the two best
                h = diameter[k] * shapes[k].support(near @ frames[k]) + diameter[l] * shapes[l].support(
                    -near @ frames[l]
                )
                best = near[np.argmax(near @ d - h)]
                gap = (near @ d - h).max()
                near = np.concatenate([best[None], best + width * n[:150]])
                near /= np.linalg.norm(near, axis=1, keepdims=True)
                width *= 0.4
            gaps.append(gap)
    assert min(gaps) > 0.0
    assert 0.6 < (np.pi / 6 * diameter**3).sum() / 8.0 < 1.0


def bodies():
    rng = np.random.default_rng(5)
    p = rng.normal(size=(40, 3))
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    return {
        "sphere": trimesh.creation.icosphere(subdivisions=3),
        "cube": trimesh.creation.box(),
        "stone": trimesh.convex.convex_hull(p * [1.0, 0.8, 0.6]),
    }


@pytest.mark.parametrize("name", ["sphere", "cube", "stone"])
@pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
def test_a_mesh_comes_back_as_a_grain_of_its_volume(tmp_path, name, kind):
    if kind != "stl" and name != "cube":
        pytest.skip("one body shows the readers")
    path = tmp_path / f"body.{kind}"
    bodies()[name].export(path)
    shape, misfit = from_mesh(path, 60)
    assert abs(misfit.volume) < 0.01 and misfit.inertia < 0.01
    assert misfit.rms_distance <= misfit.greatest_distance < 0.03
    assert shape.face_count == {"sphere": 60, "cube": 6, "stone": shape.face_count}[name] <= 60


def test_bad_meshes_get_a_clear_answer(tmp_path):
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
        with pytest.raises(ValueError, match=words):
            from_mesh(mesh)
    text = tmp_path / "text.stl"
    text.write_text("no mesh at all")
    with pytest.raises(ValueError, match="text.stl"):
        from_mesh(text)
