"""Mistakes in the parameters of a workflow, in words: the option, its value, its source, what is allowed."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, get_origin

import pydantic

from taichi_lsm.core.errors import InputError
from workflows.common.former_names import renamed
from workflows.common.parameter_types import allowed, choices, kind, members, other_words

if TYPE_CHECKING:
    from workflows.common.parameters import Params

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

OPTION = re.compile(r"--[\w-]+")
VALUE = re.compile(r"^(--[\w-]+) ((?:(?! must | is |--).)*?): ")  # with which a message begins
LONGEST_TEXT = 80  # characters of a value that are shown
MOST_TEXTS = 6  # items of a list


class BrokenRules(ValueError):
    """Rules between fields that values break; `problems` holds one message for each."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = list(problems)
        super().__init__("; ".join(self.problems))


def option_name(field: str) -> str:
    """The option of a field: normal_stress -> --normal-stress."""
    return "--" + field.replace("_", "-")


def nearest(word: str, names: Iterable[str]) -> str:
    """Text " Did you mean ...?" with the name most like `word`, or "" if none is; of a former name the present one."""
    names = list(names)
    if now := renamed(word, names):
        return f" {word} is now called {now}."
    match = difflib.get_close_matches(str(word), names, n=1)
    return f" Did you mean {match[0]}?" if match else ""


def without_effect(name: str, value: Any, reason: str, source: str = "") -> str:
    """The message about a value that would change nothing; `source` in parentheses, after a space."""
    return f"{option_name(name)} {value}{source}: has no effect {reason}; leave it out"


def explain(error: pydantic.ValidationError, params_class: type[Params], values: dict, sources: dict) -> list[str]:
    """One message per mistake: the option, its value, its source, what is allowed, the nearest name.

    A value without effect is called that, whatever it is.
    """
    messages: dict[tuple, str] = {}
    idle = _idle(error, params_class, values)
    for item in error.errors(include_url=False):
        loc = item["loc"]
        reason = str(item.get("ctx", {}).get("error", "")) or item["msg"].replace("Input should", "must")
        if not loc:  # rules between several fields
            for text in getattr(item.get("ctx", {}).get("error"), "problems", [reason]):
                messages[(text,)] = text.rstrip(".") + "."
            continue
        name = str(loc[0])
        if name not in params_class.model_fields:
            hint = nearest(name, params_class.model_fields)
            messages[loc] = f"{option_name(name)} {as_written(item['input'])}: unknown parameter.{hint}"
            continue
        field = params_class.model_fields[name]
        source = "" if sources.get(name) == "option" else f" ({sources.get(name, 'default')})"
        if item["type"] == "missing" and len(loc) == 1:
            messages[loc] = f"{option_name(name)}: is required, must be {allowed(field)}."
        elif name in idle:
            messages[(name,)] = without_effect(name, as_written(values[name]), idle[name], source)
        elif kind(field.annotation) == "toml":
            place = name + "".join(f"[{p}]" if isinstance(p, int) else f".{as_written(p)}" for p in loc[1:])
            wrong = _no_tables(name, field.annotation, item, loc) or _nested(params_class, loc, item, reason)
            messages[loc] = f"{place} = {as_written(item['input'])}{source}: {wrong}"
        else:
            # Every alternative of a union and every item of a list has its error, for one mistake.
            must = f"must be {allowed(field)}" if item["type"].endswith(EXPLAINED) else reason
            others = [word for words in other_words(field).values() for word in words]
            hint = nearest(item["input"], [*choices(field.annotation), *others])
            shown = as_written(values.get(name, field.default))
            messages.setdefault((name,), f"{option_name(name)} {shown}{source}: {must.rstrip('.')}.{hint}")
    return list(messages.values())


def as_arguments(problems: Iterable[str], fields: Iterable[str]) -> list[str]:
    """Messages that name arguments as Python has them: "normal_stress = -1: must be" for "--normal-stress -1: must"."""
    options = {option_name(field): field for field in fields}

    def argument(found: re.Match[str]) -> str:
        return options.get(found[0], found[0].removeprefix("--").replace("-", "_"))

    return [OPTION.sub(argument, VALUE.sub(r"\1 = \2: ", text)) for text in problems]


def rules_between(
    error: pydantic.ValidationError, params_class: type[Params], values: dict, known: list[str]
) -> list[str]:
    """Broken rules between fields that pydantic did not reach because a field was wrong by itself.

    In a list of tables the keys that are wrong are left out: rules between the others, and between tables, are told,
    but for those that rest on such a key.
    """
    wrong = _wrong(error)
    tables, keys = _mended(error, values)
    try:
        params_class.model_validate(_without(values, wrong) | tables)
    except pydantic.ValidationError as later:
        found = [text for text in explain(later, params_class, values, {}) if text not in known]
        return [text for text in found if not any(re.search(rf"\b{re.escape(key)}\b", text) for key in keys)]
    return []


def _mended(error: pydantic.ValidationError, values: dict) -> tuple[dict[str, list], set[str]]:
    """({field: tables without their wrong keys}, these keys) of the lists of tables in which single keys are wrong."""
    places: dict[str, dict[int, set[str]]] = {}
    lost: set[str] = set()
    for item in error.errors(include_url=False):
        loc = item["loc"]
        name = str(loc[0]) if loc else ""
        if len(loc) < 3 or not isinstance(loc[1], int) or not isinstance(values.get(name), list):
            lost.add(name)  # of which more than keys of tables is wrong
            continue
        places.setdefault(name, {}).setdefault(loc[1], set()).add(str(loc[2]))
    kept = {name: keys for name, keys in places.items() if name not in lost}
    mended = {
        name: [_without(table, keys.get(i, set())) for i, table in enumerate(values[name])]
        for name, keys in kept.items()
    }
    return mended, {key for keys in kept.values() for those in keys.values() for key in those}


def _wrong(error: pydantic.ValidationError) -> set[str]:
    """Fields that are wrong by themselves."""
    return {str(item["loc"][0]) for item in error.errors(include_url=False) if item["loc"]}


def _without(values: Mapping[str, Any], names: set[str]) -> dict:
    return {name: value for name, value in values.items() if name not in names}


def _idle(error: pydantic.ValidationError, params_class: type[Params], values: dict) -> dict[str, str]:
    """Those of the wrong fields that have no effect beside the others, with the reason.

    A reason that rests on another wrong field does not count: that one stands at its default here.
    """
    wrong = _wrong(error)
    try:
        idle = params_class.model_validate(_without(values, wrong)).idle()
    except (pydantic.ValidationError, InputError):
        return {}
    options = {option_name(name) for name in wrong}
    return {n: reason for n, reason in idle.items() if n in wrong and not options & set(OPTION.findall(reason))}


def _no_tables(name: str, annotation: Any, item: Mapping[str, Any], loc: tuple) -> str:
    """What a list of tables must be, where something else was given for it or for one of them; "" otherwise."""
    lists = [member for member in members(annotation) if get_origin(member) is list]
    if len(loc) > 2 or not lists or item["type"] not in ("list_type", "dict_type"):
        return ""
    return f'must be tables, each below a line [[{name}]] of its own, with two brackets, such as name = "NAME".'


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


def as_written(value: Any) -> str:
    """A value as the user wrote it, shortened; on one line, and with the codes of what cannot be printed."""
    if isinstance(value, str):
        short = value if len(value) <= LONGEST_TEXT else f"{value[:LONGEST_TEXT]}..."
        return short if short.isprintable() and short.strip() == short and short else repr(short)
    if isinstance(value, list | tuple) and value and all(isinstance(v, str) for v in value):
        return ",".join([*map(as_written, value[:MOST_TEXTS]), *["..."] * (len(value) > MOST_TEXTS)])
    return reprlib.repr(value)
