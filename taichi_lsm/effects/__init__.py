"""Effects, one per file; `find_effects` discovers them here and in `$LSM_PLUGINS/effects`."""

import dataclasses
import difflib
import importlib
import importlib.util
import inspect
import os
import pkgutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from ..core.errors import InputError
from .base import Bodies, Effect, HistoryValue, contact_type, effect_name, finite, require


def find_effects() -> dict[str, type[Effect]]:
    """All effects as {name: class}, in alphabetical order.

    Raises
    ------
    InputError
        For a plugin that cannot be imported; the message names the file.
    """
    modules = [
        importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__) if m.name != "base"
    ]
    folder = os.environ.get("LSM_PLUGINS")
    modules += [_plugin(path) for path in sorted(Path(folder, "effects").glob("*.py"))] if folder else []
    found = {}
    for module in modules:
        for _, cls in inspect.getmembers(module, inspect.isclass):
            # A class that a module only imports belongs to another file.
            if issubclass(cls, Effect) and cls is not Effect and cls.__module__ == module.__name__:
                found[effect_name(cls)] = cls
    return dict(sorted(found.items()))


def make_effects(tables: Iterable[Mapping[str, Any]]) -> list[Effect]:
    """Effects from plain data, as a TOML file gives them.

    Parameters
    ----------
    tables
        One mapping per effect: its `name`, and its parameters in SI units, such as
        {"name": "gravity", "acceleration": [0.0, -9.81]}.

    Raises
    ------
    InputError
        Names what is unknown or missing, what there is, and the nearest name.
    """
    effects, made = find_effects(), []
    for table in tables:
        if not isinstance(table, Mapping):
            raise InputError(
                f'effect {table!r}: must be a table such as {{"name": "gravity", "acceleration": [0, -9.81]}}'
            )
        values = dict(table)
        name = values.pop("name", None)
        if not isinstance(name, str) or name not in effects:
            raise InputError(f"effect {name!r}: unknown, must be one of {', '.join(effects)}{_nearest(name, effects)}")
        fields = {field.name: field for field in dataclasses.fields(effects[name])}
        for key in values:
            if key not in fields:
                raise InputError(f"{name}.{key}: unknown, must be one of {', '.join(fields)}{_nearest(key, fields)}")
        lacking = [n for n, f in fields.items() if f.default is dataclasses.MISSING and n not in values]
        if lacking:
            raise InputError(f"{name}: {', '.join(lacking)} must be given")
        made.append(effects[name](**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}))
    return made


def _plugin(path: Path) -> ModuleType:
    """The module in this file; InputError that names it if it cannot be imported."""
    spec = importlib.util.spec_from_file_location(f"lsm_plugin_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"plugin {path}: cannot be imported, must be a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"plugin {path}: cannot be imported: {error}") from error
    return module


def _nearest(name: object, names: Iterable[str]) -> str:
    close = difflib.get_close_matches(str(name), names, 1)
    return f". Did you mean {close[0]}?" if close else ""


__all__ = [
    "Bodies",
    "Effect",
    "HistoryValue",
    "contact_type",
    "effect_name",
    "find_effects",
    "finite",
    "make_effects",
    "require",
]
