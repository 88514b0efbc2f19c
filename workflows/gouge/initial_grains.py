"""The mobile grains of a gouge layer before consolidation: loose, whole or breakable."""

import numpy as np

import taichi_lsm as lsm

AGGREGATES = 24  # different breakable grains in a layer, at most
SHAPES = {2: 200, 3: 60}  # different angular shapes in a layer, at most


def loose_grains(p, rng, count, lengths, shapes):
    """(shapes, row of each grain, places, diameters, orientations, upper border, no bonds) of a loose packing."""
    if p.shape == "angular":
        angular = lsm.random_angular_shapes if p.dim == 2 else lsm.random_angular_polyhedra
        shapes = shapes + angular(min(count, SHAPES[p.dim]), p.seed, p.corner_radius)
    scale = lsm.grain_diameters(rng, count, p.smallest_diameter, p.largest_diameter)
    shape = rng.integers(1, len(shapes), count) if p.shape == "angular" else np.zeros(count, int)
    reach = np.array([s.bounding_radius for s in shapes])[shape] * scale
    loose = lsm.loose_packing(rng, reach, lengths, p.dim)
    turns = lsm.random_rotations(rng, count, p.dim)
    return shapes, shape, loose, scale, turns, (loose[:, 1] + reach).max(), None


def breakable_grains(p, rng, count, lengths, shapes):
    """As `loose_grains`, of the pieces of `count` breakable grains (2D), with the bonds between them."""
    whole = [lsm.angular_aggregate(p.pieces, [p.seed, i], p.corner_radius) for i in range(min(count, AGGREGATES))]
    size = lsm.grain_diameters(rng, count, p.smallest_diameter, p.largest_diameter)
    kind = rng.integers(0, len(whole), count)
    reach = np.array([grain.reach for grain in whole])[kind] * size
    middle = lsm.loose_packing(rng, reach, lengths, p.dim)
    turns = lsm.random_rotations(rng, count, p.dim)
    c, s = np.cos(turns), np.sin(turns)
    turn = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    arms = size[:, None, None] * np.array([grain.position for grain in whole])[kind]
    loose = middle[:, None] + np.einsum("nab,npb->npa", turn, arms)
    scale = size[:, None] * np.array([grain.diameter for grain in whole])[kind]
    shape = len(shapes) + kind[:, None] * p.pieces + np.arange(p.pieces)
    bonds = np.concatenate([whole[k].pairs + i * p.pieces for i, k in enumerate(kind)])
    shapes = shapes + [piece for grain in whole for piece in grain.shapes]
    turns, top = np.repeat(turns, p.pieces), (middle[:, 1] + reach).max()
    return shapes, shape.ravel(), loose.reshape(-1, 2), scale.ravel(), turns, top, bonds


def initial_orientations(turns, glued):
    """Orientations of the mobile grains as given, of the glued ones none, by the name that `Scene` uses."""
    if turns.ndim == 1:
        return {"angle": np.concatenate([turns, np.zeros(glued)])}
    return {"orientation": np.concatenate([turns, np.tile([1.0, 0.0, 0.0, 0.0], (glued, 1))])}
