"""Outlines, meshes, cores and clumps that are made of the patches of a shape alone."""

from functools import cache, partial

import numpy as np
import pytest
import shapely
import trimesh

import taichi_lsm as lsm
from taichi_lsm.shapes import PatchSurface, ball_polyhedron, clump, from_chain, patch_surface, place_part
from taichi_lsm.shapes.geometry import even_directions, unit_normals
from taichi_lsm.shapes.patch_meshes import mesh_of
from taichi_lsm.shapes.patch_outlines import outline_of
from taichi_lsm.shapes.patch_surfaces import Body, bodies_of
from taichi_lsm.shapes.rounded_cores import BARE, CORE_SAG, MOST_BALLS, PROUD

BAR = np.array([(9, 0, 0), (-9, 0, 0), (0, 8, 0), (0, -8, 0), (0, 0, 9), (0, 0, -9)], float)  # 2 x 4 x 2
RADIUS, EDGE = np.full(6, 10.0), 0.01


def pair_of_discs():
    """Two unit discs whose centres are 1 apart, and the area of their union."""
    lens = 2.0 * np.pi / 3.0 - np.sqrt(0.75)
    return clump([(0, 0), (1, 0)], [1.0, 1.0], normalise=False), 2.0 * np.pi - lens


def pair_of_balls():
    """The same with unit balls: the lens is pi (4 + d) (2 - d)^2/12."""
    return clump([(0, 0, 0), (1, 0, 0)], [1.0, 1.0], normalise=False), 8.0 / 3.0 * np.pi - 5.0 * np.pi / 12.0


def joined(parts):
    """The surface of a grain of several parts."""
    of_parts = [patch_surface(part)._replace(part=np.full(part.patch_count, k)) for k, part in enumerate(parts)]
    return PatchSurface(*(np.concatenate(column) for column in zip(*of_parts, strict=True)))


def ring_of_bars():
    """Six bars round a hole."""
    bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.1, normalise=False)
    ring = [place_part(bar, 2.0 * unit_normals(a), a + 0.5 * np.pi) for a in np.pi / 3 * np.arange(6)]
    body = shapely.union_all([shapely.Polygon(part.outline(2000)) for part in ring])
    assert len(body.interiors) == 1
    return joined(ring), body.area


def crossed_solids():
    """Two bars at a right angle, and their volume: both less what they share, which is the part of all balls."""
    other = BAR[:, [1, 0, 2]]
    solid, across = (ball_polyhedron(p, RADIUS, EDGE, normalise=False) for p in (BAR, other))
    shared = ball_polyhedron(np.concatenate([BAR, other]), np.tile(RADIUS, 2), EDGE, normalise=False)
    return joined([solid, across]), 2.0 * solid.measure - shared.measure


def surface_of(grain):
    return grain if isinstance(grain, PatchSurface) else patch_surface(grain)


def of_measure(shape):
    return shape, shape.measure


# A lens has no vertex that would tell the radius of its edge; two caps are cut off the last one, and no vertex is left.
LENS = ball_polyhedron([(0, 0, 0.5), (0, 0, -0.5)], [1.0, 1.0], 0.05)
CAPPED = ball_polyhedron([(0, 0, 0), (0, 0, 5), (5, 0, 0)], [1.0, 5.5, 5.5], 0.05)
HALVES = lsm.shapes.from_patches([(0, 0, 0)] * 2, [0.5] * 2, [(0, 0, 1), (0, 0, -1)], [np.pi / 2] * 2)
PLANE = {
    "disc": lambda: of_measure(lsm.disc()),
    "pentagon": lambda: of_measure(lsm.shapes.regular_polygon(5)),
    "ellipse": lambda: of_measure(lsm.shapes.ellipse(5.0)),
    "cross": lambda: of_measure(lsm.shapes.crossed_bars()),
    "ring": ring_of_bars,
    "cones": lambda: of_measure(from_chain(lsm.shapes.regular_polygon(5), 0.01)),
    "pair": pair_of_discs,
    "apart": lambda: (clump([(0, 0), (3, 0)], [1.0, 1.0], normalise=False), 2.0 * np.pi),
}
CONVEX = {
    "sphere": lsm.sphere(),
    "tetrahedron": lsm.shapes.regular_polyhedron(4),
    "cube": lsm.shapes.regular_polyhedron(6, 0.3),
    "lens": LENS,
    "capped": CAPPED,
}
SOLID = {name: partial(of_measure, shape) for name, shape in CONVEX.items()}
SOLID |= {"halves": lambda: (HALVES, np.pi / 6), "pair": pair_of_balls, "bars": crossed_solids}


@cache
def outline(name):
    shape, area = PLANE[name]()
    return shape, area, outline_of(surface_of(shape))


@cache
def mesh(name):
    shape, volume = SOLID[name]()
    return shape, volume, mesh_of(surface_of(shape))


def area_of(x):
    y = np.roll(x, -1, axis=0)
    return 0.5 * np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])


@pytest.mark.parametrize("name", PLANE)
def test_an_outline_has_the_area_of_its_grain(name):
    """Counter-clockwise; holes count against it, and pieces together."""
    _, area, x = outline(name)
    assert area_of(x) == pytest.approx(area, rel=1e-3)


@pytest.mark.parametrize("name", ["disc", "pentagon", "ellipse"])
def test_vertices_lie_on_the_outline(name):
    """Of a convex grain min over n of h(n) - x . n is the distance to the surface."""
    shape, _, x = outline(name)
    n = unit_normals(np.linspace(0.0, 2.0 * np.pi, 20001))
    assert np.abs((shape.support(n) - x @ n.T).min(axis=1)).max() < 1e-7


def test_seams_of_a_chain_are_vertices_and_none_is_there_twice():
    shape, _, x = outline("pentagon")
    seams = shape.centre + shape.radius[:, None] * shape.seam
    assert np.linalg.norm(x[:, None] - seams, axis=2).min(axis=0).max() < 1e-12
    assert np.linalg.norm(np.roll(x, -1, axis=0) - x, axis=1).min() > 1e-3


@pytest.mark.parametrize("name", SOLID)
def test_a_mesh_has_the_volume_of_its_grain_and_is_closed(name):
    _, volume, found = mesh(name)
    solid = trimesh.Trimesh(*found, process=False)
    assert solid.is_watertight and solid.volume == pytest.approx(volume, rel=1e-3)
    assert found.volume == pytest.approx(solid.volume, rel=1e-12)


@pytest.mark.parametrize("name", CONVEX)
def test_a_mesh_is_hardly_off_the_surface(name):
    shape, _, found = mesh(name)
    n = even_directions(3000)
    off = np.abs((found.vertices @ n.T).max(axis=0) - shape.support(n)).max()
    assert off < 4e-3


@pytest.mark.parametrize("name", [*CONVEX, "pentagon"])
def test_a_core_dilated_by_its_radius_is_the_grain(name):
    shape = CONVEX[name] if name in CONVEX else outline(name)[0]
    core, radius = lsm.shapes.rounded_core(patch_surface(shape))
    n = even_directions(3000) if shape.dim == 3 else unit_normals(np.linspace(0.0, 2.0 * np.pi, 1001))
    off = np.abs((core @ n.T).max(axis=0) + radius - shape.support(n)).max()
    assert off < CORE_SAG
    assert len(core) == 1 if name == "sphere" else radius <= shape.overlap_limit * (1 + 1e-9)


def test_what_is_no_dilated_core_has_none():
    for name in ("cross", "cones", "pair"):
        assert lsm.shapes.rounded_core(patch_surface(outline(name)[0])) is None


@pytest.mark.parametrize("name", ["pentagon", "ellipse", "cross", "ring"])
def test_inscribed_balls_fill_the_grain(name):
    shape, area, x = outline(name)
    centre, radius = lsm.shapes.inscribed_balls(surface_of(shape))
    assert 4 < len(radius) < MOST_BALLS
    size = 2.0 * np.linalg.norm(x - x.mean(axis=0), axis=1).mean()
    body = shapely.union_all(shapely.buffer(shapely.points(centre), radius, quad_segs=64))
    grain = shapely.Polygon(x).buffer(0.0)
    assert shapely.hausdorff_distance(body.union(grain), grain) < 1.5 * PROUD * size
    bare = shapely.distance(shapely.points(x), body).max()
    assert bare < BARE * size and body.area == pytest.approx(area, rel=0.04)


def test_inscribed_balls_of_a_solid_are_in_it():
    shape = lsm.shapes.regular_polyhedron(4)
    centre, radius = lsm.shapes.inscribed_balls(surface_of(shape))
    n = even_directions(3000)
    out = ((centre @ n.T + radius[:, None]).max(axis=0) - shape.support(n)).max()
    assert len(radius) <= MOST_BALLS and out < 2.0 * PROUD
    inside = np.min([np.linalg.norm(np.zeros(3) - c) - r for c, r in zip(centre, radius, strict=True)])
    assert inside < 0.0  # the middle is filled


def test_a_clump_is_its_own_balls():
    shape, _ = pair_of_balls()
    centre, radius = lsm.shapes.inscribed_balls(surface_of(shape))
    assert np.array_equal(centre, shape.centre) and np.array_equal(radius, shape.radius)


def test_bodies_are_told_by_their_patches():
    kinds = {name: [body for body, _ in bodies_of(patch_surface(outline(name)[0]))] for name in ("cross", "cones")}
    assert kinds == {"cross": [Body.CHAIN] * 2, "cones": [Body.OPEN]}
    assert [body for body, _ in bodies_of(mesh("bars")[0])] == [Body.POLYHEDRON] * 2
