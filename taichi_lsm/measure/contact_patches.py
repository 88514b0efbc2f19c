"""Which patch of its grain's shape a contact lies on, from the features that the contact geometry remembers."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..shapes import GrainShape
from ..shapes.ball_polyhedron import BallPolyhedron
from ..shapes.base import ConvexPart

UNKNOWN = -1  # on an edge of a ball-polyhedron, which has no patch, or not remembered


class PatchTable:
    """Patches of the features of all shapes, as `patch_surface` lists them: the parts of a shape one after the other.

    Parameters
    ----------
    shapes : sequence of GrainShape
        Shapes of a scene.
    """

    def __init__(self, shapes: Sequence[GrainShape]) -> None:
        found: list[npt.NDArray] = []
        first: list[int] = []  # row of `patch` at which a part begins
        for shape in shapes:
            patches = 0
            for part in shape.parts:
                first.append(sum(map(len, found)))
                found.append(np.where(patches_of(part) >= 0, patches + patches_of(part), UNKNOWN))
                patches += part.patch_count
        self.patch, self.first = np.concatenate(found), np.array(first)
        self.first_part = np.cumsum([0, *(len(shape.parts) for shape in shapes)])[:-1]

    def of(self, shape: npt.NDArray, part: npt.NDArray, feature: npt.NDArray) -> npt.NDArray:
        """Patches (n,) of features (n,) of the parts (n,) of shapes (n,); UNKNOWN of a feature that is negative."""
        row = self.first[self.first_part[shape] + part] + np.maximum(feature, 0)
        return np.where(feature >= 0, self.patch[row], UNKNOWN).astype(np.int32)


def patches_of(part: ConvexPart) -> npt.NDArray:
    """Patch of each feature of one part; of a ball-polyhedron faces, edges and vertices, of which edges have none."""
    if not isinstance(part, BallPolyhedron):
        return np.arange(part.patch_count)
    edges = np.full(part.edge_count, UNKNOWN)
    return np.concatenate([np.arange(part.face_count), edges, part.face_count + np.arange(part.vertex_count)])
