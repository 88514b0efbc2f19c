"""Grains as other codes know them: a convex core dilated by one radius, or a clump of balls within the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .patch_meshes import core_of_polyhedron, mesh_of
from .patch_outlines import outline_of, points_of_arcs
from .patch_surfaces import Body, PatchSurface, bodies_of

CORE_SAG = 0.01  # equivalent diameters, of a core in 3D
PROUD = 0.01  # sizes by which balls may stand out of the surface
BARE = 0.02  # sizes to the nearest ball within which a point of the surface counts as covered
MOST_BALLS = 60
CLOSE = {2: 0.03, 3: 0.1}  # distance of points of the surface over the root of the area or volume, by dimension


def rounded_core(surface: PatchSurface) -> tuple[NDArray, float] | None:
    """A convex core whose dilation by a ball or disc is the grain.

    Parameters
    ----------
    surface : PatchSurface
        Patches of the grain, see `patch_surface`.

    Returns
    -------
    vertices : ndarray, (k, dim)
        Vertices of the core, counter-clockwise in 2D; one for a disc or a sphere.
    radius : float
        Radius of the dilation.
    None
        For grains of several bodies or of patches that leave gaps, which have no such core.
    """
    bodies = bodies_of(surface)
    body, patches = bodies[0]
    if len(bodies) > 1 or body is Body.OPEN:
        return None
    if body is Body.POLYHEDRON:
        return core_of_polyhedron(patches, CORE_SAG), float(patches.edge_radius[0])
    radius = float(patches.radius.min())
    if body is Body.BALL:
        return patches.centre.copy(), radius
    points, normals = points_of_arcs(patches)
    core = points - radius * normals
    # All points of an arc of the least radius are its centre.
    apart = np.linalg.norm(core - np.roll(core, 1, axis=0), axis=1) > 1e-9 * np.ptp(core)
    return core[apart], radius


def inscribed_balls(surface: PatchSurface) -> tuple[NDArray, NDArray]:
    """A clump that stands for a grain where only balls are known.

    Parameters
    ----------
    surface : PatchSurface
        Patches of the grain, see `patch_surface`.

    Returns
    -------
    centre : ndarray, (balls, dim)
        Centres of at most 60 balls (discs in 2D), frame and unit of the patches.
    radius : ndarray, (balls,)
        Their radii.

    Notes
    -----
    A clump is returned as it is. Otherwise the largest ball that touches the surface from inside is found for every
    point of it. Of these the one that covers most points comes first, then the one that covers most of the rest, until
    all are covered within 2 % of the size (Ferellec and McDowell 2010 choose by chance).

    References
    ----------
    Ferellec and McDowell (2010), A method to model realistic particle shape and inertia in DEM, Granular Matter 12.
    """
    bodies = bodies_of(surface)
    if all(body is Body.BALL for body, _ in bodies):
        return surface.centre, surface.radius
    x, n = _points_and_normals(surface)
    size = 2.0 * np.linalg.norm(x - x.mean(axis=0), axis=1).mean()
    radius = _tangent_radii(x, n, PROUD * size)
    centre = x - radius[:, None] * n
    covered = np.linalg.norm(x[:, None] - centre, axis=2) - radius < BARE * size  # [point, ball]
    chosen, bare = [], np.ones(len(x), bool)
    while bare.any() and len(chosen) < MOST_BALLS:
        best = int(np.argmax(covered[bare].sum(axis=0)))
        chosen.append(best)
        bare &= ~covered[:, best]
    return centre[chosen], radius[chosen]


def _tangent_radii(x: NDArray, n: NDArray, proud: float) -> NDArray:
    """Radii (k,) of the largest balls tangent inside at x[i] (k, dim) that stand out of the surface by `proud` at most.

    A ball of radius R about x_i - R n_i has the point x at least R - e from its centre if, with d = x - x_i,
    R (-2 d.n_i - 2 e) <= d^2 - e^2.
    """
    radius = np.empty(len(x))
    for i in range(len(x)):
        away = x - x[i]
        steep = -2.0 * (away @ n[i]) - 2.0 * proud
        limits = np.sum(away**2, axis=1)[steep > 0.0] - proud**2
        radius[i] = (limits / steep[steep > 0.0]).min()
    return radius


def _points_and_normals(surface: PatchSurface) -> tuple[NDArray, NDArray]:
    """Points (k, dim) of the outer surface, close to each other, and outward unit normals (k, dim) there."""
    if surface.centre.shape[1] == 3:
        import trimesh

        mesh = mesh_of(surface)
        cut = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.triangles, CLOSE[3] * np.cbrt(mesh.volume))
        fine = trimesh.Trimesh(cut[0], cut[1])
        return np.array(fine.vertices), np.array(fine.vertex_normals)
    import shapely

    outline = shapely.LinearRing(outline_of(surface))
    apart = CLOSE[2] * np.sqrt(shapely.Polygon(outline).area)
    x = shapely.get_coordinates(shapely.segmentize(outline, apart))[:-1]
    along = np.roll(x, -1, axis=0) - np.roll(x, 1, axis=0)
    n = np.stack([along[:, 1], -along[:, 0]], axis=1)
    length = np.linalg.norm(n, axis=1)
    return x[length > 0.0], n[length > 0.0] / length[length > 0.0, None]
