"""Parameters of a workflow: one pydantic model, filled from a preset, a TOML file and options, in that order.

The same field is an option (`--normal-stress`), a TOML key (`normal_stress`) and a keyword argument.
"""

from __future__ import annotations

import difflib
import os
import reprlib
import tomllib
import types
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

import pydantic
from pydantic import ConfigDict, Field, ValidationInfo, field_validator

from taichi_lsm.core.errors import InputError
from workflows.common.parameter_types import accepts, allowed, choices, kind, split_list
from workflows.common.toml_writer import to_toml

__all__ = ["DEFAULT_PRESET", "ParameterError", "Params", "merge", "nearest", "option_name", "to_toml"]

DEFAULT_PRESET = "standard"

# Errors of pydantic that the words of `allowed` explain; for the others its own message says more.
EXPLAINED = (
    "_type",
    "_parsing",
    "greater_than",
    "greater_than_equal",
    "less_than",
    "less_than_equal",
    "literal_error",
    "int_from_float",
    "enum",
    "too_short",
    "too_long",
    "multiple_of",
)


class ParameterError(InputError):
    """One or more mistakes in the parameters. `problems` holds one message for each."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = list(problems)

    def __reduce__(self) -> tuple:
        return ParameterError, (self.problems,)


class Params(pydantic.BaseModel):
    """Base of every workflow's parameters. Descriptions end with the unit in brackets."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)

    presets: ClassVar[dict[str, dict]] = {"smoke": {}, "demo": {}, "standard": {}, "reference": {}}

    seed: int = Field(default=1, ge=0, le=2**31 - 1, description="seed of every random number")
    precision: Literal["f64", "f32"] = Field(default="f64", description="floating-point type of contacts and forces")
    arch: Literal["cpu", "gpu"] = Field(default="cpu", description="device that the kernels run on")
    threads: int = Field(default=1, ge=1, le=1024, description="CPU threads; the results do not depend on it")

    format: Literal["png", "pdf", "svg"] = Field(default="png", description="format of the pictures")

    @cached_property
    def preset_name(self) -> str | None:
        """The preset these parameters started from, or None if they were built in Python.

        A cached property and no field: it labels a summary, but is left out of equality and of the TOML.
        """
        return None

    @cached_property
    def given(self) -> frozenset[str]:
        """Fields that the user set: by an option, in a TOML file or in Python, but not by a preset."""
        return frozenset(self.model_fields_set)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of where these parameters come from, one line each."""
        return ()

    def idle(self) -> dict[str, str]:
        """Fields that have no effect beside the values of the others, each with the reason; none here."""
        return {}

    def resolved(self) -> dict[str, Any]:
        """Values by field, with what stands for those that are none, as far as it is known before a run."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    @field_validator("*", mode="before")
    @classmethod
    def _tell_apart(cls, value: Any, info: ValidationInfo) -> Any:
        field = cls.model_fields[info.field_name or ""]
        # TOML has no null and an option is text, so none is written as a word.
        if isinstance(value, str) and value.lower() == "none" and accepts(field.annotation, types.NoneType):
            return None
        # pydantic would read true as the number 1.
        takes_bool = kind(field.annotation) != "text" or accepts(field.annotation, bool)
        if isinstance(value, bool) and not takes_bool:
            raise ValueError(f"must be {allowed(field)}")
        return value


OfOneWorkflow = TypeVar("OfOneWorkflow", bound=Params)


def option_name(field: str) -> str:
    """The option of a field: normal_stress -> --normal-stress."""
    return "--" + field.replace("_", "-")


def nearest(word: str, names: Iterable[str]) -> str:
    """Text " Did you mean ...?" with the name most like `word`, or "" if none is."""
    match = difflib.get_close_matches(str(word), list(names), n=1)
    return f" Did you mean {match[0]}?" if match else ""


def merge(
    params_class: type[OfOneWorkflow],
    preset: str | None = None,
    toml_path: str | os.PathLike[str] | None = None,
    options: Mapping[str, Any] | None = None,
    elsewhere: Iterable[str] = (),
) -> OfOneWorkflow:
    """Parameters from a preset, overridden by a TOML file, overridden by options, each as a whole; validated once.

    Parameters
    ----------
    params_class
        Of the workflow.
    preset
        A key of `params_class.presets`; None is "standard".
    toml_path
        A TOML file, or None.
    options
        Field name -> value; a string is parsed, for a list at its commas.
    elsewhere
        Fields of other experiments. A TOML file that has one of them was written for another experiment: what this one
        does not have, or cannot use, is left out and named in `notes`.

    Raises
    ------
    ParameterError
        With every mistake of all three sources.
    """
    fields = params_class.model_fields
    problems: list[str] = []
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}

    def layer(source: str, given: dict[str, Any]) -> None:
        for key, value in given.items():
            if key in fields:
                values[key], sources[key] = value, source
            else:
                hint = nearest(key, fields)
                problems.append(f"{key} = {_shown(value)} ({source}): unknown parameter.{hint}")

    name = DEFAULT_PRESET if preset is None else preset
    presets = {**params_class.presets, DEFAULT_PRESET: params_class.presets.get(DEFAULT_PRESET, {})}
    if name in presets:
        layer(f"preset {name}", presets[name])
    else:
        problems.append(
            f"--preset {name}: unknown preset, must be one of {', '.join(presets)}." + nearest(name, presets)
        )
    of_file = {} if toml_path is None else _read_toml(Path(toml_path), problems)
    foreign = (set(elsewhere) - set(fields)) & set(of_file)
    layer(str(toml_path), {key: value for key, value in of_file.items() if key not in foreign})
    given = (options or {}).items()
    layer("option", {k: split_list(fields[k].annotation, v) if k in fields else v for k, v in given})
    params = None
    try:
        params = params_class.model_validate(values)
    except pydantic.ValidationError as error:
        problems += _explain(error, params_class, values, sources)
        problems += _rules_between(error, params_class, values, problems)
    if problems or params is None:
        raise ParameterError(problems)
    _remember_sources(params, name, sources, str(toml_path), foreign)
    return params


def _remember_sources(params: Params, preset: str, sources: dict[str, str], path: str, foreign: set[str]) -> None:
    """Fill in `preset_name`, `given` and `notes`, in the place of the cached properties.

    foreign: fields in the file at `path` that only other experiments have.
    """
    given = {key for key, source in sources.items() if source != f"preset {preset}"}
    if foreign:
        unused = {key for key in params.idle() if sources.get(key) == path}
        given -= unused
        left_out = ", ".join(sorted(foreign | unused))
        vars(params)["notes"] = (f"{path}: is of another experiment; left out of it: {left_out}",)
    vars(params)["preset_name"], vars(params)["given"] = preset, frozenset(given)


def _read_toml(path: Path, problems: list[str]) -> dict:
    """The tables of a TOML file; {} and a message in `problems` if it cannot be read."""
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


def _explain(error: pydantic.ValidationError, params_class: type[Params], values: dict, sources: dict) -> list[str]:
    """One message per mistake: the option, its value, its source, what is allowed, the nearest name."""
    messages: dict[tuple, str] = {}
    for item in error.errors(include_url=False):
        loc = item["loc"]
        reason = str(item.get("ctx", {}).get("error", "")) or item["msg"].replace("Input should", "must")
        if not loc:  # a rule between several fields
            messages[(reason,)] = reason.rstrip(".") + "."
            continue
        name = str(loc[0])
        field = params_class.model_fields[name]
        source = "" if sources.get(name) == "option" else f" ({sources.get(name, 'default')})"
        if item["type"] == "missing" and len(loc) == 1:
            messages[loc] = f"{option_name(name)}: is required, must be {allowed(field)}."
        elif kind(field.annotation) == "toml":
            place = name + "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in loc[1:])
            wrong = _nested(params_class, loc, item, reason)
            messages[loc] = f"{place} = {_shown(item['input'])}{source}: {wrong}"
        else:
            # Every alternative of a union and every item of a list has its error, for one mistake.
            must = f"must be {allowed(field)}" if item["type"].endswith(EXPLAINED) else reason
            hint = nearest(item["input"], choices(field.annotation))
            shown = _shown(values.get(name, field.default))
            messages.setdefault((name,), f"{option_name(name)} {shown}{source}: {must.rstrip('.')}.{hint}")
    return list(messages.values())


def _rules_between(
    error: pydantic.ValidationError, params_class: type[Params], values: dict, known: list[str]
) -> list[str]:
    """Broken rules between fields that pydantic did not reach because a field was wrong by itself."""
    wrong = {item["loc"][0] for item in error.errors(include_url=False) if item["loc"]}
    try:
        params_class.model_validate({name: value for name, value in values.items() if name not in wrong})
    except pydantic.ValidationError as later:
        return [text for text in _explain(later, params_class, values, {}) if text not in known]
    return []


def _nested(params_class: type[Params], loc: tuple, item: Mapping[str, Any], reason: str) -> str:
    """What is wrong inside a table: for an unknown key the nearest one, else pydantic's reason."""
    if item["type"] != "extra_forbidden":
        return reason.rstrip(".") + "."
    return f"unknown key.{nearest(loc[-1], _keys_at(params_class, loc[:-1]))}"


def _keys_at(model: type[pydantic.BaseModel], loc: tuple) -> list[str]:
    """The keys that the table at `loc` allows, [] where the type of the table is not certain."""
    for part in loc:
        if isinstance(part, str) and part in model.model_fields:
            found = _models(model.model_fields[part].annotation)
            if len(found) != 1:
                return []
            model = found[0]
    return list(model.model_fields)


def _models(annotation: Any) -> list[type[pydantic.BaseModel]]:
    """Every model class in an annotation, e.g. [Effect] of list[Effect] | None."""
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        return [annotation]
    return [m for part in getattr(annotation, "__args__", ()) for m in _models(part)]


def _shown(value: Any) -> str:
    """A value as the user wrote it, shortened."""
    if isinstance(value, str):
        return value if value and value.strip() == value else repr(value)
    if isinstance(value, list | tuple):
        return ",".join(value) if value and all(isinstance(v, str) for v in value) else reprlib.repr(value)
    return reprlib.repr(value)
