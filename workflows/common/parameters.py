"""Parameters of a workflow: one pydantic model, filled from a preset, a TOML file and options, in that order.

The same field is an option (`--normal-stress`), a TOML key (`normal_stress`) and a keyword argument.
"""

from __future__ import annotations

import os
import tomllib
import types
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

import pydantic
from pydantic import ConfigDict, Field, ValidationInfo, field_validator

from taichi_lsm.core.errors import InputError
from workflows.common.parameter_problems import as_written, explain, nearest, option_name, rules_between
from workflows.common.parameter_types import accepts, allowed, kind, split_list
from workflows.common.toml_writer import to_toml

__all__ = ["DEFAULT_PRESET", "ParameterError", "Params", "merge", "nearest", "option_name", "to_toml"]

DEFAULT_PRESET = "standard"


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

    def read_as(self, name: str, word: str) -> str | None:
        """What another word for a choice of a field means beside the others, as "in 2D means discs".

        None where it is what the word says.
        """
        return None

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
                problems.append(f"{key} = {as_written(value)} ({source}): unknown parameter.{hint}")

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
        problems += explain(error, params_class, values, sources)
        problems += rules_between(error, params_class, values, problems)
    if problems or params is None:
        raise ParameterError(problems)
    _remember_sources(params, name, sources, str(toml_path), foreign)
    vars(params)["notes"] = (*params.notes, *_other_words(params, values, sources))
    return params


def _other_words(params: Params, values: Mapping[str, Any], sources: Mapping[str, str]) -> Iterator[str]:
    """One line for each word for a choice that means something else beside the other fields."""
    for name, value in values.items():
        source = "" if sources[name] == "option" else f" ({sources[name]})"
        for word in value if isinstance(value, list | tuple) else (value,):
            meaning = params.read_as(name, word) if isinstance(word, str) else None
            if meaning:
                yield f"{option_name(name)} {word}{source} {meaning}"


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
