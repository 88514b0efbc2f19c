"""`lsm report`: a page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from workflows.cli.execution import in_one_line
from workflows.cli.how_far import how_far
from workflows.cli.inspect_run import require_run
from workflows.common.exit_codes import COMPLETE
from workflows.report.page import PAGE, write_report


@in_one_line
def report(
    folder: Annotated[
        Path,
        Parameter(name="DIR", help="folder of a run, a comparison, a sweep or a calibration, which may still go on"),
    ],
    /,
    *,
    out: Annotated[Path | None, Parameter(name="--out", help=f"file to write; DIR/{PAGE}")] = None,
    quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
) -> int:
    """Write a page about a run that needs nothing else: figures, metrics, parameters, energies, provenance, files."""
    target = folder / PAGE if out is None else out
    files, runs = require_run(folder)
    count = write_report(folder, files, runs, target, how_far(folder))
    if not quiet:
        print(f"report: {target}, {count} figure{'s' * (count != 1)}")
    return COMPLETE
