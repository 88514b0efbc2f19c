"""Type annotations of parameters: their form on the command line, and in words."""

from __future__ import annotations

import enum
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import GetCoreSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

# Singular and plural.
NOUNS = {
    bool: ("true or false", "true or false"),
    int: ("an integer", "integers"),
    float: ("a number", "numbers"),
    str: ("text", "texts"),
    Path: ("a path", "paths"),
}
SEQUENCES = (list, tuple, set, frozenset)


@dataclass(frozen=True)
class OtherNames:
    """Annotation of a text: other words for one of its choices, which are read as that choice.

    Attributes
    ----------
    choice
        The choice.
    words
        The other words for it.
    """

    choice: str
    words: tuple[str, ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """What pydantic checks: the annotated type, after the words are replaced."""
        return core_schema.no_info_before_validator_function(self._read, handler(source))

    def _read(self, word: Any) -> Any:
        return self.choice if word in self.words else word


def members(annotation: Any) -> list:
    """The alternatives of an annotation, without Annotated: float | None -> [float, NoneType]."""
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return [m for a in get_args(annotation) for m in members(a)]
    return [annotation]


def accepts(annotation: Any, kind_wanted: type) -> bool:
    """Whether `kind_wanted` is one of the alternatives of the annotation."""
    return kind_wanted in members(annotation)


def kind(annotation: Any) -> str:
    """Form of an option: "flag", "text" (one value), "list" (comma-separated), "toml" (in a TOML file only)."""
    options = [m for m in members(annotation) if m is not types.NoneType]
    if options == [bool]:
        return "flag"
    if all(_is_scalar(m) for m in options):
        return "text"
    if len(options) == 1 and get_origin(options[0]) in SEQUENCES and all(map(_is_scalar, items(options[0]))):
        return "list"
    return "toml"


def items(sequence: Any) -> list:
    """The alternatives of the items of list[...] or tuple[..., ...]."""
    return [m for a in get_args(sequence) if a is not Ellipsis for m in members(a)]


def _is_scalar(annotation: Any) -> bool:
    if get_origin(annotation) is Literal or annotation in NOUNS:
        return True
    return isinstance(annotation, type) and issubclass(annotation, enum.Enum)


def choices(annotation: Any) -> list[str]:
    """The names that a field, or an item of it, allows; [] if it is not an enumeration."""
    found = []
    for member in members(annotation):
        if get_origin(member) is Literal:
            found += [str(c) for c in get_args(member)]
        elif isinstance(member, type) and issubclass(member, enum.Enum):
            found += [str(c.value) for c in member]
        elif get_origin(member) in SEQUENCES:
            found += [c for item in items(member) for c in choices(item)]
    return list(dict.fromkeys(found))


def other_words(field: FieldInfo) -> dict[str, tuple[str, ...]]:
    """Other words for choices of a field, or of its items: {"round": ("disc", "sphere")}."""
    added = [*field.metadata, *_added(field.annotation)]
    return {names.choice: names.words for names in added if isinstance(names, OtherNames)}


def _added(annotation: Any) -> list:
    """What Annotated adds, anywhere in an annotation."""
    own = get_args(annotation)
    if get_origin(annotation) is Annotated:
        return [*own[1:], *_added(own[0])]
    return [extra for part in own for extra in _added(part)]


def choices_in_words(field: FieldInfo) -> str:
    """The choices of a field with the other words for them: "round (also disc, sphere), angular"; "" if it has none."""
    others = other_words(field)
    return ", ".join(
        f"{name} (also {', '.join(others[name])})" if name in others else name for name in choices(field.annotation)
    )


def split_list(annotation: Any, value: Any) -> Any:
    """The items of a comma-separated list, if the field is a list and the value a string; else the value."""
    if kind(annotation) == "list" and isinstance(value, str):
        return [part.strip() for part in value.split(",") if part.strip()]
    return value


def metavar(annotation: Any) -> str:
    """Placeholder of the value in a help text, as in --grains INTEGER."""
    if kind(annotation) == "list":
        return "LIST"
    first = members(annotation)[0]
    other = "NAME" if choices(annotation) else "TEXT"
    return {int: "INTEGER", float: "NUMBER", Path: "PATH"}.get(first, other)


def limits(metadata: list) -> str:
    """Bounds in words: "from 2 to 3", "greater than 0"; "" if there are none."""
    bound = {}
    for rule in metadata:
        for name in ("ge", "gt", "le", "lt", "multiple_of", "min_length", "max_length"):
            if getattr(rule, name, None) is not None:
                bound[name] = getattr(rule, name)
    words = []
    if "ge" in bound and "le" in bound:
        words.append(f"from {_digits(bound.pop('ge'))} to {_digits(bound.pop('le'))}")
    phrases = {
        "ge": "at least {}",
        "gt": "greater than {}",
        "le": "at most {}",
        "lt": "less than {}",
        "multiple_of": "a multiple of {}",
        "min_length": "of at least {} items",
        "max_length": "of at most {} items",
    }
    if bound.get("min_length") == 1:
        del bound["min_length"]
        words.append("not empty")
    words += [phrase.format(_digits(bound[name])) for name, phrase in phrases.items() if name in bound]
    return " and ".join(words)


def _digits(bound: float) -> str:
    """A bound as text: an integer with all its digits, others shortened."""
    return str(bound) if isinstance(bound, int) else f"{bound:g}"


def _noun(annotation: Any, names: str, plural: bool = False) -> str:
    """The values that an alternative allows; names: the choices of the field, in words."""
    if found := choices(annotation):
        prefix = "any of " if plural else "one of " if len(found) > 1 else ""
        return prefix + names
    return NOUNS.get(annotation, ("a value", "values"))[plural]


def allowed(field: FieldInfo) -> str:
    """Allowed values of a pydantic field, in words: "a number, greater than 0", "one of f64, f32"."""
    options = [m for m in members(field.annotation) if m is not types.NoneType]
    words, names = [], choices_in_words(field)
    for member in options:
        if get_origin(member) in SEQUENCES:
            inner = [a for a in get_args(member) if a is not Ellipsis]
            nouns = " or ".join(dict.fromkeys(_noun(m, names, plural=True) for m in items(member)))
            rules = [r for a in inner if get_origin(a) is Annotated for r in _flat(get_args(a)[1:])]
            words.append(", ".join(filter(None, [f"a list of {nouns}", limits(rules)])))
        else:
            words.append(_noun(member, names))
    text = " or ".join(dict.fromkeys(words))
    if bounds := limits(field.metadata):
        text += f", {bounds}"
    return text + (", or none" if accepts(field.annotation, types.NoneType) else "")


def _flat(rules) -> list:
    """Bounds inside Annotated: Field(ge=0) holds them in its metadata, those of annotated_types are bare."""
    found = [r for rule in rules for r in getattr(rule, "metadata", [rule])]
    return [r for r in found if isinstance(r, annotated_types.BaseMetadata)]
