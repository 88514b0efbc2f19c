"""Centre, orientation and size of imported grains: a scene with them has the body of the file."""

import numpy as np
import pytest
import shapely
import trimesh
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import from_mesh, from_outline, place_part, union, union_and_placement
from taichi_lsm.shapes.geometry import even_directions
from tests.helpers.bodies import BODIES

N = even_directions(400)
TURNED = Rotation.from_rotvec([0.3, -0.8, 2.5])


def chipped():
    """The brick without a corner."""
    x = np.asarray(BODIES["brick"].vertices)
    corner = x.max(axis=0)
    cut = [corner - 0.5 * axis for axis in np.eye(3)]
    return trimesh.convex.convex_hull(np.concatenate([x[np.linalg.norm(x - corner, axis=1) > 0.1], cut]))


@pytest.mark.parametrize("mesh", [*BODIES.values(), chipped()], ids=[*BODIES, "chipped"])
def test_a_placed_grain_lies_on_its_mesh(mesh):
    x = 1e-3 * TURNED.apply(mesh.vertices) + [0.5, -0.2, 0.1]
    shape, misfit, placement = from_mesh(trimesh.Trimesh(x, mesh.faces, process=False), 20)
    part = place_part(shape, *placement)
    gap = part.support(N) - (x @ N.T).max(axis=0)
    off = misfit.greatest_distance + abs(misfit.volume)
    assert np.abs(gap).max() < 1.1 * off * placement.diameter < 0.2 * placement.diameter
    assert np.linalg.norm(placement.rotation) == pytest.approx(1.0)


def test_a_scene_has_mass_and_inertia_of_the_mesh():
    mesh = chipped()
    mesh.apply_transform(trimesh.transformations.compose_matrix(angles=(0.4, -1.0, 2.0), translate=(3.0, 1.0, 0.0)))
    shape, _, placement = from_mesh(mesh, 20, 0.01)
    scene = lsm.Scene(
        position=[placement.centre],
        orientation=[placement.rotation],
        diameter=[placement.diameter],
        shapes=[shape],
        density=2000.0,
        effects=[lsm.LinearElastic(1e6)],
    )
    (mass,), (moments,) = scene.masses()
    r = Rotation.from_quat(scene.orientation[0], scalar_first=True).as_matrix()
    assert mass == pytest.approx(2000.0 * mesh.volume)
    tensor = 2000.0 * mesh.moment_inertia
    assert r @ np.diag(moments) @ r.T == pytest.approx(tensor, abs=0.02 * np.trace(tensor))
    assert scene.position[0] == pytest.approx(mesh.center_mass, abs=0.01)


def test_a_brick_and_a_chipped_brick_come_out_alike():
    """Their body frames are those of ascending moments, 90 degrees apart; placed, both lie as in their files."""
    made = [from_mesh(mesh, 20) for mesh in (BODIES["brick"], chipped())]
    placed = [place_part(grain.shape, *grain.placement) for grain in made]
    one, other = (part.support(N[N[:, 2] < 0.0]) for part in placed)
    assert np.abs(one - other).max() < 0.1  # m, of a brick of 1 x 2 x 3 m


def test_a_placed_grain_lies_on_its_outline():
    points = 1e-3 * np.array([(0.0, 0.0), (3.0, 0.2), (3.3, 1.0), (0.4, 1.5)]) + [5.0, -2.0]
    shape, misfit, placement = from_outline(points, 0.05)
    body = shapely.Polygon(points)
    placed = shapely.Polygon(place_part(shape, *placement).outline(2000))
    assert placed.area == pytest.approx(body.area, rel=1e-5)
    hausdorff = shapely.hausdorff_distance(placed.exterior, body.exterior)
    assert hausdorff < (misfit.greatest_distance + abs(misfit.area)) * placement.diameter
    fitted = place_part(shape, placement.centre, 0.0, placement.diameter * (1.0 + misfit.area) ** 0.5)
    assert shapely.Polygon(fitted.outline(2000)).difference(body).area < 1e-5 * body.area  # the fit lies within


@pytest.mark.parametrize("dim", [2, 3])
def test_a_union_lies_where_its_parts_were(dim):
    if dim == 2:
        bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.1, normalise=False)
        parts = [place_part(bar, (7.0, 2.0), 0.4), place_part(bar, (8.0, 3.0), 2.0, 0.8)]
        n = N[:, :2] / np.linalg.norm(N[:, :2], axis=1, keepdims=True)
    else:
        brick = from_mesh(BODIES["brick"], 6).shape
        parts = [place_part(brick, (7.0, 2.0, 1.0), TURNED.as_matrix()), place_part(brick, (7.3, 2.2, 1.0), 0.0, 0.8)]
        n = N
    shape, placement = union_and_placement(parts)
    assert shape.measure == pytest.approx(union(parts).measure)
    back = [place_part(member, *placement) for member in shape.members]
    for part, again in zip(parts, back, strict=True):
        assert again.support(n) == pytest.approx(part.support(n), abs=1e-9)
    alone, where = union_and_placement(parts[:1])
    assert alone is parts[0] and place_part(alone, *where).support(n) == pytest.approx(alone.support(n), abs=1e-12)


def test_a_rotation_is_a_matrix_or_a_unit_quaternion():
    shape = from_mesh(BODIES["stone"], 6).shape
    one = place_part(shape, (0.0, 0.0, 0.0), TURNED.as_matrix())
    other = place_part(shape, (0.0, 0.0, 0.0), TURNED.as_quat(scalar_first=True))
    assert one.support(N) == pytest.approx(other.support(N), abs=1e-12)
    with pytest.raises(InputError, match="must be a unit quaternion"):
        place_part(shape, (0.0, 0.0, 0.0), np.array([1.0, 1.0, 0.0, 0.0]))
