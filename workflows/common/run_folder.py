"""The folder that a run writes: new, cleared of what a former run has left in it, or that of a run that goes on."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal, TypeVar

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.common.metrics import read_summary
from workflows.common.parameter_files import CONFIG, config_in
from workflows.common.parameters import ParameterError, Params, merge, option_name
from workflows.common.toml_writer import to_toml

# What becomes of what a folder holds: it is refused if it is not empty, what former runs left is removed, or their run
# goes on.
Existing = Literal["refuse", "overwrite", "resume"]
SUMMARY = "summary.json"  # what every run writes last
OfOneRun = TypeVar("OfOneRun", bound=Params)
LEFT_BY_KILLS = re.compile(r"\.lock|\..*\.part")  # files of a process that was killed, which hold nothing
PARTS = "parts"  # folder of the results of parts of an experiment, until it is complete
PLOTS = "plots"  # folder of the figures and films that are made of a run
DRAWN = (".png", ".pdf", ".svg", ".gif", ".mp4")  # kinds of files in it
CHECKPOINTS = ("checkpoint", "checkpoint.previous", "checkpoint.new")
TEXTS = (CONFIG, SUMMARY, "summary.json.partial", "friction_errors.json", "hard_cases.md", "report.html")
TABLES = (
    *("run", "grains", "contacts", "stopped", *CHECKPOINTS),
    *("target", "compare", "energy", "drift", "roughness", "accuracy", "hard_cases"),
    *("cycles", "events", "healing", "fragments", "crush", "compression"),
)
PICTURES = (
    *("run", "stopped", "friction", "energy", "roughness", "work_precision", "tenfold", "hard_cases"),
    *("steps", "events", "healing", "fragments", "crush", "compression"),
)
# All files of all experiments: a folder may have held another one.
WRITTEN = {
    *TEXTS,
    *(f"{name}.nc" for name in TABLES),
    f".{CONFIG}.part",
    *(f".{name}.nc.part" for name in TABLES),  # of a process that was killed while it wrote
    *(f"{name}.{kind}" for name in PICTURES for kind in ("png", "pdf", "svg")),
}


def check_folder(
    out: str | os.PathLike[str],
    existing: Existing,
    name: str = "out",
    permission: str = "existing='overwrite' is given",
) -> None:
    """Refuse a folder that cannot be written, or that holds anything unless that is overwritten or gone on with.

    Parameters
    ----------
    out, existing
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
        problem = _problem(folder, existing, permission)
    except OSError as error:  # such as a name that is too long
        problem = f"cannot be used: {error.strerror}"
    if problem:
        raise InputError(f"{name} {folder}: {problem}.")


def check_study_folder(out: Path, copy: Path, what: str, same: bool, may: str = "") -> None:
    """Refuse a folder of many runs that holds anything but the same study, a sweep or a calibration.

    Parameters
    ----------
    out, copy
        The folder, and the copy of the study's file in it.
    what
        The study in words.
    same
        Whether the copy is of this study.
    may
        What may differ, for the message.

    Raises
    ------
    InputError
        With the folder and what to do.
    """
    if not copy.is_file():
        check_folder(out, "refuse", "--out", f"it holds this {what}")
    elif not same:
        raise InputError(f"--out {out}: holds another {what}, whose file is {copy}{may}; choose another folder")
    else:
        check_folder(out, "resume", "--out")


def _within(folder: Path) -> Iterator[Path]:
    """What a run may write to: everything in its folder, in those of its runs, parts and figures."""
    for pattern in ("*", ".*", "runs/*", "runs/*/*", f"{PARTS}/*", f"{PLOTS}/*"):
        yield from folder.glob(pattern)


def _problem(folder: Path, existing: Existing, permission: str) -> str | None:
    if folder.is_dir():
        if not os.access(folder, os.W_OK | os.X_OK):
            return "may not be written to"
        if links := [path for path in _within(folder) if path.is_symlink()]:
            return f"holds the link {links[0].relative_to(folder)}, over which a run would write elsewhere; remove it"
        if existing == "refuse" and any(not LEFT_BY_KILLS.fullmatch(path.name) for path in folder.iterdir()):
            return f"is not empty, must be new or empty unless {permission}"
        return None
    if folder.exists():
        return "is a file, must be a folder"
    above = next(p for p in folder.absolute().parents if p.exists())
    if not above.is_dir():
        return f"{above} is a file, must be a folder"
    return None if os.access(above, os.W_OK | os.X_OK) else f"{above} may not be written to"


@contextmanager
def run_folder(
    params: Params,
    experiment: str,
    out: str | os.PathLike[str],
    existing: Existing = "refuse",
    changeable: Collection[str] = (),
    keep_runs: bool = False,
    begin: bool = True,
) -> Iterator[Path]:
    """The folder of a run during the run: made, locked against others, with config.toml in it.

    Parameters
    ----------
    params, experiment
        Of the run.
    out
        The folder.
    existing
        Whether it must be new or empty; or what runs have written there is removed, and other files stay; or the run
        there goes on, with the same parameters.
    changeable
        Names of those that may change in a run that goes on, beside those that change no result.
    keep_runs
        The experiment uses the complete ones of the runs in `out`/runs again, if it overwrites: they stay.
    begin
        Whether to call `begin_run`; else the experiment does so once it has found that the run can go on.

    Raises
    ------
    InputError
        As `check_folder`; if another process writes to it; or if the run there has other parameters.
    """
    check_folder(out, existing)
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with lsm.locked(folder):
        if existing == "resume":
            check_unchanged(params, folder, changeable)
        elif existing == "overwrite":
            for path in sorted(p for p in folder.glob("runs/*") if p.is_dir()):
                if not (keep_runs and is_complete(path)):
                    clear(path)
            _remove_if_empty(folder / "runs")
            clear(folder)
        if begin:
            begin_run(params, experiment, folder)
        yield folder


def begin_run(params: Params, experiment: str, folder: Path) -> None:
    """Write config.toml, and remove what a run that goes on has to write anew or that tells of a former stop."""
    if (folder / CONFIG).is_file():
        clear_plots(folder)
        pictures = [folder / f"{name}.{kind}" for name in PICTURES for kind in ("png", "pdf", "svg")]
        for path in (folder / SUMMARY, folder / "stopped.nc", *pictures):
            path.unlink(missing_ok=True)
    write_config(params, experiment, folder)


def write_config(params: Params, experiment: str, folder: Path) -> None:
    """Write config.toml; an empty one would leave a run that nothing can go on with."""
    with lsm.replacing(folder / CONFIG) as new:
        new.write_text(to_toml(params, experiment), encoding="utf-8")


def is_complete(folder: Path) -> bool:
    """Whether the run in a folder has come to its end, by its summary and by its run.nc if it has one."""
    summary = read_summary(folder)
    if summary is None or summary.get("run_status", "complete") != "complete":
        return False
    return status_of(folder) in ("complete", None)


def status_of(folder: Path) -> str | None:
    """`run_status` of the run.nc in a folder; None if there is none that can be read."""
    if not (folder / "run.nc").is_file():
        return None
    try:
        with lsm.opened_netcdf(folder / "run.nc") as file:
            return str(file.run_status)
    except (OSError, RuntimeError, ValueError, AttributeError):  # InputError is a ValueError
        return None


def has_results(folder: Path) -> bool:
    """Whether a run that was interrupted has left something to go on from."""
    found = [*folder.glob("checkpoint*.nc"), *folder.glob(f"{PARTS}/*.json"), *folder.glob("runs/*/*.nc")]
    return len(found) > 0 or status_of(folder) == "complete"


def is_begun(folder: Path) -> bool:
    """Whether a folder holds a run, complete or not."""
    return (folder / CONFIG).is_file() or (folder / "run.nc").is_file()


def is_done(folder: Path, params: Params) -> bool:
    """Whether the run in a folder is complete and was made with these parameters, but for those that change nothing."""
    if not is_complete(folder):
        return False
    former = former_parameters(params, folder)
    return all(
        getattr(params, name) == getattr(former, name) for name in _acting(params, former) - params.without_result
    )


def former_parameters(params: OfOneRun, folder: Path) -> OfOneRun:
    """Parameters of the run in a folder, of the class of `params`; InputError if it holds none."""
    return merge(type(params), None, config_in(folder))


def _acting(params: Params, former: Params) -> set[str]:
    """Parameters that have an effect in either of two runs."""
    return set(type(params).model_fields) - (params.idle().keys() & former.idle().keys())


def check_unchanged(params: Params, folder: Path, changeable: Collection[str] = ()) -> None:
    """Refuse to go on with other parameters than the run in a folder has, but for those that may change.

    Raises
    ------
    InputError
        With every parameter that differs, its value there and here; or if the folder holds no run.
    """
    former, allowed = former_parameters(params, folder), params.without_result | set(changeable)
    acting = _acting(params, former) - allowed
    problems = [
        f"{option_name(name)} {getattr(params, name)}: is {getattr(former, name)} in the run in {folder}, and cannot "
        f"change in a run that goes on; only {', '.join(map(option_name, sorted(allowed - params.idle().keys())))} may"
        for name in type(params).model_fields
        if name in acting and getattr(params, name) != getattr(former, name)
    ]
    if problems:
        raise ParameterError(problems)


def clear(folder: Path) -> None:
    """Remove the files of a run from its folder, and a folder in `runs` if nothing else is in it.

    Of a folder without config.toml, which is removed last, only checkpoints: a later run must not go on from them.
    """
    for name in CHECKPOINTS:
        (folder / f"{name}.nc").unlink(missing_ok=True)
    if not (folder / CONFIG).is_file():
        return
    for path in folder.iterdir():
        if path.name in WRITTEN - {CONFIG} and not path.is_dir():
            path.unlink()
    shutil.rmtree(folder / PARTS, ignore_errors=True)
    clear_plots(folder)
    (folder / CONFIG).unlink()
    if folder.parent.name == "runs":
        _remove_if_empty(folder)


def clear_plots(folder: Path) -> None:
    """Remove the figures and films of a run, which are none of another one."""
    for path in (folder / PLOTS).glob("*"):
        if path.suffix in DRAWN:
            path.unlink()
    _remove_if_empty(folder / PLOTS)


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
