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
            plain.append("\n".join([*comment, f"# {name} = {_value(value)}  # no effect {idle[name]}"]))
        elif _is_table(value):
            tables.append("\n".join(["", *comment, f"[{name}]", *_pairs(value)]))
        elif isinstance(value, list) and value and all(map(_is_table, value)):
            blocks = ["\n".join([f"[[{name}]]", *_pairs(table)]) for table in value]
            tables.append("\n".join(["", *comment, "\n\n".join(blocks)]))
        else:
            plain.append("\n".join([*comment, f"{name} = {_value(value)}"]))
    return "\n".join(plain + tables) + "\n"


def _is_table(value: Any) -> bool:
    return isinstance(value, dict)


def _pairs(table: dict) -> list[str]:
    # A key without a value is left out of a nested table: there None is always the default.
    return [f"{_key(k)} = {_value(v)}" for k, v in table.items() if v is not None]


def _key(key: str) -> str:
    return key if BARE_KEY.match(key) else _text(key)


def _text(text: str) -> str:
    # A JSON string is a TOML basic string, but for DEL, which TOML wants escaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if value is None:
        return '"none"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(_pairs(value)) + "}"
    return repr(value)
