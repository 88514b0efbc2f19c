"""A file of parameters to begin with: every one with its description, unit, bounds and default, in groups."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from workflows.common.parameter_types import allowed, items, kind, members
from workflows.common.parameters import DEFAULT_PRESET, Params, merge
from workflows.common.toml_writer import table_blocks, toml_value

WIDTH = 100  # of comments
SHARED = "How it is computed: the same parameters in every experiment"
OWN = "Of this experiment"  # where a plugin says no more
TABLES = "Tables, which must stand at the end of the file"
HEAD = """\
Parameters of lsm {experiment} --config FILE, with the values of the preset {preset}.
Each may be changed or left out. A # stands before those that are none, or have no effect beside
the others. A value that has no effect is refused with the reason: put a # before it.
"""


def template(params: Params, experiment: str) -> str:
    """TOML text with every parameter of an experiment, which gives these `params` as it stands.

    Each is under a comment with its description, which ends in the unit, what is allowed, and its default. Parameters
    that are none, or have no effect beside the others, are comments.

    Parameters
    ----------
    params
        Of a preset.
    experiment
        Its name.
    """
    preset, groups = params.preset_name or DEFAULT_PRESET, _groups(type(params))
    lines = [_comment(HEAD.format(experiment=experiment, preset=preset), wrap=False)]
    lines.append(f"experiment = {toml_value(experiment)}\npreset = {toml_value(preset)}")
    defaults = merge(type(params))
    for title, names in groups.items():
        lines.append(f"# {title} {'-' * max(3, WIDTH - len(title) - 3)}")
        lines += [_entry(name, params, defaults) for name in names]
    return "\n\n".join(lines) + "\n"


def _groups(params_class: type[Params]) -> dict[str, list[str]]:
    """Title -> parameters: those that a class adds, beginning with the experiment's own; tables are last."""
    fields, groups = params_class.model_fields, {}
    classes = [c for c in params_class.__mro__ if issubclass(c, Params)]
    tables = [name for name, field in fields.items() if kind(field.annotation) == "toml"]
    for owner in classes:
        # A class may give a parameter of another one another default: it stays in its group.
        above = {name for c in owner.__mro__[1:] if issubclass(c, Params) for name in c.model_fields}
        own = [name for name in fields if name in owner.model_fields and name not in {*above, *tables}]
        title = SHARED if owner is Params else (owner.__doc__ or OWN).split("\n")[0].rstrip(".")
        if own:
            groups[title] = own
    return groups | ({TABLES: tables} if tables else {})


def _entry(name: str, params: Params, defaults: Params) -> str:
    """One parameter with its comment."""
    field = type(params).model_fields[name]
    value, default = (p.model_dump(mode="json", round_trip=True)[name] for p in (params, defaults))
    about = [_comment(" ".join((field.description or "").split()))] if field.description else []
    if kind(field.annotation) == "toml" and not value:
        return "\n".join([*about, f"# [[{name}]]", _comment(_keys(field))])
    blocks = table_blocks(name, value) if value else []
    text = "\n\n".join(blocks) or f"{name} = {toml_value(value)}"
    if not blocks:
        about.append(_comment(f"{allowed(field)}; default {_word(default)}"))
    if idle := params.idle().get(name):
        text = _comment(f"{text}  # no effect {idle}", wrap=False)
    elif value is None:
        stands_for = params.resolved()[name]
        text = f"# {text}" + ("" if stands_for is None else f"  # stands for {stands_for:.6g}")
    return "\n".join([*about, text])


def _word(value: Any) -> str:
    """A default as the file would hold it, none without quotes."""
    return "none" if value is None else toml_value(value)


def _keys(field: FieldInfo) -> str:
    """The keys of the tables of a list, as far as their type tells."""
    tables = [item for sequence in members(field.annotation) for item in items(sequence)]
    return (
        "; ".join(
            f"keys: {', '.join(table.model_fields)}"
            for table in tables
            if isinstance(table, type) and issubclass(table, BaseModel)
        )
        or 'name = "..."'
    )


def _comment(text: str, wrap: bool = True) -> str:
    """Text as a comment of as many lines as it needs."""
    lines = _wrapped(text) if wrap else text.splitlines()
    return "\n".join(f"# {line}".rstrip() for line in lines)


def _wrapped(text: str) -> Iterator[str]:
    yield from textwrap.wrap(text, WIDTH - 2, break_long_words=False, break_on_hyphens=False)
