"""Grains from triangle meshes (STL, PLY, OBJ): a ball-polyhedron fitted to the mesh, and how far it is off."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .ball_polyhedron import BallPolyhedron
from .dilated_balls import SLACK, ball_polyhedron_and_frame
from .geometry import convex_mesh, even_directions, least_tangent_radii
from .input_checks import check_between, check_corner_radius
from .mesh_bodies import chosen_body
from .mesh_files import triangles_of
from .mesh_repair import Shell, mended
from .placement import Imported, Placement, quaternion_of

if TYPE_CHECKING:
    import trimesh

COPLANAR = np.radians(5.0)  # facets of the hull whose normals differ by less are one face
FLATTEST = 50.0  # radius of a face in sizes, for meshes with flat faces
SMALLEST_FACE = 1e-4  # of the surface: smaller facets are left to the rounding
FEW_MORE = 4  # faces of a mesh over those asked for: beyond it is a smooth body
HULL_VOLUME = 0.01  # share by which the hull may exceed a mesh that counts as convex
MISFIT_DIRECTIONS = 4000  # of support along which grain and mesh are compared
MOST_POINTS = 20_000  # of which the hull is made; of more
CELLS = 50  # of directions, along a side of a cube: of each the farthest point is taken


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
    repairs : tuple of str
        What was mended in the mesh.
    """

    volume: float
    greatest_distance: float
    rms_distance: float
    inertia: float
    repairs: tuple[str, ...] = ()


def from_mesh(
    mesh: str | PathLike[str] | trimesh.Trimesh,
    faces: int = 60,
    corner_radius: float = 0.02,
    *,
    hull: bool = False,
    body: int | None = None,
) -> Imported[BallPolyhedron, Misfit]:
    """A grain fitted to a triangle mesh, its misfit, and where the file has it.

    Parameters
    ----------
    mesh : path or trimesh.Trimesh
        File (STL, PLY, OBJ) or mesh in any unit of length and any place, closed, of at most a million triangles.
    faces : int
        Greatest number of faces of the grain, 4 to 300.
    corner_radius : float
        Radius of edges and vertices in equivalent diameters of the mesh, above 0 and below 0.25.
    hull : bool
        Whether to take the convex hull of a mesh that is not convex; the misfit is then against the mesh itself.
    body : int, optional
        Which of several bodies to take, 0 for the largest; see `bodies_of_mesh`.

    Returns
    -------
    shape : BallPolyhedron
        Grain of equivalent diameter 1, body frame.
    misfit : Misfit
        How far its surface is from that of the mesh, and what was mended there.
    placement : Placement
        Centre, orientation and equivalent diameter of the body in the frame and unit of the file.

    Raises
    ------
    InputError
        If the file cannot be read, or the mesh has holes, no volume, values that are not finite or too many triangles,
        or is not convex and `hull` was not asked for, or holds several bodies and none was chosen, or no closed grain
        comes out.

    Notes
    -----
    Vertices are merged by their places. Triangles without area and doubled ones are left out, gaps of up to 1e-4 of the
    size are closed, and triangles are turned so that their normals point outwards.
    """
    check_between("faces", faces, 4, 300)
    check_corner_radius(corner_radius, 0.25)
    label, vertices, triangles = triangles_of(mesh)
    found = mended(label, vertices, triangles)
    solid, middle, extent = _scaled(chosen_body(label, found, body))
    wrapped = _hull(solid.vertices)
    excess = wrapped.volume / solid.volume - 1.0
    if excess > HULL_VOLUME and not hull:
        raise InputError(f"{label}: not convex, its hull is {100 * excess:.3g} % larger; hull=True takes the hull")
    target = Target(wrapped, wrapped.vertices - solid.center_mass, solid)
    fits = [_fit(target, corner_radius, *touching) for touching in _targets(wrapped, target.vertices, faces)]
    closed = [fit for fit in fits if fit]
    if not closed:
        raise InputError(
            f"{label}: {faces} faces and corner_radius = {corner_radius} give no closed surface; change them"
        )
    best = min(closed, key=lambda fit: fit.misfit.rms_distance)
    unit = found.size * extent  # of the file
    centre = found.origin + found.size * middle + unit * (solid.center_mass + best.centre)
    placement = Placement(centre, quaternion_of(best.frame), unit * target.diameter)
    return Imported(best.shape.normalised(), best.misfit._replace(repairs=found.repairs), placement)


class Target(NamedTuple):
    """What a grain is fitted to, in units of its greatest extent."""

    hull: trimesh.Trimesh
    vertices: NDArray  # of the hull, about the centre of mass of the body
    body: trimesh.Trimesh

    @property
    def diameter(self) -> float:
        """Equivalent diameter of the body."""
        return float((6.0 * self.body.volume / np.pi) ** (1.0 / 3.0))


class Fit(NamedTuple):
    """A fitted grain, in units of the target, with its centre (3,) and frame (3, 3) there."""

    shape: BallPolyhedron
    centre: NDArray
    frame: NDArray
    misfit: Misfit


def _scaled(shell: Shell) -> tuple[trimesh.Trimesh, NDArray, float]:
    """A body about the middle of its box, of greatest extent 1; that middle (3,) and that extent."""
    import trimesh

    low, high = shell.vertices.min(axis=0), shell.vertices.max(axis=0)
    middle, extent = 0.5 * (low + high), float((high - low).max())
    return trimesh.Trimesh((shell.vertices - middle) / extent, shell.triangles, process=False), middle, extent


def _hull(vertices: NDArray) -> trimesh.Trimesh:
    """The convex hull of the points (n, 3); of very many, that of those farthest out in their direction."""
    import trimesh

    if len(vertices) > MOST_POINTS:
        vertices = vertices[_farthest(vertices)]
    return trimesh.Trimesh(*convex_mesh(vertices), process=False)


def _farthest(x: NDArray) -> NDArray:
    """Rows (m,) of the points x (n, 3) that are the farthest from the middle of all within their cell of directions.

    The cells are squares on the six sides of a cube, which is stretched as the points are.
    """
    x = x - x.mean(axis=0)
    spread, axes = np.linalg.eigh(x.T @ x)
    x = x @ (axes / np.sqrt(np.maximum(spread, 1e-12 * spread[2])))
    side = np.argmax(np.abs(x), axis=1)
    ahead = np.take_along_axis(x, side[:, None], axis=1)
    across = np.take_along_axis(x, (side[:, None] + [1, 2]) % 3, axis=1) / np.where(ahead == 0.0, 1.0, np.abs(ahead))
    column = np.minimum((0.5 * (across + 1.0) * CELLS).astype(np.int64), CELLS - 1)
    cell = ((2 * side + (ahead[:, 0] > 0.0)) * CELLS + column[:, 0]) * CELLS + column[:, 1]
    order = np.lexsort([-np.sum(x**2, axis=1), cell])
    return order[np.unique(cell[order], return_index=True)[1]]


def _fit(target: Target, corner_radius: float, normals: NDArray, points: NDArray, flat: bool) -> Fit | None:
    """A grain whose faces touch these points with these normals; None if none closes."""
    size = 2.0 * np.linalg.norm(target.vertices, axis=1).max()
    r = corner_radius * target.diameter

    def fit(factor: float) -> tuple[BallPolyhedron, NDArray, NDArray]:
        """Shape, centre of mass and frame for the points scaled by a factor."""
        inset = factor * points - r * normals
        radius = _radii(inset, normals, size, flat)
        return ball_polyhedron_and_frame(inset - radius[:, None] * normals, radius, r, "mesh")

    try:  # bulging faces take more space than the mesh: a second fit is drawn in by as much
        bulging, _, _ = fit(1.0)
        fitted, centre, frame = fit((target.hull.volume / bulging.measure) ** (1.0 / 3.0))
    except ValueError:  # slivers, on which any step of the fit may fail
        return None
    return Fit(fitted, centre, frame, _misfit(fitted, centre, frame, target))


def _targets(hull: trimesh.Trimesh, vertices: NDArray, faces: int) -> list[tuple[NDArray, NDArray, bool]]:
    """Normals and points (n, 3) that the faces touch, and whether these are flat.

    They are the mesh's own largest faces, and, if it has more, means of groups of facets.
    """
    merged = _flat_faces(hull, vertices)
    flat = (np.array([n for n, _ in merged[:faces]]), np.array([x for _, x in merged[:faces]]), True)
    if len(merged) <= faces:
        return [flat]
    n, length = even_directions(faces), np.ones(faces)
    normals, areas = np.asarray(hull.face_normals), np.asarray(hull.area_faces)
    for _ in range(8):  # group the facets by the nearest normal; each face takes the mean of its facets
        nearest = np.argmax(normals @ n.T, axis=1)
        total = np.zeros_like(n)
        np.add.at(total, nearest, areas[:, None] * normals)
        length = np.linalg.norm(total, axis=1)
        n[length > 0] = total[length > 0] / length[length > 0, None]
    n = n[length > 0]
    grouped = (n, vertices[np.argmax(vertices @ n.T, axis=0)], False)
    return [flat, grouped] if len(merged) <= FEW_MORE * faces else [grouped]


def _flat_faces(hull: trimesh.Trimesh, vertices: NDArray) -> list[tuple[NDArray, NDArray]]:
    """(normal, centre) of groups of facets that are coplanar within COPLANAR, the largest first."""
    normals, areas, corners = np.asarray(hull.face_normals), np.asarray(hull.area_faces), np.asarray(hull.faces)
    order, least = np.argsort(-areas, kind="stable"), SMALLEST_FACE * areas.sum()
    free = np.ones(len(order), bool)
    result = []
    for f in order:
        if free[f]:
            same = free & (normals @ normals[f] > np.cos(COPLANAR))
            free[same] = False
            area = areas[same]
            if area.sum() < least:
                continue
            normal = (area[:, None] * normals[same]).sum(axis=0)
            normal /= np.linalg.norm(normal)
            middle = (area[:, None] * vertices[corners[same]].mean(axis=1)).sum(axis=0) / area.sum()
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


def _misfit(fitted: BallPolyhedron, centre: NDArray, frame: NDArray, target: Target) -> Misfit:
    """Differences of a grain, at `centre` and rotated by `frame`, from its target."""
    directions = even_directions(MISFIT_DIRECTIONS)
    reach = [(target.vertices @ n.T).max(axis=0) for n in np.array_split(directions, MISFIT_DIRECTIONS // 100)]
    gap = fitted.support(directions @ frame) + directions @ centre - np.concatenate(reach)
    body = target.body
    moments = np.sort(np.linalg.eigvalsh(body.moment_inertia)) / body.volume ** (5.0 / 3.0)
    mine = np.sort(fitted.inertia) / fitted.measure ** (5.0 / 3.0)
    return Misfit(
        volume=float(fitted.measure / body.volume - 1.0),
        greatest_distance=float(np.abs(gap).max() / target.diameter),
        rms_distance=float(np.sqrt((gap**2).mean()) / target.diameter),
        inertia=float(np.abs(mine / moments - 1.0).max()),
    )
