"""`lsm plot`: figures of a run from its files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from workflows.cli.execution import complain, in_one_line
from workflows.cli.inspect_run import require_run
from workflows.common.exit_codes import COMPLETE
from workflows.common.run_folder import PLOTS, check_folder


@in_one_line
def plot(
    folder: Annotated[
        Path, Parameter(name="DIR", help="folder of a run, which may still go on, or of a comparison of runs")
    ],
    /,
    *,
    what: Annotated[
        str | None,
        Parameter(
            name="--what",
            help="figures with commas between them, such as friction,packing_velocity; all that the files allow. A "
            "name that is none is answered with all names",
        ),
    ] = None,
    times: Annotated[
        str,
        Parameter(
            name=["--times", "--time"],
            help="moments of figures that show one: first, last, all, times such as 0.1,0.2 or a range such as 0.1:0.2 "
            "[s]",
        ),
    ] = "last",
    kind: Annotated[Literal["png", "pdf", "svg"], Parameter(name="--format", help="of the pictures")] = "png",
    out: Annotated[Path | None, Parameter(name="--out", help=f"folder to write; DIR/{PLOTS}")] = None,
    quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
) -> int:
    """Draw a run: its course, its packing, force chains, profiles, directions of contacts, sizes of grains.

    One picture for each figure, as wide as a column of a journal.
    """
    from workflows.plots.run_figures import draw_figures, runs_to_draw  # takes long to load

    names = [] if what is None else [name.strip() for name in what.split(",")]
    drawn = 0
    require_run(folder)
    for run, target in runs_to_draw(folder, folder / PLOTS if out is None else out):
        check_folder(target, "overwrite", "--out")
        target.mkdir(parents=True, exist_ok=True)
        paths, missing = draw_figures(run, target, names, times, kind, None if quiet else print)
        drawn += len(paths)
        if missing and not quiet:
            print(*(f"not drawn: {name}: {why}" for name, why in missing.items()), sep="\n")
    return COMPLETE if drawn else complain([f"{folder}: none of the figures can be drawn from its files"])
