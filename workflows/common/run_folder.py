"""The folder that a run writes: refused if it holds anything, or cleared of what a former run has left in it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from taichi_lsm.core.errors import InputError
from workflows.common.parameters import Params
from workflows.common.toml_writer import to_toml

CONFIG = "config.toml"  # what every run writes first, and its folder is known by
TEXTS = (CONFIG, "summary.json", "summary.json.partial", "friction_errors.json", "hard_cases.md")
TABLES = (
    *("run", "grains", "checkpoint", "stopped"),
    *("target", "compare", "energy", "drift", "roughness", "accuracy", "hard_cases"),
)
PICTURES = ("run", "stopped", "friction", "energy", "roughness", "work_precision", "tenfold", "hard_cases")
# All files of all experiments: a folder may have held another one.
WRITTEN = {
    *TEXTS,
    *(f"{name}.nc" for name in TABLES),
    *(f".{name}.nc.part" for name in TABLES),  # of a process that was killed while it wrote
    *(f"{name}.{kind}" for name in PICTURES for kind in ("png", "pdf", "svg")),
}


def check_folder(
    out: str | os.PathLike[str], overwrite: bool, name: str = "out", permission: str = "overwrite=True"
) -> None:
    """Refuse a folder that cannot be written, or that holds anything and may not be overwritten.

    Parameters
    ----------
    out, overwrite
        As `run` of an experiment takes them.
    name, permission
        What the user calls the folder, and how one allows to write over what it holds; for the message.

    Raises
    ------
    InputError
        With the folder, what is wrong with it and what to do.
    """
    folder = Path(out)
    try:
        problem = _problem(folder, overwrite, permission)
    except OSError as error:  # such as a name that is too long
        problem = f"cannot be used: {error.strerror}"
    if problem:
        raise InputError(f"{name} {folder}: {problem}.")


def _problem(folder: Path, overwrite: bool, permission: str) -> str | None:
    if folder.is_dir():
        if not os.access(folder, os.W_OK | os.X_OK):
            return "may not be written to"
        if any(folder.iterdir()) and not overwrite:
            return f"is not empty, must be new or empty unless {permission} is given"
        return None
    if folder.exists():
        return "is a file, must be a folder"
    above = next(p for p in folder.absolute().parents if p.exists())
    if not above.is_dir():
        return f"{above} is a file, must be a folder"
    return None if os.access(above, os.W_OK | os.X_OK) else f"{above} may not be written to"


def begin_run(params: Params, out: str | os.PathLike[str], overwrite: bool = False, keep_runs: bool = False) -> Path:
    """Make the folder of a run and write config.toml to it; returns its path.

    Parameters
    ----------
    params
        Of the run.
    out
        The folder, new or empty.
    overwrite
        It may hold something: what runs write is removed, other files stay.
    keep_runs
        The experiment goes on with the complete ones of the runs in `out`/runs: they stay.

    Raises
    ------
    InputError
        As `check_folder`.
    """
    check_folder(out, overwrite)
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    if not keep_runs:
        for path in sorted(folder.glob("runs/*")):
            _clear(path)
        _remove_if_empty(folder / "runs")
    _clear(folder)
    (folder / CONFIG).write_text(to_toml(params), encoding="utf-8")
    return folder


def _clear(folder: Path) -> None:
    """Remove the files of a run from its folder, and a folder in `runs` if nothing else is in it."""
    if not (folder / CONFIG).is_file():
        return  # not the folder of a run
    for path in folder.iterdir():
        if path.name in WRITTEN and not path.is_dir():
            path.unlink()
    if folder.parent.name == "runs":
        _remove_if_empty(folder)


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
