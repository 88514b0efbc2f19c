"""A grains.nc of grains of any shapes at given places, without a simulation."""

import numpy as np

from taichi_lsm.core.schema import Variable
from taichi_lsm.io.grains_file import GrainsWriter, snapshot_rows, static_rows
from taichi_lsm.io.netcdf_variables import Scalar
from taichi_lsm.io.run_file import file_attributes
from taichi_lsm.shapes import PatchSurface, patch_surface

STRAIN = Variable("shear_strain", ("time",), "f64", "1", "integral of shear rate over time")
DT, DENSITY = 1e-6, 2650.0


def constants(shapes, shape_index, scale, glued=()):
    """What grains.nc holds of grains that does not change; lengths [m], thickness 1 m in 2D."""
    dim, index, scale = shapes[0].dim, np.asarray(shape_index), np.asarray(scale, float)
    patches = PatchSurface(*(np.concatenate(column) for column in zip(*map(patch_surface, shapes), strict=True)))
    measure, reach = (np.array([getattr(s, n) for s in shapes])[index] for n in ("measure", "bounding_radius"))
    inertia = np.array([s.inertia for s in shapes])[index] * DENSITY * scale[:, None] ** (dim + 2)
    return {
        "mass": DENSITY * measure * scale**dim,
        "inertia": inertia[:, 0] if dim == 2 else inertia,
        "bounding_radius": reach * scale,
        "kind": np.isin(np.arange(len(index)), glued).astype(int),
        "shape_index": index,
        "shape_scale": scale,
        "patch_count": [s.patch_count for s in shapes],
        "patch_centre": patches.centre,
        "patch_radius": patches.radius,
        "patch_axis": patches.axis,
        "patch_angle": patches.half_angle,
        "patch_part": patches.part,
        "patch_edge_radius": patches.edge_radius,
    }


def grains_file(path, shapes, shape_index, scale, periodic=(), glued=(), more=()):
    """A writer of such a file; `append_snapshot` adds snapshots. more: further rows of a snapshot."""
    static, dim = constants(shapes, shape_index, scale, glued), shapes[0].dim
    attributes = file_attributes("Grains", "For tests", "", 1, DT, "cpu", "f64") | {"periodic_lengths": list(periodic)}
    rows, text = [STRAIN, *more, *snapshot_rows(dim)], {"stage": "stage of the run"}
    density = Scalar("density", DENSITY, "density of the grains", "kg m-3")
    return GrainsWriter(path, static, static_rows(dim), rows, attributes, text=text, scalars=[density])


def append_snapshot(writer, time, position, **given):
    """Append a snapshot at a time [s] of grains at these positions (n, dim) [m], at rest unless given otherwise."""
    position = np.asarray(position, float)
    count, dim = position.shape
    at_rest = {
        "velocity": np.zeros((count, dim)),
        "angular_velocity": np.zeros(count if dim == 2 else (count, 3)),
        "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        "shear_strain": time,
        "stage": "shear",
    }
    writer.append(time, at_rest | {"position": position} | given)
