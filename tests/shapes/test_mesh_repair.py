"""Closed bodies from flawed triangles: unit, origin, seams, doubles and winding do not matter; holes do."""

import numpy as np
import pytest
import trimesh

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import from_mesh
from taichi_lsm.shapes.geometry import even_directions
from taichi_lsm.shapes.mesh_repair import mended
from tests.helpers.bodies import BODIES, soup

UNITS = (1.0, 1e-3, 2e-5, 5e-6, 1e-6)  # m


def repaired(vertices, triangles):
    """Vertices, triangles, volume and repairs of the one shell."""
    found = mended("mesh", np.asarray(vertices), np.asarray(triangles))
    (shell,) = found.shells
    solid = trimesh.Trimesh(*shell, process=False)
    assert solid.is_watertight and solid.is_winding_consistent
    return len(shell.vertices), len(shell.triangles), solid.volume * found.size**3, found.repairs


@pytest.mark.parametrize("name", BODIES)
def test_a_body_is_the_same_grain_in_any_unit_and_at_any_place(name):
    mesh = BODIES[name]
    n = even_directions(300)
    shape, misfit, placement = from_mesh(mesh, 8)
    for unit, shift in [*((unit, 0.0) for unit in UNITS), (1.0, 1e4), (1e-6, 1e-2)]:
        x = unit * np.asarray(mesh.vertices) + shift * np.array([1.0, -0.7, 0.4])
        other, again, there = from_mesh(trimesh.Trimesh(x, mesh.faces, process=False), 8)
        rounding = 1e-9 if shift == 0.0 else 1e-6
        assert other.face_count == shape.face_count
        assert np.abs(other.support(n) - shape.support(n)).max() < rounding
        assert again[:4] == pytest.approx(misfit[:4], abs=rounding) and again.repairs == ()
        assert there.diameter == pytest.approx(unit * placement.diameter, rel=rounding)
        moved = (there.centre - shift * np.array([1.0, -0.7, 0.4])) / unit
        assert moved == pytest.approx(placement.centre, abs=10 * rounding)


def test_a_mirrored_body_is_the_mirrored_grain():
    mesh = BODIES["stone"]
    mirror = np.array([-1.0, 1.0, 1.0])
    inside_out = trimesh.Trimesh(mesh.vertices * mirror, mesh.faces, process=False)
    vertices, triangles, volume, repairs = repaired(inside_out.vertices, inside_out.faces)
    assert volume == pytest.approx(mesh.volume) and repairs == ("1 body that was inside out turned",)
    assert (vertices, triangles) == (len(mesh.vertices), len(mesh.faces))


def test_triangles_of_no_area_and_doubled_ones_are_left_out():
    x, t = soup(BODIES["brick"])
    a, b, c = t[3]
    middle = len(x)
    x = np.concatenate([x, [0.5 * (x[a] + x[b]), [1e9, 0.0, 0.0]]])  # the last vertex belongs to no triangle
    flaws = [(a, a, b), (a, b, middle), (a, b, c), (b, c, a)]
    vertices, triangles, volume, repairs = repaired(x, np.concatenate([t, flaws]))
    assert (vertices, triangles) == (8, 12) and volume == pytest.approx(6.0)
    assert repairs == ("2 triangles without area left out", "2 doubled triangles left out")


def test_a_fin_is_no_part_of_the_surface():
    """A triangle that stands out with both sides."""
    x, t = soup(BODIES["brick"])
    fin = [[0.5, 1.0, 1.5], [0.5, -1.0, 1.5], [0.5, 0.0, 4.0]]
    last = len(x) + np.arange(3)
    vertices, triangles, volume, repairs = repaired(np.concatenate([x, fin]), [*t, last, last[::-1]])
    assert (vertices, triangles) == (8, 12) and volume == pytest.approx(6.0)
    assert repairs == ("2 doubled triangles left out",)


@pytest.mark.parametrize("count", [1, 7, 200])
def test_triangles_of_the_wrong_winding_are_turned_and_counted(count):
    mesh = BODIES["sphere"]
    t = np.array(mesh.faces)
    wrong = np.random.default_rng(1).choice(len(t), count, replace=False)
    t[wrong] = t[wrong][:, ::-1]
    _, _, volume, repairs = repaired(mesh.vertices, t)
    assert volume == pytest.approx(mesh.volume)
    assert repairs == (f"{count} triangle{'s' if count > 1 else ''} turned over",)


def test_a_surface_of_one_side_is_refused_with_the_number_of_its_triangles():
    """The projective plane: an icosahedron whose opposite points are one."""
    ball = trimesh.creation.icosahedron()
    opposite = np.argmin(ball.vertices @ ball.vertices.T, axis=1)
    t = np.unique(np.sort(np.minimum(np.arange(12), opposite)[ball.faces], axis=1), axis=0)
    assert len(t) == 10
    with pytest.raises(InputError, match="10 triangles cannot be turned so that neighbours agree"):
        mended("mesh", np.random.default_rng(3).normal(size=(12, 3)), t)


def test_narrow_gaps_are_closed_and_wide_ones_refused_with_their_edges():
    x, t = soup(BODIES["stone"])
    noise = np.random.default_rng(4).uniform(-1.0, 1.0, x.shape)
    vertices, _, volume, repairs = repaired(x + 2e-6 * noise, t)
    assert vertices == len(BODIES["stone"].vertices) and volume == pytest.approx(BODIES["stone"].volume, rel=1e-4)
    assert len(repairs) == 1 and "gaps of up to" in repairs[0]
    with pytest.raises(InputError, match=f"mesh: has holes .*: {len(t) * 3} edges of a single triangle"):
        mended("mesh", x + 1e-2 * noise, t)
    with pytest.raises(InputError, match="3 edges of a single triangle;"):
        mended("mesh", x, t[1:])


@pytest.mark.parametrize(("shift", "edges"), [([1.0, 2.0, 0.0], "1 edge"), ([1.0, 0.0, 0.0], "4 edges")])
def test_bodies_that_share_edges_or_faces_are_refused_by_them(shift, edges):
    one, other = BODIES["brick"], BODIES["brick"].copy()
    other.apply_translation(shift)
    with pytest.raises(InputError, match=f"{edges} of more than two triangles, where bodies touch"):
        mended("mesh", *soup(trimesh.util.concatenate([one, other])))


def test_what_has_no_size_or_no_volume_is_refused():
    x, t = soup(BODIES["brick"])
    for factor in ([1.0, 1.0, 0.0], [0.0, 0.0, 0.0]):
        with pytest.raises(InputError, match="volume 0, must be above 0"):
            mended("mesh", x * factor, t)
    for value in (np.nan, np.inf, 1.7e308):
        y = x.copy()
        y[5] = value
        y[7] = -value
        with pytest.raises(InputError, match="must have finite vertices"):
            mended("mesh", y, t)
