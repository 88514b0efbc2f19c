"""Triangles of a mesh: from a file (STL, PLY, OBJ), which may come from anyone, or from a `trimesh.Trimesh`."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError, reason

if TYPE_CHECKING:
    import trimesh

MOST_TRIANGLES = 1_000_000
MOST_BYTES = 300_000_000  # of a file: so many triangles in text
FORMATS = ("stl", "ply", "obj")


def triangles_of(mesh: str | PathLike[str] | trimesh.Trimesh) -> tuple[str, NDArray, NDArray]:
    """What messages call the mesh, its vertices (n, 3) and triangles (t, 3), as they are; InputError names the file."""
    import trimesh

    if isinstance(mesh, trimesh.Trimesh):
        label, pieces = "mesh", [(mesh.vertices, mesh.faces)]
    else:
        try:
            path = Path(mesh)
        except TypeError:
            raise InputError(f"mesh = {mesh!r}: must be a file or a trimesh.Trimesh") from None
        label, pieces = f"mesh {path}", _read(path)
    # Objects and materials of one file are pieces of their own: one after the other they are its surface.
    try:
        given = [np.asarray(x, np.float64).reshape(-1, 3) for x, _ in pieces]
        first = np.cumsum([0, *map(len, given)])
        corners = [np.asarray(t, np.int64).reshape(-1, 3) + n for (_, t), n in zip(pieces, first[:-1], strict=True)]
        vertices, triangles = np.concatenate(given), np.concatenate(corners)
    except ValueError as error:
        raise InputError(f"{label}: holds no triangles of points in space ({reason(error)})") from None
    if len(triangles) > MOST_TRIANGLES:
        raise InputError(f"{label}: {len(triangles)} triangles, must be at most {MOST_TRIANGLES}; simplify it first")
    if len(triangles) < 4:
        raise InputError(f"{label}: {len(triangles)} triangles, must be at least 4")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"{label}: triangles name vertices that are not there; export it anew")
    return label, vertices, triangles


def _read(path: Path) -> list[tuple[NDArray, NDArray]]:
    """Vertices and triangles of the meshes of a file.

    Unprocessed: the reader would merge vertices that are less than 1e-8 apart, in whatever unit.
    """
    import trimesh

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
            if kind == "obj":
                scene = trimesh.load_scene(file, file_type=kind, process=False, skip_materials=True)
            else:
                scene = trimesh.load_scene(file, file_type=kind, process=False)
            meshes = [m for m in scene.geometry.values() if isinstance(m, trimesh.Trimesh)]
    except Exception as error:  # each reader has errors of its own
        raise InputError(f"mesh {path}: cannot be read ({reason(error)})") from None
    if not meshes:
        raise InputError(f"mesh {path}: holds no triangle mesh")
    return [(np.asarray(m.vertices), np.asarray(m.faces)) for m in meshes]
