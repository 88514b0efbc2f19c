"""`lsm sensitivity`: which parameters of a sweep its metrics depend on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Annotated, Literal

from cyclopts import Parameter

from workflows.cli.execution import complain, exit_code_of
from workflows.cli.sweep import Sweep
from workflows.common.exit_codes import COMPLETE
from workflows.common.metrics import print_summary
from workflows.common.one_run import Limits
from workflows.plots.sensitivity import plot_sensitivity
from workflows.sweep.saltelli import Indices
from workflows.sweep.sensitivity import metrics_of, parameters_of, sensitivity_of, write_sensitivity


def sensitivity_command(found: Mapping[str, ModuleType]) -> Callable[..., int]:
    """The command, for experiments by their name."""

    def sensitivity(
        path: Annotated[
            Path,
            Parameter(
                name="PATH", help='folder of a sweep whose [sweep.sample] has method = "saltelli", or its file to run'
            ),
        ],
        /,
        *,
        metric: Annotated[
            list[str] | None, Parameter(name="--metric", help="metric of summary.json, may be repeated; friction_mean")
        ] = None,
        out: Annotated[Path, Parameter(name="--out", help="folder of the sweep, if PATH is a file")] = Path(
            "out/sensitivity"
        ),
        jobs: Annotated[int, Parameter(name=["--jobs", "-j"], help="runs at a time on this machine [1]")] = 2,
        format: Annotated[
            Literal["png", "pdf", "svg"], Parameter(name="--format", help="format of the picture")
        ] = "png",
        quiet: Annotated[bool, Parameter(name="--quiet", help="print errors only", negative=())] = False,
    ) -> int:
        """Find which share of a metric's variance each parameter of a sweep gives; writes sensitivity.nc, a picture."""
        if jobs < 1:
            return complain([f"--jobs {jobs}: must be >= 1."])
        folder = out if path.is_file() else path

        def analyse() -> int:
            if path.is_file():
                Sweep(found, path, out, quiet, format).run(None, jobs, retries=3, limits=Limits())
            study, indices = sensitivity_of(folder, metric or ())
            write_sensitivity(folder, study, indices)
            names = parameters_of(study, folder)
            plot_sensitivity(folder / f"sensitivity.{format}", names, indices)
            _tell(names, indices, quiet)
            return COMPLETE

        return exit_code_of(analyse, f"lsm sensitivity {path} --out {out}")

    return sensitivity


def _tell(names: Sequence[str], indices: Mapping[str, Indices], quiet: bool) -> None:
    """Print the indices, and which blocks were left out."""
    if not quiet:
        rows = {name: entry.as_dict() for name, entry in metrics_of(names, indices).items()}
        print_summary({"workflow": "sensitivity", "preset": None, "metrics": rows})
    complain(
        [
            f"{name}: {of_metric.left_out} of {of_metric.left_out + of_metric.blocks} blocks are left out, as runs "
            "in them gave nothing; run the sweep again, or see its notes."
            for name, of_metric in indices.items()
            if of_metric.left_out
        ]
    )
