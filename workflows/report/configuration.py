"""Parameters of a run: what was given against the preset, what had no effect, and all others."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

from taichi_lsm.core.errors import InputError
from workflows.common.discovery import DiscoveryError, workflow
from workflows.common.parameter_files import CONFIG, config_in, experiment_of
from workflows.common.parameters import Params, merge
from workflows.common.toml_writer import toml_value
from workflows.report.parts import Section, Table

UNIT = re.compile(r" \[([^\[\]]+)\]$")
STUDIES = ("sweep.toml", "calibrate.toml")  # files of many runs
MOST_TEXT = 2**17  # letters of a file that is shown as it is


class Given(NamedTuple):
    """Parameters of the run in a folder.

    Attributes
    ----------
    experiment
        Its name, "" if it is not known.
    params
        None if they cannot be read.
    problem
        Why they cannot, in one line.
    """

    experiment: str
    params: Params | None
    problem: str = ""


def parameters_of(folder: Path) -> Given:
    """The parameters of the run in a folder, as far as they can be read."""
    name = ""
    try:
        name = experiment_of(folder)
        return Given(name, merge(workflow(name).Params, None, config_in(folder), experiment=name))
    except (InputError, DiscoveryError, OSError) as error:
        return Given(name, None, str(error).splitlines()[0])


def configuration(folder: Path, given: Given) -> Section:
    """The parameters of a run in tables, and the file that repeats it."""
    section = Section("configuration", "Configuration")
    if given.params is not None:
        section.tables.extend(_tables(given.params))
        section.texts.append(_summary(given.params))
    for name in (CONFIG, *STUDIES):
        path = folder / name
        if path.is_file():
            text = path.read_text(encoding="utf-8", errors="replace")[:MOST_TEXT]
            section.listings.append((f"{name}, as it is in the folder", text))
    if given.params is None and not any((folder / name).is_file() for name in STUDIES):
        section.texts.append(f"The parameters cannot be told apart: {given.problem}")
    return section


def _summary(params: Params) -> str:
    preset = f"the preset {params.preset_name}" if params.preset_name else "the defaults"
    return f"The run began with {preset}; the first table has what differs from it."


def _tables(params: Params) -> list[Table]:
    """Parameters that differ from the preset, that are as in it, and that had no effect."""
    try:
        preset = merge(type(params), params.preset_name)
    except InputError:  # it is gone, or one of another version
        preset = None
    idle, stands_for = params.idle(), params.resolved()
    changed, same, unused = [], [], []
    for name, field in type(params).model_fields.items():
        value, text = getattr(params, name), " ".join((field.description or "").split())
        unit = UNIT.search(text)
        words, of = text[: unit.start()] if unit else text, unit[1] if unit else ""
        told = _value(params, name)
        if value is None and stands_for[name] is not None:
            told = f"none, which stands for {stands_for[name]:.6g}"
        if name in idle:
            unused.append((name, told, of, idle[name]))
        elif preset is None or value == getattr(preset, name):
            same.append((name, told, of, words))
        else:
            changed.append((name, told, of, _value(preset, name), words))
    tables = []
    if changed:
        head = ("parameter", "value", "unit", "in the preset", "meaning")
        tables.append(Table("Given: what differs from the preset", head, changed, texts=frozenset({1, 2, 3, 4})))
    head, texts = ("parameter", "value", "unit", "meaning"), frozenset({1, 2, 3})
    tables.append(Table("As in the preset" if preset else "Values", head, same, texts=texts))
    if unused:
        tables.append(Table("Without effect in this run", (*head[:3], "why"), unused, texts=texts))
    return tables


def _value(params: Params, name: str) -> str:
    """A value as TOML has it, texts without quotes."""
    value: Any = params.model_dump(mode="json", round_trip=True)[name]
    return "none" if value is None else value if isinstance(value, str) else toml_value(value)
