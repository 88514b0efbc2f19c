"""Dense start states: no overlap between any outlines or with the platens, and few voids."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm import dense_start
from taichi_lsm.core.errors import InputError

PERIODS = {2: (9.0,), 3: (6.0, 4.5)}
COUNT = {2: 70, 3: 240}
SHAPES = {
    "disc": (2, lambda: [lsm.disc()]),
    "sphere": (3, lambda: [lsm.sphere()]),
    "polygon": (2, lambda: lsm.shapes.random_angular_shapes(3, 1, 0.05)),
    "polyhedron": (3, lambda: lsm.shapes.random_angular_polyhedra(2, 1, 0.05)),
}


def matrices(rotation):
    """Rotation matrices of angles or of quaternions w, x, y, z, by Rodrigues' formula."""
    if rotation.ndim == 1:
        c, s = np.cos(rotation), np.sin(rotation)
        return np.moveaxis(np.array([[c, -s], [s, c]]), 2, 0)
    w, u = rotation[:, 0, None, None], rotation[:, 1:]
    zero = np.zeros(len(u))
    cross = np.array([[zero, -u[:, 2], u[:, 1]], [u[:, 2], zero, -u[:, 0]], [-u[:, 1], u[:, 0], zero]]).transpose(
        2, 0, 1
    )
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def packed(kind, seed=3, solid=None):
    """Grains of a kind, their places, the platens in place, the height, and the share of the volume they fill."""
    dim, make = SHAPES[kind]
    shapes, lengths, rng = make(), PERIODS[dim], np.random.default_rng(seed)
    diameter = lsm.grain_diameters(rng, COUNT[dim], 0.8, 1.2)
    index = rng.integers(0, len(shapes), diameter.size)
    rotation = lsm.random_rotations(rng, diameter.size, dim)
    platens = [lsm.rough_platen(rng, 0.8, 1.2, lengths, dim) for _ in range(2)]
    for (position, size), side in zip(platens, (1, -1)):
        position[:, 1] -= (position[:, 1] + side * 0.5 * size).mean()
    filled = float((shapes[0].measure * diameter**dim).sum() / np.prod(lengths))
    height = filled / (solid or {"disc": 0.8, "sphere": 0.6, "polygon": 0.71, "polyhedron": 0.47}[kind])
    balls = [shape.spanning_balls() for shape in shapes]
    x, raised = lsm.dense_packing(rng, balls, index, diameter, rotation, lengths, tuple(platens), height)
    (low, low_size), (high, high_size) = platens
    everything = np.concatenate([x, low, high + raised * np.eye(dim)[1]])
    sizes = np.concatenate([diameter, low_size, high_size])
    return shapes, index, rotation, everything, sizes, raised, filled / raised


def gaps(shapes, index, rotation, x, sizes):
    """Gaps |r| - h_i(n) - h_j(-n) of all pairs of grains with a mobile one, h straight from the shapes."""
    n, dim = len(index), x.shape[1]
    i, j = np.triu_indices(len(x), 1)
    i, j = i[i < n], j[i < n]
    r = x[j] - x[i]
    for axis, length in zip((0, 2), PERIODS[dim]):
        r[:, axis] -= length * np.round(r[:, axis] / length)
    distance = np.linalg.norm(r, axis=1)
    near = distance < 1.7 * 0.5 * (sizes[i] + sizes[j])
    i, j, normal, distance = i[near], j[near], r[near] / distance[near, None], distance[near]
    rotate = matrices(rotation)

    def reach(k, direction):
        h = 0.5 * sizes[k]
        for kind, shape in enumerate(shapes):
            own = np.flatnonzero((k < n) & (index[np.minimum(k, n - 1)] == kind))
            body = np.einsum("kba,kb->ka", rotate[k[own]], direction[own])
            h[own] = sizes[k[own]] * shape.support(body)
        return h

    return distance - reach(i, normal) - reach(j, -normal)


@pytest.mark.parametrize("kind", SHAPES)
def test_a_dense_packing_has_no_overlap_and_few_voids(kind):
    shapes, index, rotation, x, sizes, height, solid = packed(kind)
    gap = gaps(shapes, index, rotation, x, sizes)
    # The hull of the balls of a polyhedron lies up to 0.005 below its surface, where an edge bulges.
    assert gap.min() > (-0.005 if kind == "polyhedron" else 0.0)
    assert np.sum(gap < 0.02) > len(index)  # grains are next to each other, not spread
    assert np.all((x[: len(index), 1] >= 0) & (x[: len(index), 1] <= height))
    # Random close packing of many equal frictionless grains is at 0.84 and 0.64; walls cost a part.
    assert solid > {"disc": 0.74, "sphere": 0.54, "polygon": 0.62, "polyhedron": 0.40}[kind]
    assert solid < {2: 0.84, 3: 0.64}[x.shape[1]]


def test_a_height_that_is_too_small_is_raised_and_no_other():
    crowded, roomy = (packed("disc", solid=solid) for solid in (1.3, 0.5))
    assert 0.74 < crowded[-1] < 0.84
    assert roomy[-1] == pytest.approx(0.5)
    assert gaps(*crowded[:5]).min() > 0 and gaps(*roomy[:5]).min() > 0


def test_no_grain_of_a_crowd_is_pushed_through_a_platen():
    _, index, _, x, _, height, _ = packed("disc", solid=2.2)
    assert np.all((x[: len(index), 1] >= 0) & (x[: len(index), 1] <= height))


def test_the_grains_are_in_no_order():
    _, index, _, x, sizes, height, _ = packed("disc")
    x, sizes = x[: len(index)], sizes[: len(index)]
    assert abs(np.corrcoef(sizes, x[:, 1])[0, 1]) < 4 / np.sqrt(len(x))
    quarters = np.histogram(x[:, 1], 4, (0, height))[0]
    assert quarters.min() > 0.6 * len(x) / 4


def test_the_generator_decides_a_dense_packing():
    one, same, other = (packed("disc", seed)[3] for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert one.shape != other.shape or not np.array_equal(one, other)


def test_dense_packing_refuses_what_it_cannot_pack(monkeypatch):
    with pytest.raises(InputError, match=r"height = -1\..*: must be finite and > 0"):
        packed("disc", solid=-6.0)
    monkeypatch.setattr(dense_start, "MOST_STRETCHES", 1)
    with pytest.raises(InputError, match=r"height = .*no packing without overlap"):
        packed("disc", solid=1.3)
