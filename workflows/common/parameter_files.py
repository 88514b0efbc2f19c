"""A file of parameters, for one experiment or for several: TOML, or a NetCDF file of a run, which holds its own.

Keys at the top of the file are for the experiment that is run; a table named after an experiment, `[shear-gouge]`, is
for that one alone. Two keys are of the file itself: the `experiment` that it was written for, and its `preset`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from taichi_lsm.core.errors import InputError
from workflows.common.parameter_problems import as_written, nearest
from workflows.common.toml_reader import parsed, read_toml

CONFIG = "config.toml"  # what every run writes first, and its folder is known by
SWEEP = "sweep"  # the table of a file that says how parameters vary over the runs of a sweep
CALIBRATE = "calibrate"  # that which says what parameters are wanted for
OF_COMMANDS = (SWEEP, CALIBRATE)  # tables that are for the command of that name, not for an experiment


class OfFile(NamedTuple):
    """What a TOML file gives to one experiment.

    Attributes
    ----------
    top, own
        Key -> value at the top of the file, and in the table of the experiment.
    shared
        Whether the file was written for another experiment as well.
    notes
        What was not taken and why, one line each.
    preset
        The preset that it names for this experiment, or None.
    """

    top: dict[str, Any]
    own: dict[str, Any]
    shared: bool
    notes: tuple[str, ...]
    preset: str | None = None


def read_for(
    path: Path,
    experiment: str,
    fields: Collection[str],
    others: Mapping[str, Collection[str]],
    problems: list[str],
    content: Mapping[str, Any] | None = None,
) -> OfFile:
    """Read what the file at `path` gives to an experiment.

    Parameters
    ----------
    path
        The TOML file.
    experiment, fields
        Name of the experiment, "" if it is not known, and its parameters.
    others
        Name -> parameters of every other experiment.
    problems
        Takes a message for each mistake: a file that cannot be read, a table of no experiment.
    content
        Of the file, if it has been read already.
    """
    top, own, tables, foreign = {}, {}, [], []
    content = _read(path, problems) if content is None else dict(content)
    written_for, preset = (content.pop(key, None) if key not in fields else None for key in ("experiment", "preset"))
    for key, value in (("experiment", written_for), ("preset", preset)):
        if not isinstance(value, str | None):
            problems.append(f"{key} = {as_written(value)} ({path}): must be a text.")
    of_commands = [name for name in OF_COMMANDS if name not in fields and content.pop(name, None) is not None]
    other = written_for is not None and experiment != "" and written_for != experiment
    for key, value in content.items():
        if key in fields:
            top[key] = value
        elif key == experiment or key in others:
            if not isinstance(value, dict):
                problems.append(f"{key} = {as_written(value)} ({path}): must be a table, [{key}].")
            elif key == experiment:
                own = value
            else:
                tables.append(key)
        elif any(key in theirs for theirs in others.values()):
            foreign.append(key)
        elif isinstance(value, dict) and others:
            names = sorted({experiment, *others} - {""})
            problems.append(
                f"[{as_written(key)}] ({path}): unknown table; a table is named after the experiment that it is for, "
                f"one of {', '.join(names)}.{nearest(key, names)}"
            )
        else:
            top[key] = value
    notes = [*_foreign_notes(path, experiment, foreign, others)]
    notes += [f"{path}: the table [{name}] was not taken: it is for that experiment" for name in tables]
    notes += [f"{path}: the table [{name}] was not taken: it is for lsm {name}" for name in of_commands]
    of_this = isinstance(preset, str) and not other
    if isinstance(preset, str) and other:
        notes.append(f'{path}: preset = "{preset}" was not taken: the file is of {as_written(written_for)}')
    return OfFile(top, own, bool(tables or foreign or other), tuple(notes), preset if of_this else None)


def read_study(
    path: Path, experiments: Collection[str], name: str, keys: Collection[str], such: str = ""
) -> tuple[str, Mapping[str, Any], dict[str, Any]]:
    """(experiment, table `name`, all content) of a file of parameters of one experiment that asks for many runs of it.

    Parameters
    ----------
    path
        The TOML file.
    experiments
        Names of all there are.
    name, keys, such
        Of the table: its name, the keys that it may have, and an example for the message.

    Raises
    ------
    InputError
        With the file, the key, its value, what is allowed and the nearest name.
    """
    content = content_of(path)
    experiment, table = content.get("experiment"), content.get(name)
    if not isinstance(experiment, str) or experiment not in experiments:
        hint = nearest(str(experiment), experiments) if experiment else ""
        what = f"experiment = {as_written(experiment)}" if experiment else "experiment is missing"
        raise InputError(f"{path}: {what}, must be one of {', '.join(experiments)}.{hint}")
    if not isinstance(table, Mapping):
        what = "no table" if table else "missing"
        raise InputError(f"{path}: {name} is {what}, must be a table, {such or f'[{name}]'}")
    if unknown := sorted(set(table) - set(keys)):
        hint = nearest(unknown[0], keys)
        raise InputError(f"{path}: {name}.{as_written(unknown[0])}: unknown, must be one of {', '.join(keys)}.{hint}")
    return experiment, table, content


def content_of(path: Path) -> dict[str, Any]:
    """The content of a TOML file; InputError if it cannot be read."""
    try:
        return read_toml(path)
    except FileNotFoundError:
        others = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise InputError(f"{path}: there is no such file.{nearest(path.name, others)}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def config_in(folder: Path) -> Path:
    """The file with the parameters of the run in a folder: config.toml, or run.nc if that says nothing.

    Raises
    ------
    InputError
        If the folder holds no run, or one of a version that did not name its experiment.
    """
    paths = [path for path in (folder / CONFIG, folder / "run.nc") if path.is_file()]
    if not folder.exists():
        siblings = [p.name for p in folder.parent.iterdir() if p.is_dir()] if folder.parent.is_dir() else []
        raise InputError(f"{folder}: there is no such folder.{nearest(folder.name, siblings)}")
    if not paths:
        raise InputError(f"{folder}: holds no {CONFIG}, must be the folder of a run that was begun")
    for path in paths:
        problems: list[str] = []
        if isinstance(_read(path, problems).get("experiment"), str):
            return path
        if problems and path.name == CONFIG and path.stat().st_size > 0:  # a mistake of whoever has edited it
            raise InputError(problems[0].removeprefix("--config "))
    raise InputError(f"{paths[0]}: names no experiment, must be of a run of this version")


def experiment_of(folder: Path) -> str:
    """Name of the experiment that was run in a folder; InputError as `config_in`."""
    return str(_read(config_in(folder), [])["experiment"])


def _foreign_notes(
    path: Path, experiment: str, foreign: list[str], others: Mapping[str, Collection[str]]
) -> Iterable[str]:
    """One line for all parameters that the same other experiments have."""
    owners: dict[tuple[str, ...], list[str]] = {}
    for key in sorted(foreign):
        owners.setdefault(tuple(name for name, theirs in others.items() if key in theirs), []).append(key)
    for names, keys in owners.items():
        have = f"{listed(names)} {'has' if len(names) == 1 else 'have'}"
        such = f"no such parameter{'s' * (len(keys) > 1)}"
        yield not_taken(path, keys, f"{experiment or 'this experiment'} has {such}, {have}")


def not_taken(path: str | Path, keys: Iterable[str], reason: str) -> str:
    """The note that these keys of a file were not taken, and why."""
    keys = sorted(keys)
    return f"{path}: {listed(keys)} {'was' if len(keys) == 1 else 'were'} not taken: {reason}"


def listed(words: Iterable[str]) -> str:
    """Words as a sentence has them: "a", "a and b", "a, b and c"."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def _read(path: Path, problems: list[str]) -> dict[str, Any]:
    """The content of a TOML file; {} and a message in `problems` if it cannot be read."""
    try:
        return parsed(_config_text(path), path) if path.suffix == ".nc" else read_toml(path)
    except InputError as error:
        problems.append(f"--config {error}.")
    except FileNotFoundError:
        others = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        problems.append(f"--config {path}: there is no such file.{nearest(path.name, others)}")
    except IsADirectoryError:
        problems.append(f"--config {path}: is a directory, must be a TOML file.")
    except OSError as error:
        problems.append(f"--config {path}: cannot be read: {error.strerror}.")
    return {}


def _config_text(path: Path) -> str:
    """The parameters that a NetCDF file of a run holds as its attribute config_toml."""
    import taichi_lsm as lsm

    text = lsm.open_run(path).attrs.get("config_toml")
    if not isinstance(text, str):
        raise InputError(
            f"{path}: has no attribute config_toml, must be a TOML file or a file of a run, such as run.nc"
        )
    return text
