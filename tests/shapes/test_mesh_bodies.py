"""Several bodies in one mesh: split, chosen, or refused if they overlap or nest."""

import numpy as np
import pytest
import trimesh

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import bodies_of_mesh, from_mesh
from tests.helpers.bodies import BODIES

pytest.importorskip("manifold3d")


def beside(*placed):
    """One mesh of (mesh, factor, shift)."""
    parts = []
    for mesh, factor, shift in placed:
        part = mesh.copy()
        part.apply_scale(factor)
        part.apply_translation(shift)
        parts.append(part)
    return trimesh.util.concatenate(parts)


def test_bodies_are_split_the_largest_first(tmp_path):
    brick, stone = BODIES["brick"], BODIES["stone"]
    path = tmp_path / "two.stl"
    beside((stone, 1e-3, [0.0, 0.0, 0.0]), (brick, 1e-3, [2e-3, 0.0, 0.0])).export(path)
    found = bodies_of_mesh(path)
    assert [b.volume for b in found] == pytest.approx([6e-9, 1e-9 * stone.volume], rel=1e-5)
    with pytest.raises(InputError, match=r"two\.stl: holds 2 bodies; body=0 takes the largest, body=1 the smallest"):
        from_mesh(path)
    for number, body in enumerate(found):
        one, other = from_mesh(path, 12, body=number), from_mesh(body, 12)
        assert one.placement.diameter == pytest.approx(other.placement.diameter, rel=1e-12)
        assert one.placement.centre == pytest.approx(other.placement.centre, abs=1e-12)
    for number in (2, -1, 0.5):
        with pytest.raises(InputError, match=f"body = {number}: must be a number from 0 to 1"):
            from_mesh(path, body=number)


def test_bodies_that_overlap_or_nest_are_named():
    brick = BODIES["brick"]
    bar = trimesh.creation.box((9.0, 0.2, 0.2))  # through the brick, with no vertex of either in the other
    for other, shift, words in (
        (bar, [0.0, 0.0, 0.0], "bodies 0 and 1 overlap"),
        (brick, [0.5, 0.0, 0.0], "bodies 0 and 1 overlap"),
        (BODIES["sphere"], [0.1, 0.0, 0.0], "bodies 0 and 1 overlap"),
    ):
        mesh = beside((brick, 1.0, [0.0, 0.0, 0.0]), (other, 1.0, shift), (brick, 0.1, [50.0, 0.0, 0.0]))
        for read in (bodies_of_mesh, from_mesh):
            with pytest.raises(InputError, match=words):
                read(mesh)
    nested = beside((brick, 1.0, [0.0, 0.0, 0.0]), (BODIES["sphere"], 0.3, [0.1, 0.0, 0.0]))
    with pytest.raises(InputError, match="body 1 lies within body 0"):
        bodies_of_mesh(nested)
    assert from_mesh(nested, 6, body=0).placement.diameter == pytest.approx((36.0 / np.pi) ** (1 / 3))


def test_bodies_that_touch_do_not_overlap():
    brick = BODIES["brick"]
    found = bodies_of_mesh(beside((brick, 1.0, [0.0, 0.0, 0.0]), (brick, 1.0, [1.0, 0.5, 0.3])))
    assert [b.volume for b in found] == pytest.approx([6.0, 6.0])


def test_too_many_bodies_are_refused():
    specks = np.arange(1001.0)[:, None, None] * [3.0, 0.0, 0.0] + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = trimesh.Trimesh(specks.reshape(-1, 3), (4 * np.arange(1001)[:, None, None] + faces).reshape(-1, 3))
    with pytest.raises(InputError, match="1001 bodies, must be at most 1000"):
        bodies_of_mesh(mesh)
