"""Closed meshes that tests of imported grains share."""

import numpy as np
import trimesh


def _stone():
    """An irregular convex body with a broken-off, flat end."""
    points = np.random.default_rng(2).normal(size=(40, 3))
    points *= np.array([1.0, 0.8, 0.6]) / np.linalg.norm(points, axis=1, keepdims=True)
    points[:, 0] = np.minimum(points[:, 0], 0.7)
    return trimesh.convex.convex_hull(points)


BODIES = {
    "sphere": trimesh.creation.icosphere(subdivisions=2),
    "brick": trimesh.creation.box((1.0, 2.0, 3.0)),
    "stone": _stone(),
}


def soup(mesh):
    """Vertices and triangles of a mesh in which no two triangles share a vertex, as in an STL file."""
    x = np.asarray(mesh.vertices)[np.asarray(mesh.faces)].reshape(-1, 3)
    return x, np.arange(len(x)).reshape(-1, 3)


# A box of 1 x 2 x 3 by its six sides, as rows of 8 corners.
CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
NORMALS = [(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)]


def obj_of_quads(texture):
    """OBJ text of the box; with texture and normals every side has corners, and a material, of its own."""
    lines = ["mtllib none.mtl", *(f"v {x} {y} {z}" for x, y, z in CORNERS)]
    if texture:
        lines += [f"vt {u} {v}" for u in (0, 0.5, 1) for v in (0, 1)] + [f"vn {x} {y} {z}" for x, y, z in NORMALS]
    for i, side in enumerate(SIDES):
        corners = [f"{k + 1}/{1 + (i + j) % 6}/{i + 1}" if texture else f"{k + 1}" for j, k in enumerate(side)]
        lines += [f"usemtl side{i}", f"f {' '.join(corners)}"]
    return "\n".join(lines)


def ply_of_quads(kind):
    """PLY text of the box with vertices of this type."""
    head = ["ply", "format ascii 1.0", "element vertex 8", *(f"property {kind} {c}" for c in "xyz")]
    head += ["element face 6", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(str, x)) for x in CORNERS] + ["4 " + " ".join(map(str, side)) for side in SIDES]
    return "\n".join([*head, *rows]) + "\n"
