"""`lsm export`: the grains and tables of a run in the formats of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from workflows.cli.execution import in_one_line
from workflows.cli.inspect_run import require_run
from workflows.common.exit_codes import COMPLETE
from workflows.common.run_folder import check_folder
from workflows.export.formats import Format, export_run


@in_one_line
def export(
    folder: Annotated[Path, Parameter(name="DIR", help="folder of a run, which may still go on")],
    /,
    *,
    form: Annotated[
        Format,
        Parameter(
            name="--format",
            help="vtk: surfaces for ParaView; gsd: shapes for OVITO; lammps-dump: text for LAMMPS and OVITO; "
            "lammps-data: clumps of spheres to run in LAMMPS; xyz: extended XYZ; csv: all tables",
        ),
    ],
    out: Annotated[Path | None, Parameter(name="--out", help="folder to write; DIR/export-FORMAT")] = None,
    times: Annotated[
        str | None,
        Parameter(
            name="--times",
            help="snapshots: first, last, all, times such as 0.1,0.2 or a range such as 0.1:0.2 [s]; all, of "
            "lammps-data the last",
        ),
    ] = None,
    every: Annotated[int, Parameter(name="--every", help="of these snapshots each N-th")] = 1,
    overwrite: Annotated[
        bool, Parameter(name="--overwrite", help="write over what a former export has left in the folder", negative=())
    ] = False,
    quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
) -> int:
    """Write a run for other programs: true surfaces of grains, trajectories, clumps, tables."""
    require_run(folder)
    target = folder / f"export-{form}" if out is None else out
    check_folder(target, "overwrite" if overwrite else "refuse", "--out", "--overwrite is given")
    paths, count = export_run(folder, target, form, times, every)
    if not quiet:
        print(f"export: {count} snapshot{'s' * (count != 1)}: {', '.join(map(str, paths))}")
    return COMPLETE
