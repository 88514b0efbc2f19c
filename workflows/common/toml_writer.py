"""Parameters as TOML text, which is stored with every run and can be used as its --config."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from workflows.common.parameters import Params

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")


def to_toml(params: Params, experiment: str = "") -> str:
    """Every field of `params` as TOML, each under a comment with its description (which ends in the unit).

    With the name of the experiment it comes first, and the preset that the parameters started from. None is written as
    the string "none". Fields that have no effect (`Params.idle`) are comments. Lists of tables come last, as TOML
    requires.
    """
    plain = [f"# what these parameters are for\nexperiment = {_text(experiment)}"] if experiment else []
    if experiment and params.preset_name:
        plain.append(f"# with which they began; all values that differ are below\npreset = {_text(params.preset_name)}")
    tables = []
    values = params.model_dump(mode="json", round_trip=True)
    idle = params.idle()
    for name, field in type(params).model_fields.items():
        value = values[name]
        comment = [f"# {' '.join(field.description.split())}"] if field.description else []
        if name in idle:
            plain.append("\n".join([*comment, f"# {name} = {toml_value(value)}  # no effect {idle[name]}"]))
        elif blocks := table_blocks(name, value):
            tables.append("\n".join(["", *comment, "\n\n".join(blocks)]))
        else:
            plain.append("\n".join([*comment, f"{name} = {toml_value(value)}"]))
    return "\n".join(plain + tables) + "\n"


def table_blocks(name: str, value: Any) -> list[str]:
    """A table as a block [name], those of a list each as a block [[name]]; [] for any other value."""
    if isinstance(value, dict):
        return ["\n".join([f"[{name}]", *_pairs(value)])]
    if isinstance(value, list) and all(isinstance(item, dict) for item in value):
        return ["\n".join([f"[[{name}]]", *_pairs(table)]) for table in value]
    return []


def toml_value(value: Any) -> str:
    """A value as TOML has it, on one line; None is the text "none"."""
    if value is None:
        return '"none"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(_pairs(value)) + "}"
    return repr(value)


def _pairs(table: dict) -> list[str]:
    # A key without a value is left out of a nested table: there None is always the default.
    return [f"{_key(k)} = {toml_value(v)}" for k, v in table.items() if v is not None]


def _key(key: str) -> str:
    return key if BARE_KEY.match(key) else _text(key)


def _text(text: str) -> str:
    # A JSON string is a TOML basic string, but for DEL, which TOML wants escaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
