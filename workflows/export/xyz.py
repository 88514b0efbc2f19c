"""Extended XYZ: text with the box and named columns, which OVITO and ASE read."""

from __future__ import annotations

from pathlib import Path
from typing import TextIO

import numpy as np

import taichi_lsm as lsm
from workflows.export.snapshots import Frame, Snapshots

SPECIES = "X"  # of no element
PROPERTIES = "species:S:1:pos:R:3:id:I:1:kind:I:1:shape:I:1:radius:R:1:mass:R:1:velo:R:3:omega:R:3:orientation:R:4"
FORMATS = [SPECIES, *["%.9g"] * 3, *["%d"] * 3, *["%.9g"] * 12]


def write(snapshots: Snapshots, out: Path) -> Path:
    """Write grains.xyz to the folder `out`; returns its path.

    Units are SI. The orientation is x, y, z, w, the order in which OVITO takes the four columns of this name.
    """
    with lsm.replacing(out / "grains.xyz") as new, open(new, "w", encoding="ascii") as file:
        for frame in snapshots:
            _write_frame(file, frame)
    return out / "grains.xyz"


def _write_frame(file: TextIO, frame: Frame) -> None:
    lattice = " ".join(f"{value:.12g}" for value in frame.cell.matrix.T.ravel())
    origin = " ".join(f"{value:.12g}" for value in frame.cell.origin)
    periodic = " ".join("T" if value else "F" for value in frame.cell.periodic)
    file.write(f"{len(frame.grain)}\n")
    file.write(f'Lattice="{lattice}" Origin="{origin}" pbc="{periodic}" Properties={PROPERTIES} Time={frame.time!r}\n')
    table = np.column_stack(
        [
            *(frame.position, frame.grain, frame.constant("kind"), frame.constant("shape_index")),
            *(0.5 * frame.constant("shape_scale"), frame.constant("mass")),
            *(frame.velocity, frame.angular_velocity, np.roll(frame.orientation, -1, axis=1)),
        ]
    )
    np.savetxt(file, table, " ".join(FORMATS))
