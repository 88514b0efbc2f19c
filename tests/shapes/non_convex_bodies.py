"""Outlines and closed meshes that are not convex, for tests of grains made of convex parts."""

import numpy as np
import shapely
import trimesh

L_CORNERS = [(0, 0), (2.2, 0), (2.2, 0.8), (0.8, 0.8), (0.8, 2.5), (0, 2.5)]
HALF_TURN = np.linspace(0.0, np.pi, 40)


def cross_outline(arm=1.5, half=0.5):
    corner = np.array([(half, half), (half, arm), (-half, arm)])
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = [corner @ np.linalg.matrix_power(quarter, k).T for k in range(4)]
    return np.concatenate(turned)


def horseshoe_outline():
    outer = np.stack([np.cos(HALF_TURN), np.sin(HALF_TURN)], axis=1)
    legs = np.array([(-1.0, -0.7), (-0.55, -0.7)]), np.array([(0.55, -0.7), (1.0, -0.7)])
    return np.concatenate([outer, legs[0], 0.55 * outer[::-1], legs[1]])


def bone_outline():
    lobes = [shapely.Point(x, y).buffer(0.45, quad_segs=16) for x in (-1, 1) for y in (-0.3, 0.3)]
    body = shapely.union_all([*lobes, shapely.box(-1, -0.25, 1, 0.25)])
    return shapely.get_coordinates(body.exterior)[:-1]


def prism(corners, height):
    """The mesh of a polygon (k, 2) drawn out by a height."""
    polygon = shapely.orient_polygons(shapely.Polygon(corners))
    x = shapely.get_coordinates(polygon.exterior)[:-1]
    triangles = shapely.get_parts(shapely.orient_polygons(shapely.constrained_delaunay_triangles(polygon)))
    row = {tuple(np.round(p, 9)): k for k, p in enumerate(x)}
    cap = np.array([[row[tuple(np.round(p, 9))] for p in shapely.get_coordinates(t)[:-1]] for t in triangles])
    i, n = np.arange(len(x)), len(x)
    j = (i + 1) % n
    walls = np.concatenate([np.stack([i, j, j + n], axis=1), np.stack([i, j + n, i + n], axis=1)])
    points = np.concatenate([np.column_stack([x, np.full(n, z)]) for z in (0.0, height)])
    return trimesh.Trimesh(points, np.concatenate([cap[:, ::-1], cap + n, walls]))


def bone_mesh():
    """A body of revolution with two heads."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    x = ball.vertices[:, 0]
    radius = 0.35 + 0.63 * np.abs(x) ** 3
    round_end = np.sqrt(np.maximum(0.0, 1.0 - np.maximum(0.0, (np.abs(x) - 0.75) / 0.25) ** 2))
    across = ball.vertices[:, 1:] / np.sqrt(np.maximum(1e-12, 1.0 - x**2))[:, None]
    return trimesh.Trimesh(np.column_stack([1.3 * x, across * (radius * round_end)[:, None]]), ball.faces)


def scan_mesh(seed, hollows=3):
    """A stone: smooth noise on a sphere, with hollows."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=4)
    height = np.ones(len(ball.vertices))
    for _ in range(5):
        wave = rng.normal(size=3)
        height += 0.08 * np.cos(ball.vertices @ (2.5 * wave / np.linalg.norm(wave)) + rng.uniform(0.0, 2.0 * np.pi))
    for _ in range(hollows):
        towards = rng.normal(size=3)
        height -= 0.35 * np.exp((ball.vertices @ towards / np.linalg.norm(towards) - 1.0) / 0.12)
    return trimesh.Trimesh(ball.vertices * height[:, None] * [1.15, 1.0, 0.9], ball.faces)
