"""Pure contact geometry: the overlap of two patches, and which arc of a chain a normal direction belongs to."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.contact.primitives import cone_step, cone_violation, sphere_overlap
from taichi_lsm.core.runtime import ti

pytestmark = pytest.mark.usefixtures("runtime")


@ti.kernel
def overlaps(w: ti.template(), r: ti.template(), out: ti.template(), normal: ti.template()):
    for c in w:
        depth, n, at = sphere_overlap(w[c], r[c][0], r[c][1])
        out[c] = ti.Vector([depth, at])
        normal[c] = n


@ti.kernel
def sweep(u: ti.template(), seam: ti.template(), arcs: int, owners: ti.template(), out: ti.template()):
    """owners: arcs that hold direction c; out: step and distance from arc 0, and its violation."""
    for c in u:
        owners[c] = 0
        for i in range(arcs):
            step, _ = cone_step(u[c], seam[i], seam[(i + 1) % arcs])
            owners[c] += int(step == 0)
        step, distance = cone_step(u[c], seam[0], seam[1])
        out[c] = ti.Vector([float(step), distance, cone_violation(u[c], seam[0], seam[1])])


def vectors(values):
    field = ti.Vector.field(values.shape[1], ti.f64, len(values))
    field.from_numpy(values)
    return field


@pytest.mark.parametrize("dim", [2, 3])
def test_overlap_of_two_spheres(dim):
    rng = np.random.default_rng(dim)
    r = rng.uniform(0.1, 2.0, (1000, 2))
    w = rng.standard_normal((1000, dim))
    out, normal = vectors(np.zeros((1000, 2))), vectors(w)
    overlaps(vectors(w), vectors(r), out, normal)
    n = normal.to_numpy()
    depth, at = out.to_numpy().T
    length = np.linalg.norm(w, axis=1)
    assert n * length[:, None] == pytest.approx(w, rel=1e-14, abs=1e-15)
    surface_i, surface_j = r[:, 0], length - r[:, 1]  # along n from the first centre
    assert depth == pytest.approx(surface_i - surface_j, abs=1e-14)
    assert at == pytest.approx(0.5 * (surface_i + surface_j), abs=1e-14)


def classified(shape, angle):
    """(owners, step, distance, violation) of the directions at these angles, or of given unit vectors."""
    u = np.stack([np.cos(angle), np.sin(angle)], 1) if angle.ndim == 1 else angle
    owners, out = ti.field(ti.i32, len(u)), vectors(np.zeros((len(u), 3)))
    sweep(vectors(u), vectors(shape.seam), shape.patch_count, owners, out)
    return owners.to_numpy(), *out.to_numpy().T


@pytest.mark.parametrize("case", ["angular", "three arcs", "thirty arcs"])
def test_every_direction_belongs_to_exactly_one_arc(case):
    shape = {
        "angular": lambda: lsm.shapes.random_angular_shapes(1, 3)[0],
        "three arcs": lambda: lsm.shapes.regular_disc_of_arcs(3),
        "thirty arcs": lambda: lsm.shapes.regular_disc_of_arcs(30),
    }[case]()
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, 2000)
    assert np.all(classified(shape, angle)[0] == 1)
    at_seams = np.vstack([shape.seam, np.nextafter(shape.seam, 2.0), np.nextafter(shape.seam, -2.0)])
    assert np.all(classified(shape, at_seams)[0] == 1)


def test_step_points_to_the_nearer_seam():
    shape = lsm.shapes.random_angular_shapes(1, 3)[0]
    low, high = (np.arctan2(*shape.seam[i][::-1]) for i in (0, 1))
    width = (high - low) % (2 * np.pi)
    offset = np.random.default_rng(1).uniform(-np.pi, np.pi, 2000)  # from the middle of arc 0
    _, step, distance, violation = classified(shape, low + 0.5 * width + offset)
    beyond = np.abs(offset) - 0.5 * width
    inside = beyond < 0
    assert np.array_equal(step, np.where(inside, 0, np.sign(offset)))
    assert distance == pytest.approx(np.where(inside, 0, 1 - np.cos(beyond)), abs=1e-13)
    expected = np.where(inside, 0, np.where(np.abs(offset) < 0.5 * np.pi, np.sin(beyond), 2.0))
    assert violation == pytest.approx(expected, abs=1e-13)


def test_seam_belongs_to_the_arc_that_begins_there():
    shape = lsm.shapes.regular_disc_of_arcs(8)
    _, step, distance, _ = classified(shape, shape.seam)
    assert step[0] == 0 and step[1] == 1
    assert distance[1] == pytest.approx(0.0, abs=1e-15)
