"""True outlines and surfaces of the grains of a grains.nc, where they are at one time."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from ..shapes.patch_meshes import SurfaceMesh, mesh_of
from ..shapes.patch_outlines import outline_of
from ..shapes.patch_surfaces import PatchSurface
from ..statistics.run_parts import part_of, snapshot_at

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

COLUMNS = tuple(f"patch_{name}" for name in ("centre", "radius", "axis", "angle", "part", "edge_radius"))
NEEDED = ("shape_index", "shape_scale", "patch_count", *COLUMNS)


class GrainOutlines:
    """The outlines (2D) or surfaces (3D) of all grains of a run; those of a shape are made once.

    Parameters
    ----------
    dataset
        A grains.nc, as `open_run` gives it, or the tree of a run.

    Attributes
    ----------
    dim : int
        2 or 3.
    surfaces : list of PatchSurface
        Patches of each shape, body frame, in its length unit.

    Raises
    ------
    InputError
        If the dataset lacks what tells the shapes.
    """

    def __init__(self, dataset: Dataset | DataTree) -> None:
        dataset = part_of(dataset, "grains")
        missing = [name for name in NEEDED if name not in dataset]
        if missing:
            raise InputError(
                f"dataset: lacks {', '.join(missing)}, must be a grains.nc of this version, as lsm.open_run gives it"
            )
        self.dim = dataset.sizes["space"]
        index, ends = dataset.shape_index.values, np.cumsum(dataset.patch_count.values)
        columns = PatchSurface(*(dataset[name].values for name in COLUMNS))
        if ends[-1] != len(columns.radius) or not 0 <= index.min() <= index.max() < len(ends):
            raise InputError("patch_count, shape_index: do not belong together, the dataset is damaged")
        self.surfaces = [columns.rows(np.arange(i, j)) for i, j in zip([0, *ends[:-1]], ends, strict=True)]

    @cached_property
    def shapes(self) -> list[NDArray] | list[SurfaceMesh]:
        """Outline (k, 2) or mesh of each shape, body frame, in its length unit."""
        return [outline_of(s) for s in self.surfaces] if self.dim == 2 else [mesh_of(s) for s in self.surfaces]

    def vertices_of(self, shape: int) -> NDArray:
        """Vertices (k, dim) of a shape, body frame, in its length unit."""
        found = self.shapes[shape]
        return found.vertices if isinstance(found, SurfaceMesh) else found

    def around_centres(self, snapshot: Dataset) -> list[NDArray]:
        """Vertices (k, dim) [m] of each grain about its centre of mass, axes of the world frame.

        snapshot: one of the dataset, `dataset.isel(time=...)`, of all grains or of some, `.isel(grain=...)`.
        """
        matrices = rotation_matrices(snapshot)
        sizes = zip(snapshot.shape_index.values, snapshot.shape_scale.values, strict=True)
        bodies = [scale * self.vertices_of(shape) for shape, scale in sizes]
        return bodies if matrices is None else [x @ m.T for x, m in zip(bodies, matrices, strict=True)]


def rotation_matrices(snapshot: Dataset) -> NDArray | None:
    """Matrices (grain, dim, dim) that rotate the body frame into the world frame; None where no grain rotates."""
    if "orientation" not in snapshot:  # discs and spheres
        return None
    from scipy.spatial.transform import Rotation  # takes long to load

    dim = snapshot.sizes["space"]
    try:
        rotation = Rotation.from_quat(snapshot.orientation.values, scalar_first=True)
    except ValueError as error:
        raise InputError(f"orientation: holds what is no rotation ({error})") from None
    return rotation.as_matrix()[:, :dim, :dim]


def outlines(dataset: Dataset | DataTree, time: float | None = None) -> list[NDArray] | list[SurfaceMesh]:
    """The true surfaces of all grains at one time, in the world frame.

    Parameters
    ----------
    dataset
        A grains.nc, as `open_run` gives it, the tree of a run, or one snapshot, such as `dataset.isel(time=3)`.
    time
        Time [s]; the nearest snapshot is taken. None: the last one.

    Returns
    -------
    list of ndarray, (k, 2)
        2D: for each grain the vertices of its outline [m], counter-clockwise, the first not repeated. They lie on the
        surface; the area of the polygon is that of the grain within 0.1 %.
    list of SurfaceMesh
        3D: for each grain `vertices` (k, 3) [m] and `triangles` (t, 3) of its surface, whose volume is that of the
        grain within 0.1 %.

    Raises
    ------
    InputError
        If the dataset is no grains.nc of this version or has no snapshot, or a time is not a number.

    Notes
    -----
    Positions are those of the file, which are not wrapped into the cell. `GrainOutlines` keeps the surfaces of the
    shapes from one snapshot to the next.
    """
    made = GrainOutlines(dataset)
    snapshot = snapshot_at(part_of(dataset, "grains"), time)
    placed = [
        vertices + centre
        for vertices, centre in zip(made.around_centres(snapshot), snapshot.position.values, strict=True)
    ]
    if made.dim == 2:
        return placed
    triangles = [mesh.triangles for mesh in made.shapes if isinstance(mesh, SurfaceMesh)]
    return [SurfaceMesh(x, triangles[s]) for x, s in zip(placed, snapshot.shape_index.values, strict=True)]
