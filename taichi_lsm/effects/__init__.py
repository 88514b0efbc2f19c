"""What acts on the grains: contact laws, body forces, damping and bonds, one per file.

`find_effects` discovers them here and in `$LSM_PLUGINS/effects`. The class in `linear_elastic.py` is the name
`LinearElastic` of this package, and so for every file. Names are imported when they are first used: reading the list of
effects does not load Taichi.
"""

from __future__ import annotations

import dataclasses
import difflib
import importlib
import importlib.util
import inspect
import os
import pkgutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError, reason, shown

if TYPE_CHECKING:  # what `__getattr__` finds, for type checkers and editors; a name left out works all the same
    from .base import Bodies as Bodies
    from .base import Effect as Effect
    from .base import HistoryValue as HistoryValue
    from .base import contact_type as contact_type
    from .base import effect_name as effect_name
    from .base import finite as finite
    from .base import require as require
    from .cohesion import Cohesion as Cohesion
    from .coulomb_friction import CoulombFriction as CoulombFriction
    from .elastic_brittle_bond import ElasticBrittleBond as ElasticBrittleBond
    from .global_damping import GlobalDamping as GlobalDamping
    from .gravity import Gravity as Gravity
    from .hertz import Hertz as Hertz
    from .linear_elastic import LinearElastic as LinearElastic
    from .mindlin import Mindlin as Mindlin
    from .rate_and_state_friction import RateAndStateFriction as RateAndStateFriction
    from .rolling_damping import RollingDamping as RollingDamping
    from .rolling_resistance import RollingResistance as RollingResistance
    from .velocity_weakening_friction import VelocityWeakeningFriction as VelocityWeakeningFriction
    from .viscous_damping import ViscousDamping as ViscousDamping

FORMER_KEY = "law"  # of a table, in place of "name"
MOST_PROBLEMS = 6  # that are told
OTHER_KEYS = ("type", "effect", "kind")  # likewise, by mistake
MOST_EFFECTS = 100  # of a scene: each is compiled
_BASE = ("Bodies", "Effect", "HistoryValue", "contact_type", "effect_name", "finite", "require")
_SHARED = ("base", "implicit_slip", "restitution", "tangential_spring")  # modules that define no effect
_HOME = dict.fromkeys(_BASE, "base") | {
    "".join(word.capitalize() for word in module.name.split("_")): module.name
    for module in pkgutil.iter_modules(__path__)
    if module.name not in _SHARED
}
__all__ = sorted([*_HOME, "find_effects", "make_effects"])


if not TYPE_CHECKING:  # else type checkers would take any name for granted

    def __getattr__(name):
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__():
    return __all__


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
    from .base import Effect, effect_name  # loads Taichi

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
    effects = find_effects()
    tables = list(tables)
    if len(tables) > MOST_EFFECTS:
        raise InputError(f"effects: {len(tables)} tables, must be at most {MOST_EFFECTS}")
    made, problems = [], []
    for table in tables:
        wrong = list(_problems_of(table, effects))
        try:
            if not wrong:
                values = {key: value for key, value in table.items() if key != "name"}
                made.append(_made(effects[table["name"]], table["name"], values))
        except InputError as error:
            wrong.append(str(error))
        problems += wrong
    if problems:
        more = [f"and {len(problems) - MOST_PROBLEMS} mistakes more"] if len(problems) > MOST_PROBLEMS else []
        raise InputError("; ".join([*problems[:MOST_PROBLEMS], *more]))
    return made


def _problems_of(table: Any, effects: Mapping[str, type[Effect]]) -> Iterator[str]:
    """What is wrong with the keys of a table."""
    if not isinstance(table, Mapping):
        yield f'effect {shown(table)}: must be a table such as {{"name": "gravity", "acceleration": [0, -9.81]}}'
    elif "name" not in table:
        instead = [f", written as {key}," for key in OTHER_KEYS if key in table]
        former = [f", formerly called {FORMER_KEY},"] if FORMER_KEY in table else instead[:1]
        yield f"effect {shown(dict(table))}: name{''.join(former)} is missing, must be one of {', '.join(effects)}"
    elif not isinstance(table["name"], str) or table["name"] not in effects:
        name = table["name"]
        yield f"effect {shown(name)}: unknown, must be one of {', '.join(effects)}{_nearest(name, effects)}"
    else:
        name = table["name"]
        fields = {field.name: field for field in dataclasses.fields(effects[name])}  # pyright: ignore[reportArgumentType]  effects are dataclasses
        given = [key for key in table if key != "name"]
        for key in given:
            if key not in fields:
                yield f"{name}.{shown(key)[1:-1]}: unknown, must be one of {', '.join(fields)}{_nearest(key, fields)}"
        lacking = [n for n, f in fields.items() if f.default is dataclasses.MISSING and n not in given]
        if lacking:
            yield f"{name}: {', '.join(lacking)} must be given"


def _made(cls: type[Effect], name: str, values: Mapping[str, Any]) -> Effect:
    """The effect of the table `name` with these values; what is refused is called as the table calls it."""
    numbers = {field.name for field in dataclasses.fields(cls) if field.type not in (str, "str")}  # pyright: ignore[reportArgumentType]  effects are dataclasses
    for key in numbers & values.keys():
        if isinstance(values[key], str):
            unit = cls.units.get(key, "1")
            what = "a number" if unit == "1" else f"a number in {unit}"
            raise InputError(f"{name}.{key} = {shown(values[key])}: must be {what}, not a text")
    try:
        return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
    except InputError as error:
        raise InputError(str(error).replace(f"{cls.__name__}.", f"{name}.")) from error


def _plugin(path: Path) -> ModuleType:
    """The module in this file; InputError that names it if it cannot be imported."""
    spec = importlib.util.spec_from_file_location(f"lsm_plugin_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"plugin {path}: cannot be imported, must be a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise InputError(f"plugin {path}: cannot be imported: {reason(error)}") from error
    return module


def _nearest(name: object, names: Iterable[str]) -> str:
    close = difflib.get_close_matches(str(name), names, 1)
    return f". Did you mean {close[0]}?" if close else ""
