"""`lsm resume`: goes on with the run in a folder, of whatever experiment it is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from cyclopts import App

from taichi_lsm.core.errors import InputError
from workflows.cli.execution import execute
from workflows.common.exit_codes import CLAIM_NOT_MET, COMPLETE
from workflows.common.metrics import failed_claims, read_summary
from workflows.common.parameter_files import config_in, experiment_of, read_for
from workflows.common.parameter_problems import as_written
from workflows.common.parameters import ParameterError, merge, option_name
from workflows.common.run_folder import is_complete

OF_FOLDER = ("preset", "out", "overwrite")  # options that the folder decides


def resume(
    app: App,
    found: Mapping[str, ModuleType],
    folder: Path,
    tokens: tuple[str, ...],
) -> int:
    """Run the rest of the run in `folder`, with options of its experiment that may change; returns the exit code.

    Parameters
    ----------
    app
        Parses the options.
    found
        Module of each experiment by its name.
    folder
        Of the run.
    tokens
        Options of its experiment as on the command line; what a file gives (--config) counts as such.

    Raises
    ------
    InputError
        If the folder holds no run of an experiment that is known, or an option contradicts the folder.
    CycloptsError
        If an option is unknown.
    """
    name = experiment_of(folder)
    if name not in found:
        raise InputError(
            f"{folder}: holds a run of {as_written(name)}, must be one of {', '.join(found)}; set LSM_PLUGINS"
        )
    _, bound, _ = app.parse_args([name, *tokens], exit_on_error=False, print_error=False)
    options: dict[str, Any] = {key: value for key, value in bound.kwargs.items() if value is not None}
    wrong = [option_name(key) for key in OF_FOLDER if key in options]
    if wrong:
        raise InputError(f"{', '.join(wrong)}: must not be given to resume, which goes on in {folder} as it began")
    common = {key: options.pop(key) for key in ("quiet", "strict", "yes") if key in options}
    config = config_in(folder)
    if "config" in options:
        options = _of_file(Path(options.pop("config")), name, found, config) | options
    if is_complete(folder) and _same(found[name], name, config, options):
        print(f"{folder}: the run is complete, there is nothing to go on with")
        missed = failed_claims(read_summary(folder) or {})
        return CLAIM_NOT_MET if missed and common.get("strict") else COMPLETE
    if is_complete(folder) and not hasattr(found[name], "RESUMABLE"):
        told = ", ".join(map(option_name, options))
        raise InputError(
            f"{told}: the run in {folder} is complete, and nothing is left of it to go on with; to make it again: "
            f"lsm {name} --config {config} {told} ... --out {folder} --overwrite"
        )
    return execute(name, found[name], options, out=str(folder), config=str(config), existing="resume", **common)


def _of_file(path: Path, name: str, found: Mapping[str, ModuleType], config: Path) -> dict[str, Any]:
    """The parameters that a file gives to an experiment, such as more stages; those it leaves out are as in `config`.

    Raises
    ------
    ParameterError
        If the file cannot be read, or is of another experiment or preset than the run.
    """
    problems: list[str] = []
    fields = {key: set(module.Params.model_fields) for key, module in found.items()}
    own = fields.pop(name)
    given, former = (read_for(file, name, own, fields, problems) for file in (path, config))
    if given.shared and not (given.top or given.own):
        problems.append(f"--config {path}: gives nothing to {name}, of which the run is.")
    if given.preset not in (None, former.preset):
        was = former.preset or "not given"
        problems.append(f"preset {given.preset} ({path}): is {was} in {config}, and cannot change; leave it out.")
    if problems:
        raise ParameterError(problems)
    return {**given.top, **given.own}


def _same(module: ModuleType, name: str, config: Path, options: dict[str, Any]) -> bool:
    """Whether options leave the parameters in a file as they are."""
    return merge(module.Params, None, config, options, name) == merge(module.Params, None, config, None, name)
