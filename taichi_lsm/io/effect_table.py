"""The effects that acted in a run as a table of its file: one row for each parameter of each effect."""

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from ..core.errors import InputError
from ..core.schema import Variable
from ..statistics.run_parts import part_of
from .netcdf_variables import put_text, put_variable

if TYPE_CHECKING:
    import netCDF4
    import xarray

    from ..effects.base import Effect

DIMENSION = "effect_parameter"
VALUE = Variable("parameter_value", (DIMENSION,), "f64", "1", "value of the parameter, nan if it is a text")
TEXTS = {
    "parameter_effect": "effect that has the parameter, as TOML and lsm list name it",
    "parameter_role": "what the effect does: its role, or its phase if it may stand beside others of its kind",
    "parameter_name": "name of the parameter; components of a vector are numbered from 0",
    "parameter_unit": "unit of the value, empty for a text",
    "parameter_text": "the parameter as text",
}


class EffectParameter(NamedTuple):
    """One parameter of an effect that acted; an effect without parameters has one row with an empty name."""

    effect: str
    role: str
    name: str
    unit: str
    text: str
    value: float


def effect_parameters(effects: Iterable["Effect"]) -> list[EffectParameter]:
    """Rows of the table of these effects, in their order; parameters that are None are left out."""
    return [row for effect in effects for row in _rows_of(effect)]


def _rows_of(effect: "Effect") -> Iterator[EffectParameter]:
    kind = (effect.name, effect.role or effect.phase)
    given = [(f.name, getattr(effect, f.name)) for f in dataclasses.fields(cast(Any, effect))]
    given = [(name, value) for name, value in given if value is not None]
    if not given:
        yield EffectParameter(*kind, "", "", "", np.nan)
    for name, value in given:
        unit = effect.units.get(name, "1")
        vector = isinstance(value, Sequence) and not isinstance(value, str)
        for one, component in [(f"{name}_{i}", v) for i, v in enumerate(value)] if vector else [(name, value)]:
            number = isinstance(component, int | float | np.number)
            text = f"{component:.12g}" if number else str(component)
            yield EffectParameter(*kind, one, unit if number else "", text, float(component) if number else np.nan)


def put_effects(dataset: "netCDF4.Dataset", effects: Sequence["Effect"]) -> None:
    """Write the table of these effects to an open file; nothing if there are none."""
    rows = effect_parameters(effects)
    if not rows:
        return
    dataset.createDimension(DIMENSION, len(rows))
    for name, long_name in TEXTS.items():
        column = [getattr(row, name.removeprefix("parameter_")) for row in rows]
        put_text(dataset, name, long_name, (DIMENSION,), np.array(column, dtype=object))
    put_variable(dataset, VALUE, np.array([row.value for row in rows]), coordinates=TEXTS)


def read_effects(dataset: "xarray.Dataset | xarray.DataTree") -> list[EffectParameter]:
    """Rows of the table of effects of one run, an open run.nc or the tree of a run; [] if no effect acted.

    Raises
    ------
    InputError
        If it is no dataset, such as a path, or several runs together.
    """
    if hasattr(dataset, "children"):
        dataset = part_of(dataset, "run")
    if not hasattr(dataset, "data_vars") or "run" in dataset.dims:
        raise InputError(
            f"read_effects: {type(dataset).__name__} of no single run, must be lsm.open_run(FOLDER/run.nc)"
        )
    if VALUE.name not in dataset.variables:
        return []
    names = [f"parameter_{name}" for name in EffectParameter._fields]
    wrong = [name for name in names if name not in dataset.variables or dataset[name].dims != (DIMENSION,)]
    if wrong or dataset[VALUE.name].dtype.kind != "f":
        raise InputError(f"read_effects: {', '.join(wrong) or VALUE.name} of the run, must be numbers and texts by row")
    return [EffectParameter(*row) for row in zip(*(np.asarray(dataset[name]).tolist() for name in names), strict=True)]
