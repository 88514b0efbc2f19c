"""The command of an experiment: a function with one option for each of its parameters."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter
from pydantic.fields import FieldInfo

from workflows.cli.execution import execute
from workflows.common.discovery import DiscoveryError
from workflows.common.parameter_types import allowed, choices, choices_in_words, kind, limits, metavar
from workflows.common.parameters import DEFAULT_PRESET, Params, option_name

# cyclopts itself has groups called Commands, Parameters and Arguments; the names must differ from those.
PHYSICS = Group("Experiment", sort_key=1)
MACHINE = Group("Computation", sort_key=2)
FILES = Group("Files and display", sort_key=3)
FLAG: dict[str, Any] = {"negative": ()}
PATHS = ("config", "out")  # options that are files or folders
RESERVED: dict[str, tuple[type, str, dict[str, Any]]] = {  # type, help and form of the options of every experiment
    "preset": (str, "starting values; one of {presets}", {"metavar": "NAME"}),
    "config": (
        str,
        "TOML file, or run.nc of a run to repeat; wins over the preset; a table [NAME] in it is for the experiment "
        "NAME alone",
        {"metavar": "FILE"},
    ),
    "out": (str, "folder to write", {"metavar": "DIR"}),
    "overwrite": (
        bool,
        "write to a folder that is not empty: what a run has left there is removed, other files stay",
        FLAG,
    ),
    "quiet": (bool, "print nothing but errors, notes and claims that are not met", FLAG),
    "yes": (bool, "start also what takes more than a day or half of the memory", FLAG),
    "strict": (bool, "exit with code 3 if a claim is not met", FLAG),
}


def workflow_command(name: str, module: ModuleType, to_complete: bool = False) -> Callable[..., int]:
    """A function that runs the workflow, with one keyword-only parameter per option.

    Every option but a flag is taken as text, so that pydantic checks all of them together. to_complete: with the types
    by which a shell completes them instead, choices, paths and flags; it is not to be called.
    """
    params_class: type[Params] = module.Params
    default_values = {
        **{f: d.default for f, d in params_class.model_fields.items() if not d.is_required()},
        **params_class.presets.get(DEFAULT_PRESET, {}),
    }
    presets = list({**params_class.presets, DEFAULT_PRESET: {}})

    def parameter(key: str, annotation: Any, group: Group, text: str, names: list[str], default: str | None, **more):
        spec = Parameter(name=option_name(key), group=group, help=text, show_default=default or False, **more)
        taken = _completed(key, annotation, names) if to_complete else annotation | None
        return inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[taken, spec])

    shown = {"preset": DEFAULT_PRESET, "out": f"out/{name}"}
    listed = [
        parameter(key, type_, FILES, text.format(presets=", ".join(presets)), presets, shown.get(key), **more)
        for key, (type_, text, more) in RESERVED.items()
    ]
    only_toml = []
    for key, field in params_class.model_fields.items():
        if key in RESERVED:
            raise DiscoveryError(f"{module.__file__}: the parameter name {key} is taken by lsm itself.")
        how = kind(field.annotation)
        if how == "toml":
            only_toml.append(key)
            continue
        group = MACHINE if key in Params.model_fields else PHYSICS
        listed.append(
            parameter(
                key,
                bool if how == "flag" else str,
                group,
                option_help(field),
                choices(field.annotation),
                _shown(default_values.get(key)),
                metavar=metavar(field.annotation),
            )
        )

    def command(**options) -> int:
        given = {key: value for key, value in options.items() if value is not None}
        common = {key: given.pop(key) for key in RESERVED if key in given}
        return execute(name, module, given, **common)

    command.__name__ = name.replace("-", "_")
    command.__doc__ = _unwrapped(inspect.getdoc(module) or name)
    if only_toml:
        command.__doc__ += f"\n\nOnly in a TOML file (--config): {', '.join(only_toml)}."
    command.__signature__ = inspect.Signature(listed, return_annotation=int)
    command.__annotations__ = {p.name: p.annotation for p in listed} | {"return": int}
    return command


def _completed(key: str, annotation: Any, names: list[str]) -> Any:
    """The type of an option by which a shell completes it: a path, a choice of these names, or what it is."""
    if annotation is not str:
        return annotation
    if key in PATHS:
        return Path
    return Literal[tuple(names)] if names else str


def options_of(module: ModuleType) -> set[str]:
    """The options that a workflow has for its parameters: of all but those that only a TOML file can give."""
    fields = module.Params.model_fields
    return {option_name(name) for name, field in fields.items() if kind(field.annotation) != "toml"}


def _unwrapped(text: str) -> str:
    """The paragraphs of a docstring, each on one line: the terminal decides where lines end."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n"))


def option_help(field: FieldInfo) -> str:
    """Description of an option, which ends with the unit, and the allowed values."""
    names = choices_in_words(field)
    bounds = f"one of {names}" if names else limits(field.metadata)
    if kind(field.annotation) == "list":
        bounds = allowed(field) + ", separated by commas"
    return "; ".join(filter(None, [" ".join((field.description or "").split()), bounds]))


def _shown(value: Any) -> str | None:
    if value is None:
        return "none"
    if isinstance(value, list | tuple):
        return ",".join(map(str, value))
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
