"""What the folder of a run holds: attributes and dimensions of its files, and what became of the run."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import taichi_lsm as lsm
from taichi_lsm.core.errors import reason
from workflows.common.metrics import FILE
from workflows.common.parameter_files import CONFIG
from workflows.common.parameter_problems import as_written
from workflows.common.run_folder import has_results, is_complete

UNKNOWN = "unknown: no file of the whole run is there"
UNFINISHED = ("running", "interrupted", UNKNOWN)
UNREADABLE = (OSError, RuntimeError, ValueError, AttributeError)  # what opening or reading a damaged file raises
MALFORMED = (*UNREADABLE, KeyError, IndexError, TypeError, RecursionError)  # what a whole one of other content raises


class RunState(NamedTuple):
    """What became of a run.

    Attributes
    ----------
    status
        `run_status` of its files, or that it is unknown.
    holder
        The process that writes to the folder, such as "process 7 on host", or "".
    goes_on
        Whether it is not complete, and may be gone on with.
    stopped
        How it was left if no process writes to it any more and it can be gone on with, else "".
    """

    status: str
    holder: str
    goes_on: bool
    stopped: str


def state_of(folder: Path, runs: list[Path]) -> RunState:
    """What became of the run in a folder; runs: folders of the runs that it consists of."""
    status = attributes_of(folder, ("run_status",)).get("run_status", UNKNOWN)
    holder = next(filter(None, map(lsm.holder_of, (folder, *runs))), None) or ""
    goes_on = (status in UNFINISHED or has_results(folder)) and not is_complete(folder)
    stopped = ""
    if goes_on and not holder and (folder / CONFIG).is_file():
        missing = status == "complete" and not (folder / FILE).is_file()
        stopped = "all rows are there, its summary is missing" if missing else "no process writes to it any more"
    return RunState(status, holder, goes_on, stopped)


def attributes_of(folder: Path, names: tuple[str, ...], whole: bool = False) -> dict[str, str]:
    """Attributes of run.nc, or of the first NetCDF file of the folder if there is no run.nc.

    whole: as they are, and not shortened and without what cannot be printed, as a line of text has them.
    """
    for path in (folder / "run.nc", *sorted(folder.glob("[!c]*.nc")), folder / "compare.nc"):  # and no checkpoint
        try:
            with lsm.opened_netcdf(path) as file:
                found = {name: file.getncattr(name) for name in names if name in file.ncattrs()}
                texts = {name: str(value) if whole else as_written(str(value)) for name, value in found.items()}
                return {name: text for name, text in texts.items() if text != "nan"}  # a table may have no step
        except UNREADABLE:
            continue
    complete = is_complete(folder)  # of an experiment without a NetCDF file of its own
    return {"run_status": "complete" if complete else UNKNOWN}


def contents_of(path: Path) -> str:
    """Dimensions and status of a NetCDF file, the size of any other."""
    if path.suffix != ".nc":
        return f"{path.stat().st_size} bytes"
    try:
        with lsm.opened_netcdf(path) as file:
            if "run_state" in file.ncattrs():
                return f"checkpoint of {file.grains} grains at step {file.step}"
            if not file.groups:
                return _sizes(file)
            return "; ".join(f"group {as_written(name)}: {_sizes(group)}" for name, group in file.groups.items())
    except UNREADABLE as error:
        return f"unreadable: {getattr(error, 'strerror', None) or reason(error)}"


def _sizes(group: Any) -> str:
    """Dimensions of a NetCDF file or group, but for the letters of texts, and the number of its variables."""
    letters = {v.dimensions[-1] for v in group.variables.values() if v.dtype == "S1" and v.dimensions}
    kept = {name: len(dim) for name, dim in group.dimensions.items() if name not in letters}
    sizes = ", ".join(f"{as_written(name)} {length}" for name, length in kept.items())
    return f"{sizes or 'no dimensions'}, {len(group.variables)} variables"
