"""A TOML file of parameters, for one experiment or for several.

Keys at the top of the file are for the experiment that is run; a table named after an experiment, `[shear-gouge]`, is
for that one alone.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from workflows.common.parameter_problems import as_written, nearest


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
    """

    top: dict[str, Any]
    own: dict[str, Any]
    shared: bool
    notes: tuple[str, ...]


def read_for(
    path: Path, experiment: str, fields: Collection[str], others: Mapping[str, Collection[str]], problems: list[str]
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
    """
    top, own, tables, foreign = {}, {}, [], []
    for key, value in _read(path, problems).items():
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
                f"[{key}] ({path}): unknown table; a table is named after the experiment that it is for, one of "
                f"{', '.join(names)}.{nearest(key, names)}"
            )
        else:
            top[key] = value
    notes = [*_foreign_notes(path, experiment, foreign, others)]
    notes += [f"{path}: the table [{name}] was not taken: it is for that experiment" for name in tables]
    return OfFile(top, own, bool(tables or foreign), tuple(notes))


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
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        others = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        problems.append(f"--config {path}: there is no such file.{nearest(path.name, others)}")
    except IsADirectoryError:
        problems.append(f"--config {path}: is a directory, must be a TOML file.")
    except OSError as error:
        problems.append(f"--config {path}: cannot be read: {error.strerror}.")
    except UnicodeDecodeError:
        problems.append(f"--config {path}: is not UTF-8 text, must be a TOML file.")
    except tomllib.TOMLDecodeError as error:
        problems.append(f"--config {path}: is not valid TOML: {error}.")
    return {}
