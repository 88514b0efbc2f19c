"""Parameters of a workflow: one pydantic model, filled from a preset, a TOML file and options, in that order.

The same field is an option (`--normal-stress`), a TOML key (`normal_stress`) and a keyword argument.
"""

from __future__ import annotations

import os
import types
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeVar

import pydantic
from pydantic import ConfigDict, Field, ModelWrapValidatorHandler, ValidationInfo, field_validator, model_validator

from taichi_lsm.core.errors import InputError
from workflows.common.parameter_files import OfFile, not_taken, read_for
from workflows.common.parameter_problems import as_arguments, as_written, explain, nearest, option_name, rules_between
from workflows.common.parameter_types import accepts, allowed, kind, split_list
from workflows.common.toml_writer import to_toml

__all__ = ["DEFAULT_PRESET", "ParameterError", "Params", "merge", "nearest", "option_name", "to_toml"]

DEFAULT_PRESET = "standard"
MOST_PROBLEMS = 40  # that are told


class ParameterError(InputError):
    """One or more mistakes in the parameters. `problems` holds one message for each, but for those beyond the first."""

    def __init__(self, problems: list[str]) -> None:
        more = len(problems) - MOST_PROBLEMS
        self.problems = [*problems[:MOST_PROBLEMS], f"... and {more} mistakes more."] if more > 1 else list(problems)
        super().__init__("\n".join(self.problems))

    def __reduce__(self) -> tuple:
        return ParameterError, (self.problems,)


class Params(pydantic.BaseModel):
    """Base of every workflow's parameters. Descriptions end with the unit in brackets."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)

    presets: ClassVar[dict[str, dict]] = {"smoke": {}, "demo": {}, "standard": {}, "reference": {}}

    # Groups of fields that are ways to give the same thing: one that the user gives replaces that of a preset.
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()

    # Fields that change no result: they may differ in a run that goes on, and tell no run from another.
    without_result: ClassVar[frozenset[str]] = frozenset({"threads", "format"})

    seed: int = Field(default=1, ge=0, le=2**31 - 1, description="seed of every random number")
    precision: Literal["f64", "f32"] = Field(default="f64", description="floating-point type of contacts and forces")
    arch: Literal["cpu", "gpu"] = Field(default="cpu", description="device that the kernels run on")
    threads: int = Field(default=1, ge=1, le=1024, description="CPU threads; the results do not depend on it")

    format: Literal["png", "pdf", "svg"] = Field(default="png", description="format of the pictures")

    def __init__(self, **values: Any) -> None:
        """Check parameters that are given in Python.

        Raises
        ------
        ParameterError
            With every mistake, in place of pydantic's error.
        """
        try:
            super().__init__(**values)
        except pydantic.ValidationError as error:
            kind, sources = type(self), dict.fromkeys(values, "option")
            problems = explain(error, kind, values, sources)
            problems += rules_between(error, kind, values, problems)
            raise ParameterError(as_arguments(problems, kind.model_fields)) from None

    # Else pydantic would call it also where `merge` validates, which explains the mistakes by their sources itself.
    __init__.__pydantic_base_init__ = True  # pyright: ignore[reportFunctionMemberAccess]

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
    def sources(self) -> dict[str, str]:
        """{field: file that gave it} of those of a file, as messages show it: " (scene.toml)"."""
        return {}

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of where these parameters come from, one line each."""
        return ()

    def read_as(self, name: str, word: str) -> str | None:
        """What another word for a choice of a field means beside the others, as "in 2D means discs".

        None where it is what the word says.
        """
        return None

    def remarks(self) -> Iterator[str]:
        """What is allowed and may yet surprise, one line each; none here."""
        yield from ()

    def idle(self) -> dict[str, str]:
        """Fields that have no effect beside the values of the others, each with the reason; none here."""
        return {}

    def time_of_stages(self) -> float:
        """Expected time of the stages of a run after its start [s]; nan where it has none."""
        return float("nan")

    def resolved(self) -> dict[str, Any]:
        """Values by field, with what stands for those that are none, as far as it is known before a run."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    @model_validator(mode="wrap")
    @classmethod
    def _note_other_words(cls, values: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Keep in `notes` what another word for a choice means, as for parameters that `merge` makes."""
        params = handler(values)
        if isinstance(values, Mapping):
            words = _other_words(params, values, dict.fromkeys(values, "option"))
            vars(params)["notes"] = (*words, *params.remarks())
        return params

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
    experiment: str = "",
    others: Mapping[str, Collection[str]] | None = None,
) -> OfOneWorkflow:
    """Parameters from a preset, overridden by a TOML file, overridden by options, each as a whole; validated once.

    Parameters
    ----------
    params_class
        Of the workflow.
    preset
        A key of `params_class.presets`; None is that of the file, or "standard".
    toml_path
        A TOML file, or None: keys at its top, and a table named after the experiment, which wins. Or a NetCDF file of a
        run, which holds the parameters of that run.
    options
        Field name -> value; a string is parsed, for a list at its commas.
    experiment, others
        Name of the experiment, and fields of every other one by its name. A TOML file that has a field or a table of
        another one was written for that one as well: what this one does not have, or has no use for, is not taken, and
        `notes` says so.

    Raises
    ------
    ParameterError
        With every mistake of all three sources.
    """
    problems: list[str] = []
    of_file = OfFile({}, {}, False, ())
    if toml_path is not None:
        of_file = read_for(Path(toml_path), experiment, params_class.model_fields, others or {}, problems)
    return merge_read(params_class, preset, of_file, str(toml_path), options, experiment, problems)


def merge_read(
    params_class: type[OfOneWorkflow],
    preset: str | None,
    of_file: OfFile,
    source: str,
    options: Mapping[str, Any] | None = None,
    experiment: str = "",
    mistakes: Sequence[str] = (),
) -> OfOneWorkflow:
    """As `merge`, with a file that was read before, once for many runs.

    Parameters
    ----------
    params_class, preset, options, experiment
        As for `merge`.
    of_file, source, mistakes
        What the file gives to the experiment; its name, for messages; the mistakes found when it was read.

    Raises
    ------
    ParameterError
        As `merge`.
    """
    problems = list(mistakes)
    name = preset or of_file.preset or DEFAULT_PRESET
    layers = {f"preset {name}": _preset(params_class, name, problems)}
    layers |= {source: of_file.top, f"{source}, [{experiment}]": of_file.own}
    layers["option"] = _options(params_class, options or {})
    _give_way(layers[f"preset {name}"], params_class, list(layers.values())[1:])
    values, sources = _overlaid(params_class, layers, problems)
    params = None
    try:
        params = params_class.model_validate(values)
    except pydantic.ValidationError as error:
        problems += explain(error, params_class, values, sources)
        problems += rules_between(error, params_class, values, problems)
    if problems or params is None:
        raise ParameterError(problems)
    # What a file for several experiments sets without effect here was meant for the others.
    idle = params.idle() if of_file.shared else {}
    unused = {key: reason for key, reason in idle.items() if sources.get(key) == source}
    given = {key for key, source in sources.items() if source != f"preset {name}"} - set(unused)
    notes = [*of_file.notes, *_unused_notes(source, unused), *_other_words(params, values, sources)]
    notes += params.remarks()
    # In the place of the cached properties.
    files = {key: f" ({source})" for key, source in sources.items() if source not in ("option", f"preset {name}")}
    vars(params).update(preset_name=name, given=frozenset(given), notes=tuple(notes), sources=files)
    return params


def _preset(params_class: type[Params], name: str, problems: list[str]) -> dict[str, Any]:
    """The values of a preset; {} and a message in `problems` if there is none of this name."""
    presets = {**params_class.presets, DEFAULT_PRESET: params_class.presets.get(DEFAULT_PRESET, {})}
    if name not in presets:
        known = ", ".join(presets)
        problems.append(
            f"--preset {as_written(name)}: unknown preset, must be one of {known}." + nearest(name, presets)
        )
    return dict(presets.get(name, {}))


def _options(params_class: type[Params], options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with their lists split at the commas."""
    fields = params_class.model_fields
    return {k: split_list(fields[k].annotation, v) if k in fields else v for k, v in options.items()}


def _give_way(preset: dict[str, Any], params_class: type[Params], given: Iterable[Mapping[str, Any]]) -> None:
    """Take from the values of a preset what the user gave in another of the ways that exclude each other."""
    users = {key for layer in given for key in layer}
    for ways in params_class.alternatives:
        if users & set(ways):
            for way in ways:
                preset.pop(way, None)


def _overlaid(
    params_class: type[Params], layers: Mapping[str, Mapping[str, Any]], problems: list[str]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Values of all sources, of which later ones win, and the source of each; what is no field is a problem."""
    fields = params_class.model_fields
    values, sources = {}, {}
    for source, given in layers.items():
        for key, value in given.items():
            if key in fields:
                values[key], sources[key] = value, source
            else:
                hint = nearest(key, fields) if len(problems) < MOST_PROBLEMS else ""
                problems.append(f"{as_written(key)} = {as_written(value)} ({source}): unknown parameter.{hint}")
    return values, sources


def _unused_notes(path: str, unused: Mapping[str, str]) -> Iterator[str]:
    """One line for all fields of a file that have no effect for the same reason."""
    for reason in dict.fromkeys(unused.values()):
        keys = [key for key, why in unused.items() if why == reason]
        yield not_taken(path, keys, f"{'it has' if len(keys) == 1 else 'they have'} no effect {reason}")


def _other_words(params: Params, values: Mapping[str, Any], sources: Mapping[str, str]) -> Iterator[str]:
    """One line for each word for a choice that means something else beside the other fields."""
    for name, value in values.items():
        source = "" if sources[name] == "option" else f" ({sources[name]})"
        for word in value if isinstance(value, list | tuple) else (value,):
            meaning = params.read_as(name, word) if isinstance(word, str) else None
            if meaning:
                yield f"{option_name(name)} {word}{source} {meaning}"
