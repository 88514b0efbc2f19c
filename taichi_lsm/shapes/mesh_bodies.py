"""The bodies of a mesh: split, and refused if they overlap or lie in each other."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import InputError
from .mesh_files import triangles_of
from .mesh_repair import MendedMesh, Shell, mended

if TYPE_CHECKING:
    import trimesh

COMMON = 1e-6  # of the volume of the smaller body: less is rounding where bodies touch


def bodies_of_mesh(mesh: str | PathLike[str] | trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """The bodies of a mesh, repaired, the largest first: `from_mesh` makes a grain of each.

    Parameters
    ----------
    mesh : path or trimesh.Trimesh
        File (STL, PLY, OBJ) or mesh in any unit of length, of at most 1000 closed bodies.

    Returns
    -------
    list of trimesh.Trimesh
        Closed meshes in the frame and unit of the file, their triangles counter-clockwise seen from outside.

    Raises
    ------
    InputError
        As `from_mesh`, and if two bodies overlap or one lies within another.
    """
    import trimesh

    label, vertices, triangles = triangles_of(mesh)
    found = mended(label, vertices, triangles)
    check_apart(label, found.shells)
    return [
        trimesh.Trimesh(found.origin + found.size * shell.vertices, shell.triangles, process=False)
        for shell in found.shells
    ]


def chosen_body(label: str, found: MendedMesh, body: int | None) -> Shell:
    """The body of this number, or the only one; InputError if there are several and none was chosen."""
    count = len(found.shells)
    if body is None:
        if count > 1:
            check_apart(label, found.shells)
            raise InputError(
                f"{label}: holds {count} bodies; body=0 takes the largest, body={count - 1} the smallest, "
                "bodies_of_mesh gives all"
            )
        return found.shells[0]
    if not (isinstance(body, int | np.integer) and 0 <= body < count):
        raise InputError(f"body = {body!r}: must be a number from 0 to {count - 1}, as {label} holds {count}")
    return found.shells[body]


def check_apart(label: str, shells: list[Shell]) -> None:
    """Refuse bodies that overlap or nest, naming two that do; those whose boxes are apart need no library."""
    low = np.array([s.vertices.min(axis=0) for s in shells])
    high = np.array([s.vertices.max(axis=0) for s in shells])
    near = np.all((low[:, None] < high) & (low < high[:, None]), axis=2)
    if np.count_nonzero(near) == len(shells):  # each is near itself
        return
    try:
        import manifold3d
    except ImportError:
        raise InputError(
            f"{label}: whether its {len(shells)} bodies overlap needs manifold3d, which is not installed; "
            "pip install 'taichi-lsm[export]', or choose one with body="
        ) from None
    solids = [_solid(manifold3d, shell) for shell in shells]

    def apart(last: int) -> bool:
        """Whether no two of the first bodies share a volume: that of their union is the sum of theirs."""
        total = sum(s.volume() for s in solids[:last])
        united = manifold3d.Manifold.batch_boolean(solids[:last], manifold3d.OpType.Add).volume()
        return total - united < COMMON * solids[last - 1].volume()

    most, least = len(shells), 1
    if apart(most):
        return
    while most - least > 1:  # the first body that overlaps one before it
        middle = (least + most) // 2
        least, most = (middle, most) if apart(middle) else (least, middle)
    j = most - 1
    for i in np.flatnonzero(near[j, :j]):
        shared = (solids[i] ^ solids[j]).volume()
        if shared > COMMON * solids[j].volume():
            nested = shared > (1.0 - COMMON) * solids[j].volume()
            how = f"body {j} lies within body {i}" if nested else f"bodies {i} and {j} overlap"
            raise InputError(
                f"{label}: {how} (numbered from 0, the largest first); unite them or remove one, "
                f"or choose one with body={i} or body={j}"
            )


def _solid(manifold3d: Any, shell: Shell) -> Any:
    """The solid of a closed shell."""
    vertices = np.ascontiguousarray(shell.vertices)
    mesh = manifold3d.Mesh64(vert_properties=vertices, tri_verts=np.ascontiguousarray(shell.triangles, np.uint64))
    return manifold3d.Manifold(mesh)
