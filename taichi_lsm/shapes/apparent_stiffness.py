"""How stiff the surface of a union is to a small ball pressed into it: where parts resist together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arc_chain import ArcChain
from .ball_polyhedron import BallPolyhedron
from .geometry import even_directions, unit_normals
from .union import ball_about

PROBE_RADIUS = 0.1  # equivalent diameters
PROBE_DEPTH = 1e-3  # equivalent diameters
SAME_NORMAL = np.radians(10.0)  # contacts whose normals differ by more are two contacts, as in any re-entrant corner
DOUBLED = 1.1  # stiffness that counts as more than one contact
GRID = {2: 720, 3: 1500}  # directions among which that of the nearest point is sought first
SHRINK, ROUNDS = 0.45, 11  # of the steps that refine it
DEEP = 0.05  # equivalent diameters: what lies deeper in a part than this, by the grid, lies in it
OUTLINE_POINTS = 1000  # of a part in 2D
SOLID_POINTS = 1000  # of a part in 3D
MESH_POINTS = 1000  # of the mesh that they lie on
LONGEST_SIDE = 0.1  # equivalent diameters, of a triangle of a part in 3D

Part = ArcChain | BallPolyhedron


class ApparentStiffness(NamedTuple):
    """Stiffness of a union along its outer surface, over that of one contact.

    Attributes
    ----------
    least, greatest : float
        Where the ball rests on one part, or on parts whose normals agree within 10 degrees.
    doubled_share : float
        Share of the outer surface where that stiffness is above 1.1.
    junction_share : float
        Share of the outer surface where the ball rests on parts with different normals: beside re-entrant corners.
    """

    least: float
    greatest: float
    doubled_share: float
    junction_share: float


def apparent_stiffness(
    members: Sequence[Part], radius: float = PROBE_RADIUS, depth: float = PROBE_DEPTH
) -> ApparentStiffness:
    """Stiffness along the outer surface of a union of parts.

    Parameters
    ----------
    members : sequence of ArcChain or BallPolyhedron
        The parts, of a union of equivalent diameter 1.
    radius, depth : float
        Radius of the ball (2D: disc) and the depth by which it is pressed in [diameter].

    Returns
    -------
    ApparentStiffness
        Least and greatest stiffness, and where it is not that of one contact.

    Notes
    -----
    The ball is pressed in along the normal n of the part whose surface is the outer one. The stiffness is the sum over
    the parts of d_p (n_p . n)/depth, with d_p their depths and n_p their normals. Places that the ball cannot reach,
    because another part is in the way, are left out.
    """
    stiffness, junction, weight = [], [], []
    bounds = [ball_about(part) for part in members]
    for own, part in enumerate(members):
        x, n, share = _surface(part)
        # The points lie near the surface only: a point before it tells where it is, and its normal.
        near = x + radius * n
        gap, n = _refined(part, near, n)
        centre = near + (radius - depth - gap)[:, None] * n
        total, apart, outer = np.ones(len(x)), np.zeros(len(x), bool), np.ones(len(x), bool)
        for other, another in enumerate(members):
            if other != own:
                middle, reach = bounds[other]
                rows = np.flatnonzero(outer & (np.linalg.norm(centre - middle, axis=1) < reach + radius))
                if not len(rows):
                    continue
                gap, normal = nearest(another, centre[rows], radius)
                d, agree = (radius - gap) / depth, np.sum(normal * n[rows], axis=1)
                outer[rows] = d < 1.0 + 1e-3
                apart[rows] |= (d > 0.0) & (agree < np.cos(SAME_NORMAL))
                total[rows] += np.where(d > 0.0, d * agree, 0.0)
        stiffness.append(total[outer])
        junction.append(apart[outer])
        weight.append(share[outer])
    value, apart, share = np.concatenate(stiffness), np.concatenate(junction), np.concatenate(weight)
    share = share / share.sum()
    single = value[~apart]
    return ApparentStiffness(
        least=float(single.min()),
        greatest=float(single.max()),
        doubled_share=float(share[~apart][single > DOUBLED].sum()),
        junction_share=float(share[apart].sum()),
    )


def _surface(part: Part) -> tuple[NDArray, NDArray, NDArray]:
    """Points (k, dim) close to the surface of a part, outward normals there (k, dim), and lengths or areas (k,)."""
    if isinstance(part, ArcChain):
        x = part.outline(OUTLINE_POINTS)
        along = np.diff(x, axis=0)
        length = np.linalg.norm(along, axis=1)
        # Flat sides have few points: what is long is cut into equal pieces.
        count = np.maximum(1, np.ceil(length * OUTLINE_POINTS / length.sum())).astype(int)
        row = np.repeat(np.arange(len(length)), count)
        step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        n = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
        return x[row] + ((step + 0.5) / count[row])[:, None] * along[row], n[row], (length / count)[row]
    import trimesh

    vertices, triangles = trimesh.remesh.subdivide_to_size(*part.mesh(MESH_POINTS), LONGEST_SIDE)[:2]
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    # Places that are even over the area: of small triangles most are left out.
    reached = np.cumsum(length)
    places = (np.arange(SOLID_POINTS) + 0.5) / SOLID_POINTS * reached[-1]
    row, count = np.unique(np.searchsorted(reached, places), return_counts=True)
    area = 0.5 * count * reached[-1] / SOLID_POINTS
    return ((a + b + c) / 3.0)[row], across[row] / length[row, None], area


def nearest(part: Part, x: NDArray, within: float) -> tuple[NDArray, NDArray]:
    """Signed distance (k,) of points (k, dim) from a convex part, and the normal (k, dim) of its nearest point.

    max over n of n . x - h(n), h the support function; refined only where it is a little below `within`.
    """
    n = _directions(part)
    value = x @ n.T - part.support(n)
    best = np.argmax(value, axis=1)
    gap, normal = value[np.arange(len(x)), best], n[best]
    near = (gap < within) & (gap > within - DEEP)
    if near.any():
        gap[near], normal[near] = _refined(part, x[near], normal[near])
    return gap, normal


def _directions(part: Part) -> NDArray:
    """Normals among which the nearest point of a part is sought: even ones, and in 3D those of its faces."""
    if isinstance(part, ArcChain):
        return unit_normals(2.0 * np.pi * np.arange(GRID[2]) / GRID[2])
    return np.concatenate([even_directions(GRID[3]), part._directions()])


def _refined(part: Part, x: NDArray, n: NDArray) -> tuple[NDArray, NDArray]:
    """As `nearest`, by steps of falling width about the normals n (k, dim)."""
    width = 4.0 / np.sqrt(GRID[3]) if part.dim == 3 else 2.0 * np.pi / GRID[2]
    steps = np.array(np.meshgrid(*[(-1.0, 0.0, 1.0)] * (part.dim - 1))).reshape(part.dim - 1, -1).T
    rows, gap = np.arange(len(x)), np.zeros(len(x))
    for _ in range(ROUNDS):
        tangents = _tangents(n)
        tried = n[:, None] + width * np.einsum("sj,kjd->ksd", steps, tangents)
        tried /= np.linalg.norm(tried, axis=2, keepdims=True)
        support = part.support(tried.reshape(-1, part.dim)).reshape(tried.shape[:2])
        value = np.einsum("ksd,kd->ks", tried, x) - support
        best = np.argmax(value, axis=1)
        n, gap = tried[rows, best], value[rows, best]
        width *= SHRINK
    return gap, n


def _tangents(n: NDArray) -> NDArray:
    """Unit vectors (k, dim - 1, dim) square to unit vectors n (k, dim), and to each other."""
    if n.shape[1] == 2:
        return np.stack([-n[:, 1], n[:, 0]], axis=1)[:, None]
    away = np.where(np.abs(n[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(n, away)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(n, first)], axis=1)
