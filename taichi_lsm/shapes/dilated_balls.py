"""Makers of ball-polyhedra: balls intersected and dilated, given as such or tangent to a convex target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .ball_cells import Features, cell_of_balls
from .ball_polyhedron import BallPolyhedron
from .geometry import even_directions, least_tangent_radii
from .input_checks import check_at_least, check_positive, number_array
from .mass_properties import mass_of, volume_of

SLACK = 1.25  # radius of a face over the least that holds the other tangent points: less makes slivers
SAMPLES = 4000  # directions that bound the lever
LEVER_MARGIN = 1.005  # on the greatest lever of the samples, for what lies between them


def ball_polyhedron(
    centres: ArrayLike, radii: ArrayLike, dilation: float, *, name: str = "ball-polyhedron", normalise: bool = True
) -> BallPolyhedron:
    """The common part of the balls B(centres[i], radii[i]), dilated; balls that bound nothing are left out.

    Parameters
    ----------
    centres : array_like, (n, 3)
        Centres p_i of the balls, n >= 1, in any unit of length L.
    radii : array_like, (n,)
        Radii R_i > 0 [L].
    dilation : float
        Radius r > 0 that rounds edges and vertices [L].
    name : str
        What pictures and files call the shape.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit L is kept.

    Returns
    -------
    BallPolyhedron
        The grain, moved to its centre of mass and rotated into the principal frame unless the products of inertia
        already vanish. One ball alone gives a sphere.

    Raises
    ------
    InputError
        If numbers are out of range, the balls have no common part or the surface is no polyhedron.
    """
    p, big = number_array("centres", centres), number_array("radii", radii)
    if p.ndim != 2 or p.shape[1] != 3 or big.shape != p.shape[:1] or not len(p):
        raise InputError(f"centres and radii have shapes {p.shape}, {big.shape}: must be (n, 3) and (n,), n >= 1")
    if not (np.all(np.isfinite(p)) and np.all(np.isfinite(big)) and np.all(big > 0)):
        raise InputError(f"centres, radii = {p}, {big}: must be finite, radii > 0")
    check_positive("dilation", dilation)
    shape, _, _ = ball_polyhedron_and_frame(p, big, dilation, name)
    return shape.normalised() if normalise else shape


def ball_polyhedron_and_frame(
    p: NDArray, big: NDArray, dilation: float, name: str
) -> tuple[BallPolyhedron, NDArray, NDArray]:
    """The shape in its body frame and in the unit of the balls p (n, 3), big (n,), and where it lies among them.

    Returns (shape, centre of mass (3,), rotation matrix (3, 3) from the body frame to the frame of the balls).
    """
    cell = cell_of_balls(p, big)
    volume, centroid, second = mass_of(cell, dilation)
    cell = cell.moved(np.eye(3), -centroid)
    second = second - volume * np.outer(centroid, centroid)
    inertia = np.trace(second) * np.eye(3) - second
    products = np.abs(inertia - np.diag(np.diag(inertia))).max()
    frame = np.eye(3)
    if products > 1e-9 * np.trace(inertia):
        _, frame = np.linalg.eigh(inertia)
        frame = frame * np.sign(np.linalg.det(frame))
        cell = cell.moved(frame.T, np.zeros(3))
        inertia = frame.T @ inertia @ frame
    return _shape(cell, dilation, volume, np.diag(inertia), name), centroid, frame


def corner_of_balls(p: NDArray, big: NDArray, dilation: float) -> float:
    """Least radius of the grain of the balls p (n, 3), big (n,), in its equivalent diameters: without its inertia."""
    cell = cell_of_balls(p, big)
    least = dilation if cell.edges else float(big.min()) + dilation
    return least * (np.pi / 6.0 / volume_of(cell, dilation)) ** (1.0 / 3.0)


def _shape(cell: Features, dilation: float, volume: float, inertia: NDArray, name: str) -> BallPolyhedron:
    """The shape of a cell that lies in its body frame."""
    one = len(cell.radius) == 1
    shape = BallPolyhedron(
        name=name,
        dim=3,
        measure=volume,
        inertia=inertia,
        bounding_radius=cell.farthest() + dilation,
        overlap_limit=float(cell.radius[0]) + dilation if one else dilation,
        lever=0.0,
        dilation=dilation,
        face_count=cell.faces,
        edge_count=cell.edges,
        vertex_count=cell.vertices,
        feature_centre=cell.centre,
        feature_radius=cell.radius + dilation,
        ring_axis=cell.axis,
        ring_radius=cell.rho,
        first_bound=cell.first_bound,
        bound=cell.bound,
        bound_offset=cell.offset,
        bound_next=cell.beyond,
    )
    n = np.concatenate([even_directions(SAMPLES), *shape.corner_normals()])
    lever = np.linalg.norm(np.cross(shape.support_points(n), n), axis=1).max()
    return replace(shape, lever=min(LEVER_MARGIN * lever, shape.bounding_radius))


def tangent_ball_polyhedron(
    points: ArrayLike,
    normals: ArrayLike,
    dilation: float,
    *,
    slack: float = SLACK,
    largest_radius: float = 10.0,
    name: str = "ball-polyhedron",
    normalise: bool = True,
) -> BallPolyhedron:
    """A rounded ball-polyhedron whose faces touch a convex target at given points.

    Parameters
    ----------
    points : array_like, (n, 3)
        Points of the target's surface, n >= 4, in any unit of length L.
    normals : array_like, (n, 3)
        Outward unit normals of the target there.
    dilation : float
        Radius > 0 that rounds edges and vertices [L].
    slack : float
        Radius of the ball of a face over the least that holds all other points.
    largest_radius : float
        Bound on the radius of the ball of a face, in sizes of the target.
    name : str
        What pictures and files call the shape.
    normalise : bool
        Whether to rescale to the equivalent diameter 1; else the unit L is kept.

    Returns
    -------
    BallPolyhedron
        The grain, in its body frame.

    Raises
    ------
    InputError
        As `ball_polyhedron`, and if normals are not unit vectors or there are fewer than 4.
    """
    x, n = number_array("points", points), number_array("normals", normals)
    if x.ndim != 2 or x.shape[1:] != (3,) or n.shape != x.shape or len(x) < 4:
        raise InputError(f"points and normals have shapes {x.shape}, {n.shape}: must be (n, 3), n >= 4, both")
    if np.any(np.abs(np.linalg.norm(n, axis=1) - 1.0) > 1e-9):
        raise InputError(f"normals have lengths {np.linalg.norm(n, axis=1)}: must be unit vectors")
    centres, radii = tangent_balls(x, n, dilation, slack, largest_radius)
    return ball_polyhedron(centres, radii, dilation, name=name, normalise=normalise)


def tangent_balls(
    points: NDArray, normals: NDArray, dilation: float, slack: float, largest_radius: float
) -> tuple[NDArray, NDArray]:
    """Centres (n, 3) and radii (n,) of the balls whose dilation touches the target: see `tangent_ball_polyhedron`."""
    x = points - dilation * normals
    size = 2.0 * np.linalg.norm(x - x.mean(axis=0), axis=1).max()
    radius = np.minimum(slack * least_tangent_radii(x, normals, size), largest_radius * size)
    return x - radius[:, None] * normals, radius


def ball_of_faces(count: int, dilation: float = 0.02, slack: float = SLACK) -> BallPolyhedron:
    """A ball-polyhedron with faces tangent to the sphere of diameter 1 at even directions.

    Parameters
    ----------
    count : int
        Number of faces, >= 4, or 1 for the sphere itself.
    dilation : float
        Radius that rounds edges and vertices [diameter], above 0 and below 0.5.
    slack : float
        Radius of the ball of a face over the least that holds the other tangent points.

    Returns
    -------
    BallPolyhedron
        Grain of equivalent diameter 1, body frame.

    Raises
    ------
    InputError
        For another number of faces or a dilation out of range.
    """
    if count == 1:
        return ball_polyhedron(np.zeros((1, 3)), [0.5 - dilation], dilation, name="sphere of 1 face")
    check_at_least("count", count, 4, ", or 1 for a sphere")
    n = even_directions(count)
    return tangent_ball_polyhedron(0.5 * n, n, dilation, slack=slack, name=f"sphere of {count} faces")
