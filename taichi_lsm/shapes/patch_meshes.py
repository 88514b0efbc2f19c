"""Surfaces of 3D grains as triangles.

A mesh with its vertices on a convex surface lacks volume. All vertices are therefore moved outwards, in proportion to
their distance from the middle, until the volume is that of the grain. The mesh is then off the surface to both sides,
by less than 0.4 % of the equivalent diameter.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .ball_cells import Features, cell_of_balls
from .geometry import convex_mesh, even_directions
from .mass_properties import volume_of
from .patch_surfaces import Body, PatchSurface, bodies_of

SAG = 3e-3  # of the equivalent diameter: height of the surface over a triangle with its corners on it
SPACING = 4.0  # square of the distance of neighbours over sag and radius; 6 for triangles of equal sides
ROUGH = 0.05  # of a radius: sag of the mesh that tells the size of a hull
FINER = 8.0  # sag over that of a second mesh, which tells the volume of a hull or a union
HEXAGONAL = np.sqrt(0.75)  # area per point over the square of the distance to its neighbours


class SurfaceMesh(NamedTuple):
    """Triangles of a closed surface.

    Attributes
    ----------
    vertices : ndarray, (k, 3)
        Corners of the triangles.
    triangles : ndarray of int, (t, 3)
        Rows of the corners of each triangle, counter-clockwise seen from outside.
    """

    vertices: NDArray
    triangles: NDArray

    @property
    def volume(self) -> float:
        """What the surface encloses: sum of (a x b) . c/6 over the triangles."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        return float(np.sum(np.cross(a, b) * c) / 6.0)


def mesh_of(surface: PatchSurface) -> SurfaceMesh:
    """The surface of a 3D grain.

    Parameters
    ----------
    surface : PatchSurface
        Its patches, see `patch_surface`.

    Returns
    -------
    SurfaceMesh
        In the frame and unit of the patches; its volume is that of the grain within 0.1 %.

    Raises
    ------
    InputError
        If the grain has several parts and the library that unites meshes is not installed.
    """
    bodies = bodies_of(surface)
    if len(bodies) == 1:
        return _mesh(*bodies[0], SAG)
    # Meshes that are united are off where they cross, not in volume; finer ones tell that of the union.
    mesh, fine = (_united([_mesh(*body, sag) for body in bodies]) for sag in (SAG, SAG / FINER))
    return _inflated(mesh, fine.volume)


def core_of_polyhedron(patches: PatchSurface, sag: float) -> NDArray:
    """Points (k, 3) whose convex hull, dilated by the radius of the edges, is a ball-polyhedron but for the sag.

    patches: of one ball-polyhedron; sag: in equivalent diameters.
    """
    cell, edge_radius = _cell(patches)
    size = np.cbrt(6.0 / np.pi * volume_of(cell, edge_radius))
    core, _ = _core_and_normals(cell, patches, sag * size)
    return convex_mesh(core)[0]


def _mesh(body: Body, patches: PatchSurface, sag: float) -> SurfaceMesh:
    """The mesh of one body; sag: in its equivalent diameters."""
    if body is Body.BALL:
        vertices, triangles = _unit_sphere(sag)
        return SurfaceMesh(patches.centre[0] + patches.radius[0] * vertices, triangles)
    if body is Body.POLYHEDRON:
        cell, edge_radius = _cell(patches)
        volume = volume_of(cell, edge_radius)
        core, normals = _core_and_normals(cell, patches, sag * np.cbrt(6.0 / np.pi * volume))
        return _inflated(_hull(core + edge_radius * normals), volume)
    size = np.cbrt(6.0 / np.pi * _hull(_cap_points(patches, ROUGH * patches.radius.min())).volume)
    mesh, fine = (_hull(_cap_points(patches, s * size)) for s in (sag, sag / FINER))
    # The volume that a mesh lacks is proportional to its sag.
    return _inflated(mesh, (FINER * fine.volume - mesh.volume) / (FINER - 1.0))


@cache
def _unit_sphere(sag: float) -> SurfaceMesh:
    count = int(np.ceil(4.0 * np.pi / (HEXAGONAL * SPACING * 2.0 * sag)))
    return _inflated(_hull(even_directions(count)), 4.0 / 3.0 * np.pi)


def _hull(points: NDArray) -> SurfaceMesh:
    return SurfaceMesh(*convex_mesh(points))


def _inflated(mesh: SurfaceMesh, volume: float) -> SurfaceMesh:
    """The mesh scaled about its middle to this volume."""
    middle = mesh.vertices.mean(axis=0)
    factor = np.cbrt(volume / mesh.volume)
    return SurfaceMesh(middle + factor * (mesh.vertices - middle), mesh.triangles)


def _cell(patches: PatchSurface) -> tuple[Features, float]:
    """Features of a ball-polyhedron, from its faces alone, and the radius by which it is dilated.

    Faces are the patches of more than that radius; all others are vertices, which follow from them.
    """
    edge_radius = float(patches.edge_radius[0])
    faces = patches.rows(patches.radius > edge_radius)
    return cell_of_balls(faces.centre, faces.radius - edge_radius), edge_radius


def _core_and_normals(cell: Features, patches: PatchSurface, sag: float) -> tuple[NDArray, NDArray]:
    """Points (k, 3) of a cell of balls and an outward normal (k, 3) at each; together they span it within the sag."""
    edge_radius = float(patches.edge_radius[0])
    points, normals = [], []

    def add(x: NDArray, n: NDArray) -> None:
        points.append(np.broadcast_to(x, n.shape).reshape(-1, 3))
        normals.append(n.reshape(-1, 3))

    for f in range(cell.faces):
        own = int(np.argmin(np.linalg.norm(patches.centre - cell.centre[f], axis=1)))
        spread = np.sqrt(SPACING * sag / (cell.radius[f] + edge_radius))
        n = _in_cone(cell, f, _cap(patches.axis[own], patches.half_angle[own], spread))
        add(cell.centre[f] + cell.radius[f] * n, n)
    step = _step(sag, edge_radius)
    for e in range(cell.edges):
        f = cell.faces + e
        count = 2 + int(cell.span[e] / _step(sag, cell.rho[f] + edge_radius))
        x = cell.centre[f] + cell.rho[f] * cell.circle(e, cell.start[e] + cell.span[e] * np.linspace(0.0, 1.0, count))
        # The normals of an edge go from that of one face to that of the other.
        first, second = ((x - cell.centre[face]) / cell.radius[face] for face in cell.side[e])
        widest = float(np.arccos(np.clip((first * second).sum(axis=1).min(), -1.0, 1.0)))
        share = np.linspace(0.0, 1.0, 2 + int(widest / step))[:, None, None]
        n = (1.0 - share) * first + share * second
        add(x, n / np.linalg.norm(n, axis=2, keepdims=True))
    even = even_directions(int(np.ceil(4.0 * np.pi / (HEXAGONAL * SPACING * sag / edge_radius))))
    for f in range(cell.faces + cell.edges, len(cell.radius)):
        add(cell.centre[f], _in_cone(cell, f, even))
    return np.concatenate(points), np.concatenate(normals)


def _step(sag: float, radius: float) -> float:
    """Angle [rad] of the chord of an arc that has this sag, at most a third of a turn."""
    return float(2.0 * np.arccos(1.0 - min(sag / radius, 0.5)))


def _in_cone(cell: Features, f: int, n: NDArray) -> NDArray:
    """Those of the normals (k, 3) that belong to feature f."""
    own = slice(cell.first_bound[f], cell.first_bound[f + 1])
    return n[np.all(n @ cell.bound[own].T <= cell.offset[own], axis=1)]


def _cap(axis: NDArray, half_angle: float, spread: float) -> NDArray:
    """Unit vectors (k, 3), nearly even, `spread` [rad] apart, within an angle of an axis; the axis is the first."""
    area = 1.0 - np.cos(half_angle)  # of the unit sphere, over 2 pi
    count = int(np.ceil(2.0 * np.pi * area / (HEXAGONAL * spread**2)))
    along = 1.0 - area * (np.arange(count) + 0.5) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    across = np.linalg.svd(axis[None])[2][1:]
    ring = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    return np.concatenate([axis[None], along[:, None] * axis + np.sqrt(1.0 - along**2)[:, None] * ring])


def _cap_points(patches: PatchSurface, sag: float) -> NDArray:
    """Points (k, 3) of the caps of patches with their rims."""
    points = []
    for centre, radius, axis, half_angle in zip(*patches[:4], strict=True):
        n = _cap(axis, half_angle, np.sqrt(SPACING * sag / radius))
        rim = np.linspace(0.0, 2.0 * np.pi, 3 + int(2.0 * np.pi / _step(sag, radius)))[1:]
        across = np.linalg.svd(axis[None])[2][1:]
        ring = np.cos(rim)[:, None] * across[0] + np.sin(rim)[:, None] * across[1]
        points += [centre + radius * n, centre + radius * (np.cos(half_angle) * axis + np.sin(half_angle) * ring)]
    return np.concatenate(points)


def _united(meshes: list[SurfaceMesh]) -> SurfaceMesh:
    """The outer surface of meshes that overlap."""
    try:
        import manifold3d
    except ImportError:
        raise InputError(
            "outlines: grains of several parts need manifold3d, which is not installed; "
            "pip install 'taichi-lsm[export]'"
        ) from None
    solids = [
        manifold3d.Manifold(
            manifold3d.Mesh64(
                vert_properties=np.ascontiguousarray(mesh.vertices), tri_verts=mesh.triangles.astype(np.uint64)
            )
        )
        for mesh in meshes
    ]
    united = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).to_mesh64()
    return SurfaceMesh(np.array(united.vert_properties[:, :3]), np.array(united.tri_verts, np.int64))
