"""Checks everything, runs an experiment, and tells what became of it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import wraps
from pathlib import Path
from types import ModuleType
from typing import Any, ParamSpec

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError, SimulationError
from workflows.cli.progress import ProgressLine
from workflows.common import signals
from workflows.common.discovery import find_workflows
from workflows.common.exit_codes import BAD_INPUT, CLAIM_NOT_MET, COMPLETE, FAILED, reason_of
from workflows.common.metrics import FILE, failed_claims, read_summary
from workflows.common.parameter_files import CONFIG, experiment_of
from workflows.common.parameters import ParameterError, merge
from workflows.common.refusals import in_terms_of
from workflows.common.run_cost import objections
from workflows.common.run_folder import Existing, check_folder, has_results

P = ParamSpec("P")


def execute(
    name: str,
    module: ModuleType,
    options: dict[str, Any],
    out: str | None = None,
    config: str | None = None,
    preset: str | None = None,
    quiet: bool = False,
    strict: bool = False,
    overwrite: bool = False,
    yes: bool = False,
    existing: Existing = "refuse",
) -> int:
    """Check everything, run a workflow, and name the claims that its summary does not meet; returns the exit code."""
    if out == "":
        return complain(["--out '': must be the name of a folder."])
    folder = Path("out") / name if out is None else Path(out)
    existing = "overwrite" if overwrite else existing
    problems, params = refusals(folder, existing), None
    cost = None
    try:
        params = merge(module.Params, preset, config, options, name, _fields_of_others(module))
        if not quiet and not problems:
            print(f"{name}, preset {params.preset_name}: checking, then writing to {folder}", flush=True)
        complain([f"note: {text}" for text in (*params.notes, *_replaced(folder, name, existing))])
        if params.arch != "cpu":
            _check_arch(params.arch)
        module.check(params)
        cost = module.estimate(params)
        if not (yes or existing == "resume"):  # which is only a part of it
            problems = objections(cost, lsm.machine_memory()) + problems
    except InputError as error:
        problems = problems_of(error) + problems
    if problems:
        return complain(problems)
    made = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return complain([f"--out {folder}: cannot be made: {error.strerror}."])
    if cost and not quiet and existing != "resume":  # it is not known which part of it is left
        print(f"{name}: {cost}", flush=True)
    earlier = _written_at(folder / FILE)
    with ProgressLine(quiet) as progress:
        try:
            module.run(params, out=folder, progress=None if quiet else progress, existing=existing)
        except InputError as error:
            _remove_empty(made)
            return complain(problems_of(error))
        except (SimulationError, MemoryError, OSError) as error:
            if isinstance(error, BrokenPipeError):  # the output is no longer read: `main` ends quietly
                raise
            complain([reason_of(error)])
            return FAILED
        except signals.Interrupted:
            if (folder / CONFIG).is_file():
                kept, do = "nothing was finished yet", "begin anew with the same parameters"
                if has_results(folder):
                    kept, do = "what is done is kept", "go on"
                complain([f"{kept}; to {do}: lsm resume {folder}"])
            raise
    summary = read_summary(folder) if _written_at(folder / FILE) != earlier else None
    missed = failed_claims(summary) if summary else []
    complain(missed)
    return CLAIM_NOT_MET if strict and missed else COMPLETE


def in_one_line(command: Callable[P, int]) -> Callable[P, int]:
    """A command that tells the user's mistake, or why it failed, in one line, and ends with the exit code of it."""

    @wraps(command)
    def told(*args: P.args, **kwargs: P.kwargs) -> int:
        try:
            return command(*args, **kwargs)
        except InputError as error:
            return complain([str(error)])
        except BrokenPipeError:  # the output is no longer read: `main` ends quietly
            raise
        except (SimulationError, OSError) as error:
            complain([reason_of(error)])
            return FAILED

    return told


def exit_code_of(command: Callable[[], int], again: str) -> int:
    """The exit code of a command that makes many runs, as of one `in_one_line`.

    again: the same command, with which it goes on if it is interrupted.
    """
    try:
        return in_one_line(command)()
    except signals.Interrupted:
        complain([f"complete runs are kept; to go on: the same command, {again}"])
        raise


def _replaced(folder: Path, name: str, existing: Existing) -> Iterator[str]:
    """That a run of another experiment will be removed."""
    if existing == "overwrite":
        with suppress(InputError):  # no run is there
            former = experiment_of(folder)
            if former != name:
                yield f"--overwrite removes the files of the run of {former} in {folder}"


def _written_at(path: Path) -> int | None:
    """When a file was last written [ns]; None if there is none."""
    return path.stat().st_mtime_ns if path.exists() else None


def _fields_of_others(module: ModuleType) -> dict[str, set[str]]:
    """Name -> parameters of every other experiment."""
    return {n: set(other.Params.model_fields) for n, other in find_workflows().items() if other is not module}


def _check_arch(arch: str) -> None:
    """Refuse a device that this machine does not have, before anything is made."""
    with in_terms_of(f"--arch {arch}", "choose --arch cpu"):
        lsm.check_arch(arch)


def problems_of(error: InputError) -> list[str]:
    """One line for each mistake of the user."""
    return error.problems if isinstance(error, ParameterError) else [str(error)]


def refusals(folder: Path, existing: Existing) -> list[str]:
    """Reasons why the folder cannot be written to; [] if it can."""
    try:
        check_folder(folder, existing, "--out", "--overwrite is given")
    except InputError as error:
        return [str(error)]
    return []


def _remove_empty(folders: list[Path]) -> None:
    """Remove the folders that were made for a refused run, innermost first, up to one that holds something."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def complain(problems: list[str]) -> int:
    """Print one line for each mistake of the user; returns the exit code."""
    for problem in problems:
        print(f"lsm: {problem}", file=sys.stderr)
    return BAD_INPUT
