"""Irregular rounded polyhedra (3D): faces that touch an ellipsoid all round, and cells of a Voronoi tiling."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
from numpy.random import Generator
from numpy.typing import NDArray

from ..core.errors import InputError
from .ball_polyhedron import BallPolyhedron
from .corner_radius import radius_for_corner
from .dilated_balls import ball_polyhedron, corner_of_balls, tangent_balls
from .geometry import even_directions
from .input_checks import (
    FLATTEST_FACES,
    Seed,
    check_cells,
    check_fewest_and_most,
    check_flatness,
    random_generator,
)
from .polyhedra import FLATNESS, rounded_polyhedron
from .random_draws import check_request, closed_grains, slack_of

TILES_PER_BATCH = 64  # fixed, so that the first n shapes of a seed do not depend on how many are asked for
BARREN_BATCHES = 8  # batches without one acceptable tile after which the request counts as impossible
JITTER = 0.25  # of the distance of neighbouring faces: by how much their directions are moved


def random_polyhedra(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    faces: tuple[int, int] = (12, 20),
    elongation: float = 1.0,
    angularity: float = 1.0,
    *,
    flatness: float = FLATNESS,
) -> list[BallPolyhedron]:
    """Irregular 3D grains whose faces touch an ellipsoid all round.

    Parameters
    ----------
    count : int
        Number of grains, >= 0.
    seed : int
        Decides the grains, >= 0; the first n shapes of a seed are the same whatever the count.
    corner_radius : float
        Dilation of each grain in its own equivalent diameters, above 0 and below 0.5; met to 1e-10.
    faces : tuple of int
        Fewest and most faces, both included, drawn evenly; fewest >= 6.
    elongation : float
        Longest over shortest axis of the ellipsoid, 1 to 4; the middle axis is their geometric mean.
    angularity : float
        Share of the roundness that the faces give up to the edges, 0 to 1.
    flatness : float
        Greatest radius of the ball of a face in sizes of the ellipsoid, > 0.

    Returns
    -------
    list of BallPolyhedron
        Shapes of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        If a number is out of range or none of 20 draws gives a grain.

    Notes
    -----
    The curvature of a face is 1 - angularity times that of the roundest faces (1.25 times the radius of the least ball
    that leaves the others their place), but never less than the inverse of flatness times the size of the ellipsoid.
    Directions of the faces are even over the sphere, moved by up to a quarter of their distance and rotated at random.
    """
    check_request(count, elongation, angularity, corner_radius, flatness, FLATTEST_FACES)
    check_fewest_and_most("faces", faces, 6)
    axes = 0.5 * np.sqrt(elongation) ** np.array([1.0, 0.0, -1.0])

    def draw(rng: Generator, name: str) -> BallPolyhedron:
        """A grain of a random number of faces, whose normals are even over the ellipsoid but for jitter."""
        u = even_directions(int(rng.integers(faces[0], faces[1] + 1)))
        u = u + JITTER * np.sqrt(4.0 * np.pi / len(u)) * rng.uniform(-1.0, 1.0, u.shape)
        u = u @ scipy.spatial.transform.Rotation.random(rng=rng).as_matrix().T
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        n = u / axes / np.linalg.norm(u / axes, axis=1, keepdims=True)

        def balls(dilation: float) -> tuple[NDArray, NDArray]:
            return tangent_balls(axes * u, n, dilation, slack_of(angularity), flatness)

        dilation = radius_for_corner(lambda asked: corner_of_balls(*balls(asked), asked), corner_radius, axes[2])
        return ball_polyhedron(*balls(dilation), dilation, name=name)

    request = f"{faces = }, {elongation = }, {angularity = }, {corner_radius = }"
    return closed_grains(draw, count, seed, "random", request)


def random_angular_polyhedra(
    count: int,
    seed: int,
    corner_radius: float = 0.05,
    faces: tuple[int, int] = (10, 18),
    max_aspect: float = 1.5,
    made: Callable[[int], None] | None = None,
    *,
    flatness: float | None = None,
) -> list[BallPolyhedron]:
    """Angular 3D grains: cells of a relaxed Voronoi tiling, rounded; those too slender for the corners are left out.

    Parameters
    ----------
    count : int
        Number of grains, >= 0.
    seed : int
        Decides the cells, >= 0; the first n shapes of a seed are the same whatever the count.
    corner_radius : float
        Dilation of each grain in its own equivalent diameters, above 0 and below 0.5; met to 1e-10.
    faces : tuple of int
        Fewest and most faces of a cell, both included, fewest >= 4.
    max_aspect : float
        Cells are kept if the longest over the shortest axis of their ellipsoid of equal moments is below it; > 1.
    made : callable, optional
        Called with the number of shapes there are, after each one: a layer's take tens of seconds.
    flatness : float, optional
        Radius of the balls of the faces, as of `from_planes`.

    Returns
    -------
    list of BallPolyhedron
        Shapes of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        If a parameter is out of range or no cell meets the request.
    """
    check_cells(count, corner_radius, "faces", faces, 4, max_aspect)
    check_flatness(flatness)
    shapes: list[BallPolyhedron] = []
    batch = barren = 0
    while len(shapes) < count:
        before = len(shapes)
        for _, n, h in voronoi_cells(TILES_PER_BATCH, (seed, batch)):
            if len(shapes) == count:
                break
            try:
                shape = rounded_polyhedron(n, h, corner_radius, f"angular polyhedron {seed}-{len(shapes)}", flatness)
            except ValueError:  # too slender for the corner radius, or a sliver, on which any step of the fit may fail
                continue
            # Second moments along the principal axes, which are as the squared axes of the ellipsoid of equal moments.
            moments = shape.inertia.sum() / 2.0 - shape.inertia
            if faces[0] <= shape.face_count <= faces[1] and np.sqrt(moments.max() / moments.min()) < max_aspect:
                shapes.append(shape)
                if made:
                    made(len(shapes))
        batch, barren = batch + 1, (barren + 1 if len(shapes) == before else 0)
        if barren == BARREN_BATCHES:
            raise _no_cell(faces, max_aspect, corner_radius)
    return shapes


def _no_cell(faces: tuple[int, int], max_aspect: float, corner_radius: float) -> InputError:
    """The refusal of a request that no cell meets."""
    return InputError(
        f"faces = {faces}, max_aspect = {max_aspect}, corner_radius = {corner_radius}: none of "
        f"{BARREN_BATCHES * TILES_PER_BATCH} cells is such a grain; widen one of them"
    )


def voronoi_cells(count: int, seed: Seed, relaxations: int = 2) -> list[tuple[NDArray, NDArray, NDArray]]:
    """(site (3,), normals (m, 3), distances from it (m,)) of the cells of a relaxed periodic Voronoi tiling."""
    sites = random_generator(seed).random((count, 3))
    shifts = np.array(np.meshgrid(*[[0, -1, 1]] * 3, indexing="ij")).reshape(3, -1).T  # the cube itself is the first

    def tiling(sites: NDArray) -> tuple[NDArray, scipy.spatial.Voronoi]:
        """Sites of 3 x 3 x 3 copies of the cube, and their diagram."""
        copies = (sites + shifts[:, None]).reshape(-1, 3)
        return copies, scipy.spatial.Voronoi(copies)

    copies, diagram = tiling(sites)
    for _ in range(relaxations):
        cells = [diagram.vertices[diagram.regions[r]] for r in diagram.point_region[:count]]
        copies, diagram = tiling(np.array([_centroid(cell) for cell in cells]) % 1)
    sites = copies[:count]
    planes: list[tuple[list[NDArray], list[float]]] = [([], []) for _ in range(count)]
    for a, b in diagram.ridge_points:
        for k, other in ((a, b), (b, a)):
            if k < count:
                branch = copies[other] - copies[k]
                length = float(np.linalg.norm(branch))
                planes[k][0].append(branch / length)
                planes[k][1].append(0.5 * length)
    return [(site, np.array(n), np.array(h)) for site, (n, h) in zip(sites, planes, strict=True)]


def _centroid(vertices: NDArray) -> NDArray:
    """Centre of mass of the convex hull of points (m, 3)."""
    hull = scipy.spatial.ConvexHull(vertices)
    a, b, c = (vertices[hull.simplices[:, i]] for i in range(3))
    origin = vertices.mean(axis=0)
    volume = np.abs(np.einsum("ij,ij->i", a - origin, np.cross(b - origin, c - origin)))
    return origin + (volume[:, None] * (a + b + c - 3.0 * origin)).sum(axis=0) / (4.0 * volume.sum())
