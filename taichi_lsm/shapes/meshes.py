"""Grains from triangle meshes (STL, PLY, OBJ): a ball-polyhedron fitted to the mesh, and how far it is off."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .ball_cells import spread
from .ball_polyhedron import BallPolyhedron, placed_ball_polyhedron

MOST_TRIANGLES = 1_000_000
COPLANAR = np.radians(5.0)  # facets of the hull whose normals differ by less are one face
FLATTEST = 50.0  # radius of a face in sizes, for meshes with flat faces
SMALLEST_FACE = 1e-4  # of the surface: smaller facets are left to the rounding
FEW_MORE = 4  # faces of a mesh over those asked for: beyond it is a smooth body
HULL_VOLUME = 0.01  # part by which the hull may exceed a mesh that counts as convex


class Misfit(NamedTuple):
    """How far a fitted grain is from its mesh, before it is rescaled; lengths over equivalent diameter."""

    volume: float  # relative error of the volume
    greatest_distance: float  # between the surfaces, seen from the mesh along 4000 directions of support
    rms_distance: float
    inertia: float  # greatest relative error of a principal moment at equal volume


def from_mesh(
    mesh, faces: int = 60, corner_radius: float = 0.02, *, hull: bool = False
) -> tuple[BallPolyhedron, Misfit]:
    """A grain of equivalent diameter 1 with at most `faces` faces from a mesh file or trimesh.Trimesh, and its misfit.

    corner_radius: of edges and vertices, in equivalent diameters of the mesh. hull: take the convex hull of a mesh
    that is not convex; its misfit is then against the mesh itself.
    Raises ValueError if the file cannot be read, or the mesh has holes, no volume, values that are not numbers, more
    than a million triangles, or is not convex and `hull` was not asked for.
    """
    if not 4 <= faces <= 300:
        raise ValueError(f"faces = {faces}: must be from 4 to 300")
    if not 0 < corner_radius < 0.25:
        raise ValueError(f"corner_radius = {corner_radius}: must be above 0 and below 0.25")
    body = _checked(mesh)
    wrapped = body.convex_hull
    excess = wrapped.volume / body.volume - 1.0
    if excess > HULL_VOLUME and not hull:
        raise ValueError(f"mesh: not convex, its hull is {100 * excess:.3g} % larger; hull=True takes the hull")
    diameter = (6.0 * body.volume / np.pi) ** (1.0 / 3.0)
    vertices = wrapped.vertices - body.center_mass
    r = corner_radius * diameter
    fits = [_fit(wrapped, vertices, body, r, diameter, *target) for target in _targets(wrapped, vertices, faces)]
    fitted, misfit = min((f for f in fits if f), key=lambda fit: fit[1].rms_distance, default=(None, None))
    if fitted is None:
        raise ValueError(f"mesh: {faces} faces and corner_radius = {corner_radius} give no closed surface; change them")
    return fitted.rescaled((np.pi / 6.0 / fitted.measure) ** (1.0 / 3.0)), misfit


def _checked(mesh):
    import trimesh

    label = "mesh"
    if not isinstance(mesh, trimesh.Trimesh):
        path = Path(mesh)
        label = f"mesh {path}"
        if not path.is_file():
            raise ValueError(f"mesh {path}: no such file")
        try:
            mesh = trimesh.load_mesh(path)
        except Exception as error:  # the readers raise whatever they like
            raise ValueError(f"mesh {path}: cannot be read ({error})") from None
        if not isinstance(mesh, trimesh.Trimesh):
            raise ValueError(f"mesh {path}: holds no single triangle mesh")
    count = len(mesh.faces)
    if count > MOST_TRIANGLES:
        raise ValueError(f"{label}: {count} triangles, must be at most {MOST_TRIANGLES}; simplify it first")
    if count < 4 or not np.all(np.isfinite(mesh.vertices)):
        raise ValueError(f"{label}: {count} triangles, must be at least 4 with finite vertices")
    mesh = mesh.copy()
    mesh.merge_vertices()
    if not mesh.is_watertight:
        raise ValueError(f"{label}: has holes (not watertight); close it first")
    if mesh.volume < 0:
        mesh.invert()
    if not mesh.volume > 1e-12 * np.ptp(mesh.vertices, axis=0).max() ** 3:
        raise ValueError(f"{label}: volume {mesh.volume:g}, must be above 0")
    return mesh


def _fit(wrapped, vertices, body, r, diameter, normals, points, flat):
    """(shape in the mesh's unit, misfit) for faces that touch these points with these normals, None if none closes."""
    size = 2.0 * np.linalg.norm(vertices, axis=1).max()
    factor = 1.0
    try:
        for _ in range(2):  # bulging faces take more room than the mesh: a second fit is drawn in by as much
            inset = factor * points - r * normals
            radius = _radii(inset, normals, size, flat)
            fitted, centre, frame = placed_ball_polyhedron(inset - radius[:, None] * normals, radius, r, "mesh")
            factor *= (wrapped.volume / fitted.measure) ** (1.0 / 3.0)
    except ValueError:
        return None
    return fitted, _misfit(fitted, centre, frame, vertices, body, diameter)


def _targets(hull, vertices: NDArray, faces: int) -> list[tuple[NDArray, NDArray, bool]]:
    """Normals and points (n, 3) that the faces touch, and whether these are flat: the mesh's own largest faces, and, if
    it has more, means of gathered facets."""
    merged = _flat_faces(hull, vertices)
    flat = (np.array([n for n, _ in merged[:faces]]), np.array([x for _, x in merged[:faces]]), True)
    if len(merged) <= faces:
        return [flat]
    n = spread(faces)
    for _ in range(8):  # gather the facets by the nearest normal; each face takes the mean of its facets
        nearest = np.argmax(hull.face_normals @ n.T, axis=1)
        total = np.zeros_like(n)
        np.add.at(total, nearest, hull.area_faces[:, None] * hull.face_normals)
        length = np.linalg.norm(total, axis=1)
        n[length > 0] = total[length > 0] / length[length > 0, None]
    n = n[length > 0]
    total_load = (n, vertices[np.argmax(vertices @ n.T, axis=0)], False)
    return [flat, total_load] if len(merged) <= FEW_MORE * faces else [total_load]


def _flat_faces(hull, vertices: NDArray) -> list[tuple[NDArray, NDArray]]:
    """(normal, centre) of groups of facets that are coplanar within COPLANAR, the largest first."""
    order = np.argsort(-hull.area_faces, kind="stable")
    free = np.ones(len(order), bool)
    result = []
    for f in order:
        if free[f]:
            same = free & (hull.face_normals @ hull.face_normals[f] > np.cos(COPLANAR))
            free[same] = False
            area = hull.area_faces[same]
            if area.sum() < SMALLEST_FACE * hull.area:
                continue
            normal = (area[:, None] * hull.face_normals[same]).sum(axis=0)
            normal /= np.linalg.norm(normal)
            middle = (area[:, None] * vertices[hull.faces[same]].mean(axis=1)).sum(axis=0) / area.sum()
            result.append((normal, middle))
    return result


def _radii(points: NDArray, normals: NDArray, size: float, flat: bool) -> NDArray:
    """Radii (n,) of the face balls: flat faces the flattest, others just hold all points."""
    if flat:
        return np.full(len(points), FLATTEST * size)
    radius = np.empty(len(points))
    for i in range(len(points)):
        away = points - points[i]
        drop = -2.0 * (away @ normals[i])
        low = drop > 1e-9 * size
        radius[i] = 1.25 * (np.sum(away[low] ** 2, axis=1) / drop[low]).max()
    return np.minimum(radius, FLATTEST * size)


def _misfit(fitted, centre: NDArray, frame: NDArray, vertices: NDArray, body, diameter: float) -> Misfit:
    n = spread(4000)
    gap = fitted.support(n @ frame) + n @ centre - (vertices @ n.T).max(axis=0)
    moments = np.sort(np.linalg.eigvalsh(body.moment_inertia)) / body.volume ** (5.0 / 3.0)
    mine = np.sort(fitted.inertia) / fitted.measure ** (5.0 / 3.0)
    return Misfit(
        volume=float(fitted.measure / body.volume - 1.0),
        greatest_distance=float(np.abs(gap).max() / diameter),
        rms_distance=float(np.sqrt((gap**2).mean()) / diameter),
        inertia=float(np.abs(mine / moments - 1.0).max()),
    )
