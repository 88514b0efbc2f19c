"""What made a run, when, from what, and how to repeat it; the files that it has left."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import taichi_lsm as lsm
from workflows.common.parameter_files import CONFIG, OF_COMMANDS
from workflows.common.run_contents import UNREADABLE, attributes_of, contents_of
from workflows.report.configuration import Given
from workflows.report.parts import Section, Table

ATTRIBUTES = {  # of the files of a run, and what they are called here
    "source": "made by",
    "git_commit": "git commit",
    "date_created": "begun",
    "date_modified": "last written",
    "seed": "seed",
    "dt": "time step [s]",
    "id": "id",
    "references": "references",
}
OF_PARAMS = {"arch": "device", "precision": "precision", "threads": "threads"}
MOST_VARIABLES = 400  # of one file


def provenance(folder: Path, given: Given) -> Section:
    """Versions, commit, seed, step, device, dates, id, and the command that repeats the run."""
    found = attributes_of(folder, tuple(ATTRIBUTES), whole=True)
    rows = [("experiment", given.experiment)] if given.experiment else []
    rows += [(ATTRIBUTES[name], found[name]) for name in ATTRIBUTES if name in found]
    if given.params is not None:
        rows += [(title, str(getattr(given.params, name))) for name, title in OF_PARAMS.items()]
    section = Section("provenance", "Provenance")
    if command := repeating(folder, given):
        rows.append(("to repeat it", command))
    section.tables.append(Table("Where the numbers come from", ("what", "value"), rows, texts=frozenset({1})))
    return section


def study_of(folder: Path) -> tuple[str, ...]:
    """The words of the command of a sweep or a calibration, with the copy of its file; () of other runs."""
    files = {name: folder / f"{name}.toml" for name in OF_COMMANDS}
    return next((("lsm", name, str(path)) for name, path in files.items() if path.is_file()), ())


def repeating(folder: Path, given: Given) -> str:
    """The command that makes the run again, in another folder; "" if it is not known."""
    if (folder / CONFIG).is_file() and given.experiment:
        words = ["lsm", given.experiment, "--config", str(folder / CONFIG)]
    else:
        words = list(study_of(folder))
        if not words:
            return ""
    return shlex.join([*words, "--out", f"{folder}-again"])


def files_of(files: list[Path], folder: Path) -> Section:
    """Files with their sizes, and the variables of those that have any."""
    section = Section("files", "Files")
    rows = []
    for path in files:
        about = contents_of(path) if path.suffix == ".nc" else ""
        rows.append((path.relative_to(folder).as_posix(), size_of(path.stat().st_size), about))
        if path.suffix == ".nc" and (text := variables_of(path)):
            section.listings.append((f"Variables of {path.name}", text))
    section.tables.append(Table("Files in the folder", ("file", "size", "holds"), rows, texts=frozenset({2})))
    return section


def size_of(count: float) -> str:
    """A number of bytes: "812 B", "1.4 MB"."""
    for unit in ("B", "kB", "MB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} GB"


def variables_of(path: Path) -> str:
    """The variables of a NetCDF file with dimensions, units and meanings, one line each; "" if it has none."""
    lines: list[str] = []
    try:
        with lsm.opened_netcdf(path) as file:
            for group in (file, *file.groups.values()):
                lines += [_line(group, name) for name in group.variables]
    except UNREADABLE:
        return ""
    return "\n".join(lines[:MOST_VARIABLES])


def _line(group: Any, name: str) -> str:
    """One variable in words."""
    variable = group[name]
    dims = ", ".join(variable.dimensions)
    unit = f" [{variable.units}]" if "units" in variable.ncattrs() else ""
    meaning = f": {variable.long_name}" if "long_name" in variable.ncattrs() else ""
    place = "" if group.path == "/" else f"{group.path.strip('/')}/"
    return f"{place}{name}{f' ({dims})' if dims else ''}{unit}{meaning}"
