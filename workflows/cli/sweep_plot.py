"""`lsm sweep-plot`: draws any metric of a sweep against any of its parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from taichi_lsm.core.errors import InputError
from workflows.cli.execution import complain
from workflows.common.exit_codes import COMPLETE


def sweep_plot(
    folder: Annotated[Path, Parameter(name="DIR", help="folder of a sweep, with its sweep.nc")],
    /,
    *,
    metric: Annotated[
        str | None, Parameter(name="--metric", help="what is drawn; by default the first with a standard error")
    ] = None,
    against: Annotated[
        str | None,
        Parameter(name="--against", help="parameter of the horizontal axis; by default the one with most values"),
    ] = None,
    colour: Annotated[
        str | None,
        Parameter(name="--colour", help="parameter with a colour for each value; by default the next one that varies"),
    ] = None,
    facet: Annotated[
        str | None,
        Parameter(name="--facet", help="parameter with a panel for each value; by default all others that vary"),
    ] = None,
    kind: Annotated[Literal["png", "pdf", "svg"], Parameter(name="--format", help="of the picture")] = "png",
) -> int:
    """Draw a metric of a sweep against a parameter: means over the seeds with their 95 % intervals."""
    from workflows.plots.sweep_figure import plot_sweep  # takes long to load

    try:
        print(plot_sweep(folder, kind, metric, against, colour, facet))
    except InputError as error:
        return complain([str(error)])
    except OSError as error:
        return complain([f"{folder}: the picture cannot be written: {error.strerror}."])
    return COMPLETE
