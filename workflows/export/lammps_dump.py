"""Text dumps of LAMMPS: `read_dump` of LAMMPS and OVITO read them."""

from __future__ import annotations

from pathlib import Path
from typing import TextIO

import numpy as np

import taichi_lsm as lsm
from workflows.export.snapshots import Cell, Frame, Snapshots

COLUMNS = (
    *("id", "type", "x", "y", "z", "ix", "iy", "iz", "vx", "vy", "vz", "omegax", "omegay", "omegaz"),
    *("radius", "mass", "quatw", "quati", "quatj", "quatk", "shape"),
)
WHOLE = ("id", "type", "ix", "iy", "iz", "shape")
MOBILE, GLUED = 1, 2  # types


def write(snapshots: Snapshots, out: Path) -> Path:
    """Write grains.lammpstrj to the folder `out`; returns its path.

    Units are SI. The id is that of the grain plus 1, as LAMMPS counts; type 1 is mobile, type 2 glued.
    """
    with lsm.replacing(out / "grains.lammpstrj") as new, open(new, "w", encoding="ascii") as file:
        file.write("ITEM: UNITS\nsi\n")
        for frame in snapshots:
            _write_frame(file, frame)
    return out / "grains.lammpstrj"


def _write_frame(file: TextIO, frame: Frame) -> None:
    file.write(f"ITEM: TIME\n{frame.time!r}\nITEM: TIMESTEP\n{frame.step}\n")
    file.write(f"ITEM: NUMBER OF ATOMS\n{len(frame.grain)}\n{box_of(frame.cell, frame.dim)}")
    file.write(f"ITEM: ATOMS {' '.join(COLUMNS)}\n")
    table = np.column_stack(
        [
            *(frame.grain + 1, frame.constant("kind") + MOBILE, frame.position, frame.image),
            *(frame.velocity, frame.angular_velocity),
            *(0.5 * frame.constant("shape_scale"), frame.constant("mass"), frame.orientation),
            frame.constant("shape_index"),
        ]
    )
    np.savetxt(file, table, ["%d" if name in WHOLE else "%.9g" for name in COLUMNS])


def box_of(cell: Cell, dim: int) -> str:
    """The lines of the box: borders of an upright one, of a sheared one those of all its corners, and its tilts."""
    low, high, tilt = cell.origin, cell.origin + np.diag(cell.matrix), cell.matrix[0, 1]
    flags = " ".join("pp" if periodic or (dim == 2 and axis == 2) else "ff" for axis, periodic in enumerate(cell[2]))
    if tilt == 0.0:
        rows = [f"{a:.12g} {b:.12g}" for a, b in zip(low, high, strict=True)]
        return "\n".join([f"ITEM: BOX BOUNDS {flags}", *rows, ""])
    corners = [(low[0] + min(0.0, tilt), high[0] + max(0.0, tilt), tilt), *((low[a], high[a], 0.0) for a in (1, 2))]
    rows = [f"{a:.12g} {b:.12g} {c:.12g}" for a, b, c in corners]
    return "\n".join([f"ITEM: BOX BOUNDS xy xz yz {flags}", *rows, ""])
