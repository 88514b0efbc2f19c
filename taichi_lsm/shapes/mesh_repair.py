"""Closed surfaces from the triangles of a mesh, whatever its unit, its origin, its seams and its small flaws.

Vertices at one place are one, whatever texture or normal they carry. Triangles without area and doubled ones are left
out. A surface that is still open is closed by merging the vertices of its open edges within a growing distance.
Neighbours are turned to agree, and every closed shell so that its normals point outwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..core.errors import InputError
from .base import counted

GAPS = (0.0, 1e-7, 1e-6, 1e-5, 1e-4)  # widths of the gaps that are closed, over the size of the mesh, until one does
NO_AREA = 1e-13  # of a triangle, over the squared size of the mesh
NO_VOLUME = 1e-12  # of a shell, over the cube of its own size
MOST_SHELLS = 1000


class Shell(NamedTuple):
    """A closed surface, its triangles counter-clockwise seen from outside: vertices (n, 3), triangles (t, 3)."""

    vertices: NDArray
    triangles: NDArray


class MendedMesh(NamedTuple):
    """Closed shells of a mesh, the largest first.

    Attributes
    ----------
    shells : list of Shell
        With vertices x about 0, whose greatest extent is 1: in the file they are at origin + size x.
    origin : ndarray, (3,)
        Middle of the mesh [unit of the file].
    size : float
        Its greatest extent [unit of the file].
    repairs : tuple of str
        What was mended.
    """

    shells: list[Shell]
    origin: NDArray
    size: float
    repairs: tuple[str, ...]


def mended(label: str, vertices: NDArray, triangles: NDArray) -> MendedMesh:
    """The closed shells of triangles (t, 3) of vertices (n, 3); InputError, which begins with `label`, if open."""
    used, triangles = np.unique(triangles, return_inverse=True)
    x, triangles = vertices[used], triangles.reshape(-1, 3)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        low, high = x.min(axis=0), x.max(axis=0)
        origin, size = 0.5 * low + 0.5 * high, float((high - low).max())
        x = (x - origin) / size
    if not (np.all(np.isfinite(vertices[used])) and np.isfinite(size)):
        raise InputError(f"{label}: {len(triangles)} triangles, must have finite vertices; export it anew")
    if not (size > 0.0 and np.all(np.isfinite(x))):
        raise InputError(f"{label}: volume 0, must be above 0; all its vertices lie at one place")
    triangles, repairs = _closed(label, x, triangles)
    turned, shell = _turned(label, triangles)
    shells, more = _outward_shells(label, x, triangles, turned, shell)
    return MendedMesh(shells, origin, size, (*repairs, *more))


def _closed(label: str, x: NDArray, triangles: NDArray) -> tuple[NDArray, list[str]]:
    """Triangles (t, 3) of merged vertices of which each edge has two, and what was mended; x (n, 3) over the size."""
    place = _row_numbers(x)
    first = np.unique(place, return_index=True)[1][place]  # the first vertex at each place stands for all
    at_place = first[triangles]
    repairs: list[str] = []
    for gap in GAPS:
        own = at_place
        if gap > 0.0:
            own = _merged_where_open(x, at_place, gap)
        kept, repairs = _without_flaws(x, own)
        edge, count = _edges(kept)
        if len(kept) and np.all(count == 2):
            if gap > 0.0:
                repairs.append(f"gaps of up to {gap:g} of its size closed")
            return kept, repairs
    kept, _ = _without_flaws(x, at_place)
    if not len(kept):
        raise InputError(f"{label}: volume 0, must be above 0; its triangles cover each other or have no area")
    _, count = _edges(kept)
    alone, crowded = int((count == 1).sum()), int((count > 2).sum())
    if alone:
        raise InputError(
            f"{label}: has holes (not watertight): {counted(alone, 'edge', 'edges')} of a single triangle; "
            "close it first, in a program for meshes such as MeshLab"
        )
    raise InputError(
        f"{label}: {counted(crowded, 'edge', 'edges')} of more than two triangles, where bodies touch or walls divide "
        "one; move them apart, or unite them, first"
    )


def _row_numbers(rows: NDArray) -> NDArray:
    """A number (n,) for each row (n, columns), the same for equal rows."""
    number = np.zeros(len(rows), np.int64)
    for column in rows.T:
        rank = np.unique(column, return_inverse=True)[1]
        number = np.unique(number * (int(rank.max(initial=0)) + 1) + rank, return_inverse=True)[1]
    return number


def _edges(triangles: NDArray) -> tuple[NDArray, NDArray]:
    """Number (t, 3) of the edge from each corner to the next, and of how many triangles each edge is one."""
    after = np.roll(triangles, -1, axis=1)
    key = np.minimum(triangles, after) * (int(triangles.max(initial=0)) + 1) + np.maximum(triangles, after)
    _, number, count = np.unique(key, return_inverse=True, return_counts=True)
    return number.reshape(-1, 3), count


def _merged_where_open(x: NDArray, triangles: NDArray, gap: float) -> NDArray:
    """The triangles with those vertices of open edges merged that are less than half the gap apart.

    Such two lie in one cell of at least one of eight grids, each half a cell off the others along some axes.
    """
    edge, count = _edges(triangles)
    corner, side = np.nonzero(count[edge] != 2)
    open_vertices = np.unique([triangles[corner, side], triangles[corner, (side + 1) % 3]])
    rows, columns = [], []
    for shift in np.ndindex(2, 2, 2):
        cell = _row_numbers(np.floor(x[open_vertices] / gap + 0.5 * np.array(shift)))
        rows.append(np.arange(len(cell)))
        columns.append(np.unique(cell, return_index=True)[1][cell])
    row, column = np.concatenate(rows), np.concatenate(columns)
    near = coo_array((np.ones(len(row), bool), (row, column)), (len(open_vertices), len(open_vertices)))
    _, place = connected_components(near, directed=False)
    stands_for = np.arange(len(x))
    stands_for[open_vertices] = open_vertices[np.unique(place, return_index=True)[1][place]]
    return stands_for[triangles]


def _without_flaws(x: NDArray, triangles: NDArray) -> tuple[NDArray, list[str]]:
    """The triangles without those that are a line or a point, and of doubled ones one, and what was left out.

    A triangle whose corners lie on a line stays if it is part of the closed surface, where it does no harm.
    """
    corners = np.sort(triangles, axis=1)
    areas = triangles[(corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])]
    a, b, c = (x[areas[:, i]] for i in range(3))
    flat = np.linalg.norm(np.cross(b - a, c - a), axis=1) < 2.0 * NO_AREA
    kept, doubled = _without_doubles(areas)
    if flat.any() and np.any(_edges(kept)[1] != 2):
        without, fewer = _without_doubles(areas[~flat])
        if len(without) and np.all(_edges(without)[1] == 2):
            kept, doubled, areas = without, fewer, areas[~flat]
    no_area = len(triangles) - len(areas)
    repairs = []
    if no_area:
        repairs.append(f"{counted(no_area, 'triangle', 'triangles')} without area left out")
    if doubled:
        repairs.append(f"{counted(doubled, 'doubled triangle', 'doubled triangles')} left out")
    return kept, repairs


def _without_doubles(triangles: NDArray) -> tuple[NDArray, int]:
    """The triangles with one of those of the same corners, or none if it stands out as a fin; how many went.

    One that is doubled by mistake has a neighbour at each edge, a fin has not.
    """
    number = _row_numbers(np.sort(triangles, axis=1))
    _, first, count = np.unique(number, return_index=True, return_counts=True)
    kept, doubled = triangles[np.sort(first)], (count > 1)[number[np.sort(first)]]
    if doubled.any():
        edge, faces = _edges(kept)
        kept = kept[~(doubled & np.any(faces[edge] == 1, axis=1))]
    return kept, len(triangles) - len(kept)


def _turned(label: str, triangles: NDArray) -> tuple[NDArray, NDArray]:
    """Which triangles (t,) to turn so that neighbours agree, and the number (t,) of the closed shell of each.

    Every triangle stands for two: as it is and turned. Neighbours that run along their edge in opposite senses agree as
    they are. If a triangle and its turned self hang together, its shell has one side only.
    """
    count = len(triangles)
    edge, _ = _edges(triangles)
    order = np.argsort(edge.ravel(), kind="stable")
    first, second = order[::2], order[1::2]
    up = (triangles < np.roll(triangles, -1, axis=1)).ravel()
    disagree = up[first] == up[second]
    one, other = first // 3, second // 3
    rows = np.concatenate([one, one + count])
    columns = np.concatenate([other + count * disagree, other + count * ~disagree])
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), (2 * count, 2 * count))
    _, side = connected_components(graph, directed=False)
    one_sided = int((side[:count] == side[count:]).sum())
    if one_sided:
        raise InputError(f"{label}: {one_sided} triangles cannot be turned so that neighbours agree on what is outside")
    shell = np.unique(np.minimum(side[:count], side[count:]), return_inverse=True)[1]
    leader = np.unique(shell, return_index=True)[1][shell]
    return side[:count] != side[leader], shell


def _outward_shells(
    label: str, x: NDArray, triangles: NDArray, turned: NDArray, shell: NDArray
) -> tuple[list[Shell], list[str]]:
    """The shells, the largest first, each of positive volume, and what was mended."""
    count = int(shell.max()) + 1
    if count > MOST_SHELLS:
        raise InputError(f"{label}: {count} bodies, must be at most {MOST_SHELLS}; remove specks, or split the file")
    triangles = np.where(turned[:, None], triangles[:, ::-1], triangles)
    found, without_volume, flipped, inside_out = [], 0, 0, 0
    order = np.argsort(shell, kind="stable")
    for own in np.split(order, np.cumsum(np.bincount(shell))[:-1]):
        used, corners = np.unique(triangles[own], return_inverse=True)
        vertices, corners = x[used], corners.reshape(-1, 3)
        a, b, c = (vertices[corners[:, i]] - vertices.mean(axis=0) for i in range(3))
        volume = float(np.sum(a * np.cross(b, c)) / 6.0)
        if not abs(volume) > NO_VOLUME * np.ptp(vertices, axis=0).max() ** 3:
            without_volume += 1
            continue
        changed = int(turned[own].sum()) if volume > 0 else len(own) - int(turned[own].sum())
        inside_out += changed == len(own)
        flipped += changed if changed < len(own) else 0
        found.append((abs(volume), Shell(vertices, corners if volume > 0 else corners[:, ::-1])))
    if not found:
        raise InputError(f"{label}: volume 0, must be above 0")
    repairs = []
    if flipped:
        repairs.append(f"{counted(flipped, 'triangle', 'triangles')} turned over")
    if inside_out:
        repairs.append(f"{counted(inside_out, 'body that was', 'bodies that were')} inside out turned")
    if without_volume:
        repairs.append(f"{counted(without_volume, 'sheet', 'sheets')} without volume left out")
    return [body for _, body in sorted(found, key=lambda item: -item[0])], repairs
