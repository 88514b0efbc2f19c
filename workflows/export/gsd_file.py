"""GSD, the file of HOOMD-blue, which OVITO opens: trajectories with shapes, rounded by their edges' radius."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.libraries import library
from workflows.export.snapshots import Cell, Frame, Snapshots

DIGITS = 6  # behind the point of a coordinate of a shape


def write(snapshots: Snapshots, out: Path) -> Path:
    """Write grains.gsd to the folder `out`; returns its path.

    A type is a shape of one size. GSD knows no units, and OVITO takes bodies of less than a millimetre for points:
    lengths are in mean diameters, velocities in mean diameters per second. Logged besides: length_unit [m], the mean
    diameter; time [s]; per grain id, kind, angular_velocity [rad/s].
    """
    hoomd = library("gsd.hoomd", "lsm export --format gsd", "export")
    types = Types(snapshots)
    with lsm.replacing(out / "grains.gsd") as new, hoomd.open(str(new), "w") as file:
        for frame in snapshots:
            file.append(_frame(hoomd.Frame(), frame, types))
    return out / "grains.gsd"


class Types:
    """The types of a file: each shape in each of its sizes.

    Attributes
    ----------
    names : list of str
        "shape 3 of 0.12 mm" and so on, each once.
    unit : float
        Mean diameter of the grains [m], unit of length.
    shapes : list of dict
        What the schema of GSD calls `type_shapes`.
    type_of : ndarray of int, (grain,)
        Type of every grain.
    """

    def __init__(self, snapshots: Snapshots) -> None:
        dataset = snapshots.dataset
        pairs = np.stack([dataset.shape_index.values, dataset.shape_scale.values], axis=1)
        sizes, of_grain = np.unique(pairs, axis=0, return_inverse=True)
        self.type_of = of_grain.ravel()
        self.names = [f"{k}: shape {int(shape)}, {1e3 * scale:.4g} mm" for k, (shape, scale) in enumerate(sizes)]
        described = {shape: _shape(snapshots.outlines, int(shape)) for shape in np.unique(sizes[:, 0])}
        self.unit = float(pairs[:, 1].mean())
        self.shapes = [_scaled(described[shape], scale / self.unit) for shape, scale in sizes]


def _shape(outlines: lsm.GrainOutlines, shape: int) -> dict[str, Any]:
    """A shape in the words of the schema, in its unit of length.

    A convex core with a rounding radius is exact; what has none is the polygon or the mesh of its surface.
    """
    core = lsm.shapes.rounded_core(outlines.surfaces[shape])
    if core is not None and len(core[0]) == 1:
        return {"type": "Sphere", "diameter": 2.0 * core[1]}
    if core is not None:
        kind = "Polygon" if outlines.dim == 2 else "ConvexPolyhedron"
        return {"type": kind, "rounding_radius": core[1], "vertices": core[0]}
    if outlines.dim == 2:
        return {"type": "Polygon", "rounding_radius": 0.0, "vertices": outlines.vertices_of(shape)}
    mesh = outlines.shapes[shape]
    return {"type": "Mesh", "vertices": mesh[0], "indices": mesh[1].tolist()}


def _scaled(shape: dict[str, Any], scale: float) -> dict[str, Any]:
    """A shape whose unit of length is `scale`, with numbers as lists: the file holds them as text."""
    lengths = {
        name: np.round(scale * np.asarray(shape[name]), DIGITS).tolist()
        for name in ("diameter", "rounding_radius", "vertices")
        if name in shape
    }
    return shape | lengths


def _frame(new: Any, frame: Frame, types: Types) -> Any:
    """One frame, in the frame of GSD: the middle of the box is the origin."""
    particles, cell, unit = new.particles, frame.cell, types.unit
    new.configuration.step, new.configuration.dimensions = frame.step, frame.dim
    new.configuration.box = box_of(cell, unit)
    particles.N = len(frame.grain)
    particles.types, particles.type_shapes = types.names, types.shapes
    particles.typeid = types.type_of[frame.grain].astype(np.uint32)
    middle = cell.origin + cell.matrix.sum(axis=1) / 2.0
    particles.position = ((frame.position - middle) / unit).astype(np.float32)
    particles.image = frame.image.astype(np.int32)
    particles.orientation = frame.orientation.astype(np.float32)
    particles.velocity = (frame.velocity / unit).astype(np.float32)
    particles.mass = frame.constant("mass").astype(np.float32)
    # No diameters: OVITO would scale the shapes by them.
    new.log["time"], new.log["length_unit"] = np.array([frame.time]), np.array([unit])
    new.log["particles/id"] = frame.grain.astype(np.int32)
    new.log["particles/kind"] = frame.constant("kind").astype(np.int32)
    new.log["particles/angular_velocity"] = frame.angular_velocity.astype(np.float32)
    return new


def box_of(cell: Cell, unit: float) -> list[float]:
    """Lengths Lx, Ly, Lz in units [m] and tilt factors xy, xz, yz of the box of HOOMD-blue."""
    h = cell.matrix
    return [*np.diag(h) / unit, h[0, 1] / h[1, 1], h[0, 2] / h[2, 2], h[1, 2] / h[2, 2]]
