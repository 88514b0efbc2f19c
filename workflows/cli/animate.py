"""`lsm animate`: films of a run from its files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from taichi_lsm.core.errors import InputError
from workflows.cli.execution import in_one_line
from workflows.cli.inspect_run import require_run
from workflows.cli.progress import ProgressLine
from workflows.common.exit_codes import COMPLETE
from workflows.common.run_folder import PLOTS, check_folder

SLOWEST, FASTEST = 0.01, 50.0  # frames per second: a GIF counts in hundredths of a second, up to 655 s


@in_one_line
def animate(
    folder: Annotated[Path, Parameter(name="DIR", help="folder of a run, which may still go on")],
    /,
    *,
    what: Annotated[
        str,
        Parameter(
            name="--what",
            help="figures with commas between them, a film of each: packing_velocity, force_chains or any other that "
            "lsm plot draws of one moment",
        ),
    ] = "packing_velocity",
    fps: Annotated[float, Parameter(name="--fps", help="frames per second, from 0.01 to 50")] = 10.0,
    times: Annotated[
        str,
        Parameter(
            name=["--times", "--time"],
            help="moments that are frames: all, times such as 0.1,0.2 or a range such as 0.1:0.2 [s]",
        ),
    ] = "all",
    every: Annotated[int, Parameter(name="--every", help="of these moments each N-th")] = 1,
    kind: Annotated[
        Literal["gif", "mp4"] | None,
        Parameter(name="--format", help="of the film; gif, or as --out ends. mp4 needs ffmpeg"),
    ] = None,
    out: Annotated[
        Path | None, Parameter(name="--out", help=f"file to write, .gif or .mp4; DIR/{PLOTS}/NAME.gif")
    ] = None,
    quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
) -> int:
    """Draw a film of a run: its packing, coloured by any value, or its force chains, moment after moment.

    All frames have one scale of colours, widths and lengths; the title tells strain and friction.
    """
    from workflows.plots.films import draw_film  # takes long to load
    from workflows.plots.run_figures import runs_to_draw

    names = [name.strip() for name in what.split(",")]
    require_run(folder)
    if not SLOWEST <= fps <= FASTEST:
        raise InputError(f"--fps {fps:g}: must be from {SLOWEST:g} to {FASTEST:g}")
    runs = runs_to_draw(folder, folder / PLOTS)
    if out is not None and len(names) * len(runs) > 1:
        raise InputError(f"--out {out}: is one file, not {len(names) * len(runs)} films; leave it out")
    if out is not None and kind is not None and out.suffix != f".{kind}":
        raise InputError(f"--out {out}: does not end in .{kind}, which --format asks for; leave one of them out")
    for run, target in runs:
        for name in names:
            path = target / f"{name}.{kind or 'gif'}" if out is None else out
            _make_folder(path, out is None)
            with ProgressLine(quiet) as progress:
                frames = draw_film(run, path, name, times, every, fps, progress)
            if not quiet:
                print(f"{path}: {frames} frames")
    return COMPLETE


def _make_folder(path: Path, own: bool) -> None:
    """Make the folder of a film; its own, that of the figures, must hold no link over which it would lie elsewhere."""
    if own:
        check_folder(path.parent, "overwrite", "--out")
    elif path.parent.exists() and not path.parent.is_dir():
        raise InputError(f"--out {path}: {path.parent} is a file, must be a folder")
    path.parent.mkdir(parents=True, exist_ok=True)
