"""The fragments of breakable grains, one by one, from the snapshots of a run: masses, sizes, shapes, new surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from ..core.errors import InputError
from ..shapes.geometry import polygon_integrals
from ..shapes.patch_outlines import points_of_arcs
from ..shapes.patch_surfaces import PatchSurface
from ..statistics.run_parts import part_of

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

NEEDED = ("bond_first", "bond_second", "bond_area", "bond_intact", "orientation", "shear_strain")
ROWS = {  # name: (unit, meaning)
    "mass": ("kg", "mass"),
    "diameter": ("m", "diameter of the disc of equal area (2D) or of the sphere of equal volume (3D)"),
    "pieces": ("1", "number of bonded pieces"),
    "parent": ("1", "number of the grain that it was a part of at the start"),
    "new_surface": ("m2", "area of the broken bonds of its pieces: half of it faces another fragment or itself"),
    "elongation": ("1", "intermediate over longest axis (3D), shortest over longest axis (2D)"),
    "flatness": ("1", "shortest over intermediate axis (3D)"),
    "compactness": ("1", "moment of inertia of the disc or sphere of equal size over its own"),
}
IN_TIME = {"time": ("s", "time of the snapshot"), "shear_strain": ("1", "shear strain at that time")}


def fragment_catalogue(grains: Dataset | DataTree) -> Dataset:
    """All fragments in all snapshots of a run.

    Parameters
    ----------
    grains
        What `open_run` gives of the folder, or of the grains.nc, of a run of breakable grains.

    Returns
    -------
    Dataset
        Dimension fragment, snapshot after snapshot; pieces that intact bonds join, directly or through others, are one
        fragment. Variables are those of `ROWS`; coordinates time [s], shear_strain [1] and snapshot, the number of the
        snapshot from 0 on.

    Raises
    ------
    InputError
        If the file has no bonds.

    Notes
    -----
    Axes are those of the ellipsoid of equal second moments, a_i ~ sqrt(S_ii) with S the principal second moments about
    the centre of mass, of the pieces about their own centres and of these about that of the fragment.
    """
    import xarray

    grains = part_of(grains, "grains")
    missing = [name for name in NEEDED if name not in grains.variables]
    if missing:
        raise InputError(f"grains: has no {', '.join(missing)}, must be the grains.nc of a run of breakable grains")
    mobile = np.flatnonzero(grains.kind.values == 0)
    first, second = (np.searchsorted(mobile, grains[f"bond_{end}"].values) for end in ("first", "second"))
    everywhere = np.ones(len(first), bool)
    _, parent = _joined(first, second, everywhere, len(mobile))
    body = _body_moments(grains)[mobile]
    columns: dict[str, list[NDArray]] = {}
    for t in range(grains.sizes["time"]):
        intact = grains.bond_intact.values[t] == 1
        count, label = _joined(first, second, intact, len(mobile))
        surface = np.zeros(count)
        for end in (first, second):
            np.add.at(surface, label[end[~intact]], grains.bond_area.values[~intact])
        found = {"pieces": np.bincount(label), "new_surface": surface, "snapshot": np.full(count, t)}
        found |= _of_snapshot(grains.isel(time=t, grain=mobile), body, label, count)
        found["parent"] = parent[np.unique(label, return_index=True)[1]]
        found |= {name: np.full(count, float(grains[name].values[t])) for name in IN_TIME}
        for name, values in found.items():
            columns.setdefault(name, []).append(values)
    whole = {name: np.concatenate(values) for name, values in columns.items()}
    data = {
        name: ("fragment", whole[name], {"units": unit, "long_name": words})
        for name, (unit, words) in ROWS.items()
        if name in whole
    }
    coords = {
        name: ("fragment", whole[name], {"units": unit, "long_name": words}) for name, (unit, words) in IN_TIME.items()
    }
    coords["snapshot"] = ("fragment", whole["snapshot"], {"units": "1", "long_name": "number of the snapshot"})
    return xarray.Dataset(data, coords)


def _joined(first: NDArray, second: NDArray, intact: NDArray, count: int) -> tuple[int, NDArray]:
    """Number of fragments, and the fragment (count,) of each piece."""
    ends = first[intact], second[intact]
    links = coo_array((np.ones(len(ends[0])), ends), shape=(count, count))
    return connected_components(links, directed=False)


def _of_snapshot(grains: Dataset, body: NDArray, label: NDArray, count: int) -> dict[str, NDArray]:
    """Masses, sizes and shapes of the fragments of one snapshot, from the pieces alone.

    body: second moments (n, dim, dim) [kg m2] of the pieces, body frame; label: fragment of each.
    """
    position, mass = grains.position.values, grains.mass.values
    dim = position.shape[1]
    total = np.bincount(label, mass)
    centre = np.stack([np.bincount(label, mass * x) for x in position.T], axis=1) / total[:, None]
    rotation = Rotation.from_quat(grains.orientation.values, scalar_first=True).as_matrix()[:, :dim, :dim]
    arm = position - centre[label]
    own = rotation @ body @ rotation.transpose(0, 2, 1) + mass[:, None, None] * arm[:, :, None] * arm[:, None]
    second = np.zeros((count, dim, dim))
    np.add.at(second, label, own)
    axes = np.sqrt(np.linalg.eigvalsh(second))  # ascending
    size = np.bincount(label, grains.shape_scale.values**dim) ** (1.0 / dim)
    round_moment = total * (0.5 * size) ** 2 * (0.5 if dim == 2 else 0.6)  # trace of the second moments
    found = {
        "mass": total,
        "diameter": size,
        "elongation": axes[:, -2] / axes[:, -1],
        "compactness": round_moment / np.trace(second, axis1=1, axis2=2),
    }
    return found | ({"flatness": axes[:, 0] / axes[:, 1]} if dim == 3 else {})


def _body_moments(grains: Dataset) -> NDArray:
    """Second moments int x x^T dm (n, dim, dim) [kg m2] of all grains about their centres of mass, body frame."""
    inertia = grains.inertia.values
    if inertia.ndim == 2:  # principal moments of inertia: those about an axis are the second moments across it
        return np.eye(3) * (0.5 * inertia.sum(axis=1)[:, None] - inertia)[:, None]
    # In 2D the polar moment says nothing of the directions: these are those of the outline of the shape.
    ends = np.cumsum(grains.patch_count.values)
    outline = np.array(
        [_outline_moments(grains.isel(patch=slice(e - n, e))) for e, n in zip(ends, np.diff(ends, prepend=0))]
    )
    unit = outline / np.trace(outline, axis1=1, axis2=2)[:, None, None]
    return inertia[:, None, None] * unit[grains.shape_index.values]


def _outline_moments(shape: Dataset) -> NDArray:
    """Second moments (2, 2) of the area within the arcs of a convex outline, about its centre of mass at the origin."""
    centre, radius, axis = shape.patch_centre.values, shape.patch_radius.values, shape.patch_axis.values
    none = np.zeros(len(radius))  # one convex part, without rounded edges
    arcs = PatchSurface(centre, radius, axis, shape.patch_angle.values, none, none)
    # A convex outline has its arcs in the order of their normals.
    points, _ = points_of_arcs(arcs.rows(np.argsort(np.arctan2(axis[:, 1], axis[:, 0]))))
    return polygon_integrals(points)[2]
