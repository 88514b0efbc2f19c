"""Convex solids grown into each other, so that rounding takes nothing from the outside of a grain (3D).

What `grown_parts` does with polygons, for the convex hulls of a decomposition: the faces on the outer surface touch
their hull, cuts are moved out by `push`, and where a cut ends at a smooth place of the surface, the faces of the
smaller part are tilted, so that they lie below the end of its neighbour by DRAWN_IN there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
import trimesh
from numpy.typing import NDArray

from .apparent_stiffness import nearest
from .ball_polyhedron import BallPolyhedron
from .dilated_balls import SLACK
from .geometry import even_directions, least_tangent_radii
from .grown_parts import PUSH
from .meshes import COPLANAR, FLATTEST, SMALLEST_FACE

DRAWN_IN = 0.01  # equivalent diameters: by which faces lie below the end of the part beside them
STEEPEST = 0.3  # slope of a face that is drawn in
LEAST_TURN = 0.3  # sine of the angle between a face and a cut that it ends at
TOUCH = 0.02  # equivalent diameters: what is nearer to a cut ends there
REACH = 0.03  # equivalent diameters, within which distances from a part are exact
AHEAD = 0.01  # equivalent diameters before a facet, where another part shows that it is a cut
ABOVE = 0.03  # equivalent diameters above a face, where another part shows a re-entrant corner
LONGEST_SIDE = 0.1  # equivalent diameters, of the triangles that tell cuts from faces
CUT_SHARE = 0.9  # of a plane's area that lies in other parts, if it is a cut


@dataclass
class Solid:
    """A convex solid: its hull, and planes with normals (m, 3) and a point on each (m, 3).

    cut (m,): which planes are cuts, towards the solid `beside` (m,), -1 for faces; bulging: whether faces are balls
    that just hold the solid, else they are almost flat. facets: those of the hull that each plane stands for; offset
    (m,): by which faces are moved out; tilted (m,): which faces are drawn in.
    """

    hull: trimesh.Trimesh
    half_spaces: NDArray
    normal: NDArray
    point: NDArray
    beside: NDArray
    bulging: bool
    facets: list[NDArray]
    offset: NDArray
    tilted: NDArray

    def holds(self, x: NDArray) -> NDArray:
        """Which points (k, 3) lie inside."""
        return (x @ self.half_spaces[:, :3].T + self.half_spaces[:, 3]).max(axis=1) < 0.0

    @property
    def cut(self) -> NDArray:
        """Which planes are cuts (m,)."""
        return self.beside >= 0

    def balls(self, radius: float, push: float, slack: float = SLACK) -> tuple[NDArray, NDArray]:
        """Centres (m, 3) and radii (m,) of balls whose common part, dilated by `radius`, is the grown part.

        push: by which cuts are moved out; slack: radius of a bulging face over the least that holds the solid.
        """
        n = self.normal
        x = self.point + np.where(self.cut, push, self.offset)[:, None] * n - radius * n
        size = 2.0 * float(np.linalg.norm(self.hull.vertices - self.hull.vertices.mean(axis=0), axis=1).max())
        big = np.full(len(n), FLATTEST * size)
        if self.bulging:
            big[~self.cut] = np.minimum(big, slack * least_tangent_radii(x, n, size))[~self.cut]
        return x - big[:, None] * n, big

    def follow(self, part: BallPolyhedron) -> None:
        """Move the faces by the mean distance of their facets from the rounded part, less what they are drawn in."""
        x, area = self.hull.triangles_center, self.hull.area_faces
        gap = nearest(part, x, REACH)[0]
        for f in np.flatnonzero(~self.cut):
            own = self.facets[f]
            self.offset[f] += area[own] @ gap[own] / area[own].sum() - (0.5 * DRAWN_IN if self.tilted[f] else 0.0)


def grown_solids(hulls: list[trimesh.Trimesh], faces: int, radius: float) -> list[Solid]:
    """Solids with at most `faces` faces each, and their cuts, of hulls in units of the equivalent diameter."""
    half_spaces = [scipy.spatial.ConvexHull(hull.vertices).equations for hull in hulls]
    solids = [_solid(own, hull, half_spaces, faces) for own, hull in enumerate(hulls)]
    for own in range(len(solids)):
        _draw_in(own, solids, radius)
    return solids


def _solid(own: int, hull: trimesh.Trimesh, half_spaces: list[NDArray], faces: int) -> Solid:
    """The planes of one hull among others."""
    beside = _facing(own, hull, half_spaces)
    area = hull.area_faces
    rows = [f for f in np.argsort(-area, kind="stable") if area[f] > 0.0]
    groups = _coplanar(hull, rows)
    # A plane is a cut if nearly all of it lies against other parts.
    planes, free = [], []
    for group in groups:
        inner = beside[group] >= 0
        if area[group][inner].sum() > CUT_SHARE * area[group].sum():
            planes.append((group, int(np.bincount(beside[group][inner], area[group][inner]).argmax())))
        else:
            free.append(group)
    large = [g for g in free if area[g].sum() > SMALLEST_FACE * hull.area]
    bulging = len(large) > faces
    if bulging:
        large = _clusters(hull, np.concatenate(free), faces)
    normal, point, towards = [], [], []
    for group, other in [*((g, -1) for g in large), *planes]:
        n = area[group] @ hull.face_normals[group]
        n /= np.linalg.norm(n)
        x = area[group] @ hull.triangles_center[group] / area[group].sum()
        x += ((hull.vertices @ n).max() - x @ n) * n
        if bulging and other < 0:
            x = hull.vertices[np.argmax(hull.vertices @ n)]
        normal.append(n)
        point.append(x)
        towards.append(other)
    return Solid(
        hull=hull,
        half_spaces=half_spaces[own],
        normal=np.array(normal),
        point=np.array(point),
        beside=np.array(towards),
        bulging=bulging,
        facets=[*large, *(group for group, _ in planes)],
        offset=np.zeros(len(normal)),
        tilted=np.zeros(len(normal), bool),
    )


def _facing(own: int, hull: trimesh.Trimesh, half_spaces: list[NDArray]) -> NDArray:
    """The other hull (facets,) that lies before most of each facet, -1 for none."""
    finer: Any = trimesh.remesh.subdivide_to_size(hull.vertices, hull.faces, LONGEST_SIDE, return_index=True)
    vertices, triangles, origin = finer
    corners = vertices[triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    x = corners.mean(axis=1) + AHEAD * hull.face_normals[origin]
    weight = np.zeros((len(half_spaces), len(hull.faces)))
    for other, planes in enumerate(half_spaces):
        if other != own:
            inside = (x @ planes[:, :3].T + planes[:, 3]).max(axis=1) < 0.0
            np.add.at(weight[other], origin[inside], area[inside])
    most = weight.argmax(axis=0)
    return np.where(weight.sum(axis=0) > 0.5 * hull.area_faces, most, -1)


def _coplanar(hull: trimesh.Trimesh, rows: list[int]) -> list[NDArray]:
    """Facets in groups that are coplanar within COPLANAR, the largest first."""
    rest, groups = np.array(rows), []
    while len(rest):
        same = hull.face_normals[rest] @ hull.face_normals[rest[0]] > np.cos(COPLANAR)
        groups.append(rest[same])
        rest = rest[~same]
    return groups


def _clusters(hull: trimesh.Trimesh, rows: NDArray, faces: int) -> list[NDArray]:
    """Facets in at most `faces` groups of near normals."""
    facing, area = hull.face_normals[rows], hull.area_faces[rows]
    n = even_directions(2 * faces)
    for size in (2 * faces, faces):  # of even directions, those that facets are nearest to; then as many as asked for
        for _ in range(8):
            nearest = np.argmax(facing @ n.T, axis=1)
            total = np.zeros_like(n)
            np.add.at(total, nearest, area[:, None] * facing)
            length = np.linalg.norm(total, axis=1)
            n = total[length > 0] / length[length > 0, None]
            if len(n) > size:
                n = n[np.argsort(-length[length > 0], kind="stable")[:size]]
    nearest = np.argmax(facing @ n.T, axis=1)
    return [rows[nearest == k] for k in range(len(n)) if np.any(nearest == k)]


def _draw_in(own: int, solids: list[Solid], radius: float) -> None:
    """Tilt the faces of a solid beside its cuts towards larger ones, where the surface is smooth there."""
    solid = solids[own]
    for c in np.flatnonzero(solid.cut):
        other = int(solid.beside[c])
        if (solids[other].hull.volume, other) < (solid.hull.volume, own):
            continue
        out, level = solid.normal[c], float(solid.normal[c] @ solid.point[c])
        for f in np.flatnonzero(~solid.cut):
            n = solid.normal[f]
            along = out - (out @ n) * n
            own_points = solid.hull.vertices[np.unique(solid.hull.faces[solid.facets[f]])]
            rim = own_points[own_points @ out > level - TOUCH]
            if len(rim) < 2 or np.linalg.norm(along) < LEAST_TURN:
                continue
            along /= np.linalg.norm(along)
            end = rim.mean(axis=0)
            # The neighbour stands above a re-entrant corner, and does not reach a free edge.
            high, low = solids[other].holds(np.array([end + ABOVE * (n + along), end + ABOVE * (along - n)]))
            if high or not low:
                continue
            extent = float((end @ along) - (own_points @ along).min())
            slope = min(DRAWN_IN / max(extent, 1e-9), STEEPEST)
            end = end - (PUSH - 1.0) * radius * along - DRAWN_IN * n
            tilted = (n + slope * along) / np.sqrt(1.0 + slope**2)
            x = solid.point[f]
            solid.normal[f], solid.tilted[f] = tilted, True
            solid.point[f] = x + ((end - x) @ tilted) * tilted
