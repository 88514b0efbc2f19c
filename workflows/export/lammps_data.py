"""Data files of LAMMPS: every grain as a clump of spheres within its surface, moved by fix rigid/small."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from workflows.export.snapshots import Frame, Snapshots

SKIN = 0.1  # of the lists of neighbours, in mean diameters: that of LAMMPS in SI units is 1 mm, above many a layer
CLUMP, SINGLE, GLUED = 1, 2, 3  # types: spheres of a mobile clump, mobile grains of one sphere, spheres of glued grains
HEADER = """\
Grains as clumps of spheres within their surfaces, at {time!r} s, SI units

# An input file begins so; pair style, time step and run follow:
#   units si
#   dimension {dim}
#   boundary {boundary}
#   atom_style sphere
#   atom_modify map array
#   comm_modify vel yes cutoff {reach:.4g}
#   neighbor {skin:.4g} bin
#   fix grain all property/atom mol ghost yes
#   read_data {name} fix grain NULL Molecules
{groups}
#   thermo_style custom step atoms
# The last line leaves out the temperature, for which rigid grains have too few degrees of freedom.
# The spheres of a grain share its mass. They overlap, so that the moments of inertia are near those of the grain only.

{atoms} atoms
3 atom types

{box}
"""
GROUPS = {
    CLUMP: """#   group clumps type 1
#   neigh_modify exclude molecule/intra clumps
#   fix clumps clumps rigid/small molecule
""",
    SINGLE: """#   group singles type 2
#   fix singles singles nve/sphere
""",
    GLUED: """#   group glued type 3
#   neigh_modify exclude group glued glued
#   fix glued glued nve
#   fix held glued setforce 0 0 0
""",
}


class Spheres(NamedTuple):
    """The spheres of all grains: their grain (n,), centre (n, 3), velocity (n, 3) and diameter (n,), SI units."""

    row: NDArray
    centre: NDArray
    velocity: NDArray
    diameter: NDArray


def write(snapshots: Snapshots, out: Path) -> Path:
    """Write grains_<number>.data for each snapshot to the folder `out`; returns the path of the last one."""
    of_shape = [lsm.shapes.inscribed_balls(surface) for surface in snapshots.outlines.surfaces]
    path = out
    for frame in snapshots:
        path = out / f"grains_{frame.number:0{snapshots.digits}d}.data"
        with lsm.replacing(path) as new, open(new, "w", encoding="ascii") as file:
            _write_frame(file, path.name, frame, spheres_of(frame, of_shape))
    return path


def spheres_of(frame: Frame, of_shape: list[tuple[NDArray, NDArray]]) -> Spheres:
    """The spheres of a snapshot; of_shape: centres and radii of those of each shape, in its unit and frame."""
    shape, scale = frame.constant("shape_index"), frame.constant("shape_scale")
    counts = np.array([len(radius) for _, radius in of_shape])[shape]
    row = np.repeat(np.arange(len(shape)), counts)
    body = np.concatenate([of_shape[s][0] for s in shape]) * scale[row, None]
    turned = Rotation.from_quat(frame.orientation[row], scalar_first=True)
    arm = turned.apply(np.pad(body, ((0, 0), (0, 3 - frame.dim))))
    velocity = frame.velocity[row] + np.cross(frame.angular_velocity[row], arm)
    diameter = 2.0 * scale[row] * np.concatenate([of_shape[s][1] for s in shape])
    return Spheres(row, frame.position[row] + arm, velocity, diameter)


def _write_frame(file: TextIO, name: str, frame: Frame, spheres: Spheres) -> None:
    """One data file; its spheres lie within the box along periodic edges, which the image flags make up for."""
    row, count = spheres.row, len(spheres.row)
    single = np.bincount(row)[row] == 1
    kind = np.where(frame.constant("kind")[row] == 1, GLUED, np.where(single, SINGLE, CLUMP))
    # One density for all spheres of a grain: together they have its mass.
    volume = np.pi / 6.0 * spheres.diameter**3
    density = frame.constant("mass")[row] / np.bincount(row, volume)[row]
    skin = SKIN * float(frame.constant("shape_scale").mean())
    # Every sphere of a clump must be known where any other one of it is, and whatever a sphere may touch.
    arm = np.linalg.norm(spheres.centre - frame.position[row], axis=1)
    reach = 1.01 * (max(2.0 * float(arm.max()), float(spheres.diameter.max())) + skin)
    share = np.linalg.solve(frame.cell.matrix, (spheres.centre - frame.cell.origin).T).T
    image = np.where(frame.cell.periodic, np.floor(share), 0.0)
    centre, image = spheres.centre - image @ frame.cell.matrix.T, image + frame.image[row]
    number = np.arange(1, count + 1)
    groups = "".join(lines for which, lines in GROUPS.items() if np.any(kind == which)).rstrip("\n")
    flat = "#   fix plane all enforce2d\n" if frame.dim == 2 else ""
    boundary = " ".join("p" if p or (frame.dim == 2 and a == 2) else "s" for a, p in enumerate(frame.cell.periodic))
    file.write(
        HEADER.format(
            time=frame.time,
            dim=frame.dim,
            boundary=boundary,
            name=name,
            reach=reach,
            skin=skin,
            groups=f"{groups}\n{flat}".rstrip("\n"),
            atoms=count,
            box=_box(frame, centre, spheres.diameter),
        )
    )
    turning = frame.angular_velocity[row]
    sections = {
        "Atoms # sphere": ([number, kind, spheres.diameter, density, centre, image], "%d %d %.9g %.9g" + 3 * " %.9g"),
        "Velocities": ([number, spheres.velocity, turning], "%d" + 6 * " %.9g"),
        "Molecules": ([number, frame.grain[row] + 1], "%d %d"),
    }
    for title, (columns, formats) in sections.items():
        file.write(f"\n{title}\n\n")
        np.savetxt(file, np.column_stack(columns), formats + (" %d %d %d" if "Atoms" in title else ""))


def _box(frame: Frame, centre: NDArray, diameter: NDArray) -> str:
    """The lines of the box, which along its open edges is as wide as the spheres ask for."""
    reach = 0.5 * diameter[:, None]
    low = np.where(frame.cell.periodic, frame.cell.origin, (centre - reach).min(axis=0))
    high = np.where(frame.cell.periodic, frame.cell.origin + np.diag(frame.cell.matrix), (centre + reach).max(axis=0))
    tilt = frame.cell.matrix[0, 1]
    rows = [f"{a:.12g} {b:.12g} {n}lo {n}hi" for a, b, n in zip(low, high, "xyz", strict=True)]
    return "\n".join([*rows, *([f"{tilt:.12g} 0 0 xy xz yz"] if tilt else [])])
