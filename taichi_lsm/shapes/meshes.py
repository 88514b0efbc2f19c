"""Grains from triangle meshes (STL, PLY, OBJ): a ball-polyhedron fitted to the mesh, and how far it is off."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError, reason
from .ball_polyhedron import BallPolyhedron
from .dilated_balls import SLACK, ball_polyhedron_and_frame
from .geometry import even_directions, least_tangent_radii
from .input_checks import check_between, check_corner_radius

if TYPE_CHECKING:
    import trimesh

MOST_TRIANGLES = 1_000_000
MOST_BYTES = 300_000_000  # of a file: so many triangles in text
FORMATS = ("stl", "ply", "obj")
COPLANAR = np.radians(5.0)  # facets of the hull whose normals differ by less are one face
FLATTEST = 50.0  # radius of a face in sizes, for meshes with flat faces
SMALLEST_FACE = 1e-4  # of the surface: smaller facets are left to the rounding
FEW_MORE = 4  # faces of a mesh over those asked for: beyond it is a smooth body
HULL_VOLUME = 0.01  # share by which the hull may exceed a mesh that counts as convex
MISFIT_DIRECTIONS = 4000  # of support along which grain and mesh are compared


class Misfit(NamedTuple):
    """How far a fitted grain is from its mesh, before it is rescaled; lengths over the equivalent diameter.

    Attributes
    ----------
    volume : float
        Relative error of the volume.
    greatest_distance : float
        Greatest difference of the support functions along 4000 directions.
    rms_distance : float
        Root mean square of that difference.
    inertia : float
        Greatest relative error of a principal moment at equal volume.
    """

    volume: float
    greatest_distance: float
    rms_distance: float
    inertia: float


def from_mesh(
    mesh: str | PathLike[str] | trimesh.Trimesh, faces: int = 60, corner_radius: float = 0.02, *, hull: bool = False
) -> tuple[BallPolyhedron, Misfit]:
    """A grain fitted to a triangle mesh, and its misfit.

    Parameters
    ----------
    mesh : path or trimesh.Trimesh
        File (STL, PLY, OBJ) or mesh in any unit of length, closed, of at most a million triangles.
    faces : int
        Greatest number of faces of the grain, 4 to 300.
    corner_radius : float
        Radius of edges and vertices in equivalent diameters of the mesh, above 0 and below 0.25.
    hull : bool
        Whether to take the convex hull of a mesh that is not convex; the misfit is then against the mesh itself.

    Returns
    -------
    shape : BallPolyhedron
        Grain of equivalent diameter 1, body frame.
    misfit : Misfit
        How far its surface is from that of the mesh.

    Raises
    ------
    InputError
        If the file cannot be read, or the mesh has holes, no volume, values that are not finite or too many triangles,
        or is not convex and `hull` was not asked for, or no closed grain comes out.
    """
    check_between("faces", faces, 4, 300)
    check_corner_radius(corner_radius, 0.25)
    body = _checked(mesh)
    wrapped = body.convex_hull
    excess = wrapped.volume / body.volume - 1.0
    if excess > HULL_VOLUME and not hull:
        raise InputError(f"mesh: not convex, its hull is {100 * excess:.3g} % larger; hull=True takes the hull")
    diameter = (6.0 * body.volume / np.pi) ** (1.0 / 3.0)
    vertices = wrapped.vertices - body.center_mass
    r = corner_radius * diameter
    fits = [_fit(wrapped, vertices, body, r, diameter, *target) for target in _targets(wrapped, vertices, faces)]
    closed = [fit for fit in fits if fit]
    if not closed:
        raise InputError(f"mesh: {faces} faces and corner_radius = {corner_radius} give no closed surface; change them")
    fitted, misfit = min(closed, key=lambda fit: fit[1].rms_distance)
    return fitted.normalised(), misfit


def _checked(mesh: str | PathLike[str] | trimesh.Trimesh) -> trimesh.Trimesh:
    """A closed mesh of positive volume, read from its file if it is given as one."""
    import trimesh

    label = "mesh"
    if not isinstance(mesh, trimesh.Trimesh):
        try:
            path = Path(mesh)
        except TypeError:
            raise InputError(f"mesh = {mesh!r}: must be a file or a trimesh.Trimesh") from None
        label = f"mesh {path}"
        if not path.is_file():
            raise InputError(f"mesh {path}: no such file")
        kind = path.suffix.lower().removeprefix(".")
        if kind not in FORMATS or path.stat().st_size > MOST_BYTES:
            raise InputError(
                f"mesh {path}: {path.stat().st_size} bytes of format {kind or 'unknown'}, must be at most {MOST_BYTES} "
                f"bytes of {', '.join(FORMATS)}"
            )
        try:  # from an open file: other files that it names, such as materials, are not looked for
            with open(path, "rb") as file:
                mesh = trimesh.load_mesh(file, file_type=kind, **({"skip_materials": True} if kind == "obj" else {}))
        except Exception as error:  # each reader has errors of its own
            raise InputError(f"mesh {path}: cannot be read ({reason(error)})") from None
        if not isinstance(mesh, trimesh.Trimesh):
            raise InputError(f"mesh {path}: holds no single triangle mesh")
    count = len(mesh.faces)
    if count > MOST_TRIANGLES:
        raise InputError(f"{label}: {count} triangles, must be at most {MOST_TRIANGLES}; simplify it first")
    if count < 4 or not np.all(np.isfinite(mesh.vertices)):
        raise InputError(f"{label}: {count} triangles, must be at least 4 with finite vertices")
    mesh = mesh.copy()
    mesh.merge_vertices()
    if not mesh.is_watertight:
        raise InputError(f"{label}: has holes (not watertight); close it first")
    if mesh.volume < 0:
        mesh.invert()
    if not mesh.volume > 1e-12 * np.ptp(mesh.vertices, axis=0).max() ** 3:
        raise InputError(f"{label}: volume {mesh.volume:g}, must be above 0")
    return mesh


def _fit(
    wrapped: trimesh.Trimesh,
    vertices: NDArray,
    body: trimesh.Trimesh,
    r: float,
    diameter: float,
    normals: NDArray,
    points: NDArray,
    flat: bool,
) -> tuple[BallPolyhedron, Misfit] | None:
    """(shape in the mesh's unit, misfit) for faces that touch these points with these normals, None if none closes."""
    size = 2.0 * np.linalg.norm(vertices, axis=1).max()

    def fit(factor: float) -> tuple[BallPolyhedron, NDArray, NDArray]:
        """Shape, centre of mass and frame for the points scaled by a factor."""
        inset = factor * points - r * normals
        radius = _radii(inset, normals, size, flat)
        return ball_polyhedron_and_frame(inset - radius[:, None] * normals, radius, r, "mesh")

    try:  # bulging faces take more space than the mesh: a second fit is drawn in by as much
        bulging, _, _ = fit(1.0)
        fitted, centre, frame = fit((wrapped.volume / bulging.measure) ** (1.0 / 3.0))
    except ValueError:  # slivers, on which any step of the fit may fail
        return None
    return fitted, _misfit(fitted, centre, frame, vertices, body, diameter)


def _targets(hull: trimesh.Trimesh, vertices: NDArray, faces: int) -> list[tuple[NDArray, NDArray, bool]]:
    """Normals and points (n, 3) that the faces touch, and whether these are flat.

    They are the mesh's own largest faces, and, if it has more, means of groups of facets.
    """
    merged = _flat_faces(hull, vertices)
    flat = (np.array([n for n, _ in merged[:faces]]), np.array([x for _, x in merged[:faces]]), True)
    if len(merged) <= faces:
        return [flat]
    n, length = even_directions(faces), np.ones(faces)
    for _ in range(8):  # group the facets by the nearest normal; each face takes the mean of its facets
        nearest = np.argmax(hull.face_normals @ n.T, axis=1)
        total = np.zeros_like(n)
        np.add.at(total, nearest, hull.area_faces[:, None] * hull.face_normals)
        length = np.linalg.norm(total, axis=1)
        n[length > 0] = total[length > 0] / length[length > 0, None]
    n = n[length > 0]
    grouped = (n, vertices[np.argmax(vertices @ n.T, axis=0)], False)
    return [flat, grouped] if len(merged) <= FEW_MORE * faces else [grouped]


def _flat_faces(hull: trimesh.Trimesh, vertices: NDArray) -> list[tuple[NDArray, NDArray]]:
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
    least = least_tangent_radii(points, normals, size)
    if not np.all(np.isfinite(least)):
        raise InputError("mesh: no point lies below one of the faces")
    return np.minimum(SLACK * least, FLATTEST * size)


def _misfit(
    fitted: BallPolyhedron,
    centre: NDArray,
    frame: NDArray,
    vertices: NDArray,
    body: trimesh.Trimesh,
    diameter: float,
) -> Misfit:
    """Differences of a grain, at `centre` and rotated by `frame`, from the mesh `body`."""
    n = even_directions(MISFIT_DIRECTIONS)
    gap = fitted.support(n @ frame) + n @ centre - (vertices @ n.T).max(axis=0)
    moments = np.sort(np.linalg.eigvalsh(body.moment_inertia)) / body.volume ** (5.0 / 3.0)
    mine = np.sort(fitted.inertia) / fitted.measure ** (5.0 / 3.0)
    return Misfit(
        volume=float(fitted.measure / body.volume - 1.0),
        greatest_distance=float(np.abs(gap).max() / diameter),
        rms_distance=float(np.sqrt((gap**2).mean()) / diameter),
        inertia=float(np.abs(mine / moments - 1.0).max()),
    )
