"""What `lsm export` writes for each format, and from which files of a run."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Literal, get_args

from taichi_lsm.core.errors import InputError
from workflows.common.libraries import library

Format = Literal["vtk", "gsd", "lammps-dump", "lammps-data", "xyz", "csv"]
FORMATS: tuple[str, ...] = get_args(Format)
MODULES = {
    "vtk": "vtk_series",
    "gsd": "gsd_file",
    "lammps-dump": "lammps_dump",
    "lammps-data": "lammps_data",
    "xyz": "xyz",
}
LIBRARIES = {"vtk": "pyvista", "gsd": "gsd.hoomd"}
# What an export leaves in a folder: removed before another one is written over it.
WRITTEN = (
    *("grains*.vtp", "grains.pvd", "contacts*.vtp", "contacts.pvd"),
    *("grains.gsd", "grains.lammpstrj", "grains_*.data", "grains.xyz", "*.csv"),
)
GRAINS = "grains.nc"


def export_run(folder: Path, out: Path, form: str, times: str | None = None, every: int = 1) -> tuple[list[Path], int]:
    """Write the files of a run in another format.

    Parameters
    ----------
    folder
        Of the run, which may go on or have been killed: what is in its files now counts.
    out
        Folder to write; what a former export left there is removed.
    form
        One of FORMATS.
    times, every
        Which snapshots, see `selection.chosen`; None: all, of lammps-data the last one.

    Returns
    -------
    paths : list of Path
        The files to open.
    snapshots : int
        Number of snapshots that they hold.

    Raises
    ------
    InputError
        If there is nothing to write, a selection is wrong, or a library is missing.
    SimulationError
        If a file cannot be written.
    """
    import taichi_lsm as lsm
    from workflows.export import csv_tables
    from workflows.export.selection import chosen
    from workflows.export.snapshots import Snapshots

    path = folder / GRAINS
    if form == "csv" and not path.is_file():
        _begin(out)
        return [*csv_tables.write_tables(folder, out), *_write_contacts(folder, out, form, times or "all", every)], 0
    if not path.is_file():
        raise InputError(f"{folder}: holds no {GRAINS}, which --format {form} needs{_runs_within(folder)}")
    with lsm.opened_run(path) as dataset:
        if not dataset.sizes["time"]:
            raise InputError(f"{path}: holds no snapshot yet, which --format {form} needs")
        wanted = times or ("last" if form == "lammps-data" else "all")
        snapshots = Snapshots(dataset, chosen(dataset.time.values, wanted, every))
        if form == "csv":
            _begin(out)
            paths = [*csv_tables.write_tables(folder, out), csv_tables.write_grains(snapshots, out)]
            return [*paths, *_write_contacts(folder, out, form, wanted, every)], len(snapshots)
        module = importlib.import_module(f"workflows.export.{MODULES[form]}")
        if form in LIBRARIES:  # before anything is written
            library(LIBRARIES[form], f"--format {form}", "export")
        _begin(out)
        return [module.write(snapshots, out), *_write_contacts(folder, out, form, wanted, every)], len(snapshots)


def _write_contacts(folder: Path, out: Path, form: str, times: str, every: int) -> list[Path]:
    """Write the contacts of a run, if the format can hold them and there are any; returns the file to open."""
    from workflows.export import contact_moments

    path = folder / contact_moments.CONTACTS
    write = {"vtk": contact_moments.write_lines, "csv": contact_moments.write_rows}.get(form)
    if write is None or not path.is_file():
        return []
    import taichi_lsm as lsm

    with lsm.opened_run(path) as dataset:
        moments = contact_moments.ContactMoments(dataset, times, every)
        return [write(moments, out)] if len(moments) else []


def _begin(out: Path) -> None:
    """Make the folder, and remove what a former export has left in it."""
    out.mkdir(parents=True, exist_ok=True)
    for pattern in WRITTEN:
        for path in out.glob(pattern):
            path.unlink()


def _runs_within(folder: Path) -> str:
    """Where the snapshots of an experiment of many runs are."""
    runs = sorted(path.parent for path in folder.glob(f"runs/*/{GRAINS}"))
    return f"; its runs do, such as {runs[0]}" if runs else ""
