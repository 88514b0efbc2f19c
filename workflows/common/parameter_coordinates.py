"""The parameters of an experiment as scalar coordinates of its files, by which runs are told apart."""

import math
import re
import types
from dataclasses import replace
from typing import Any

import taichi_lsm as lsm
from workflows.common.parameter_types import accepts, kind
from workflows.common.parameters import Params

# Units of descriptions that are SI; other ones stay words.
UNITS = ("Pa", "Pa m-1", "N m-1", "kg m-3", "m", "m s-1", "s", "rad")
RENAMED = {  # parameters whose names are those of measured variables
    "friction": "particle_friction",
    "inertial_number": "target_inertial_number",
    "layer_thickness": "target_thickness_in_diameters",
    "cell_height": "target_height_in_diameters",
    "solid_fraction": "target_solid_fraction",
    "normal_stress": "target_normal_stress",
}


def parameter_coordinates(params: Params, without: tuple[str, ...] = ()) -> list[lsm.Scalar]:
    """A scalar for each parameter that an option can give and that acts on results, but for those `without`.

    Numbers are nan, and texts "none", where a parameter is none or has no effect; equal fields have equal types in all
    runs.
    """
    idle, values = params.idle(), params.resolved()
    scalars = []
    for name, field in type(params).model_fields.items():
        if name in without or name in params.without_result or kind(field.annotation) == "toml":
            continue
        unit, long_name = unit_and_name(type(params), name)
        value = _stored(field.annotation, None if name in idle else values[name])
        scalars.append(lsm.Scalar(RENAMED.get(name, name), value, long_name, unit))
    return scalars


def unit_and_name(params_class: type[Params], name: str) -> tuple[str, str]:
    """(unit, long name) of a parameter, from its description; the unit is "1" where that has words in its place."""
    long_name, unit = " ".join((params_class.model_fields[name].description or name).split()), "1"
    if found := re.search(r" \[([^\[\]]+)\]$", long_name):
        unit = found[1] if found[1] in UNITS else "1"
        long_name = long_name[: found.start()] if found[1] in (*UNITS, "1") else long_name
    return unit, long_name


def _stored(annotation: Any, value: Any) -> float | int | str:
    """A value as files hold it: seeds and other numbers as they are, flags and names as texts."""
    if accepts(annotation, bool):
        return "none" if value is None else "yes" if value else "no"
    if accepts(annotation, int) and not accepts(annotation, types.NoneType) and value is not None:
        return int(value)
    if accepts(annotation, int) or accepts(annotation, float):
        return math.nan if value is None else float(value)
    return "none" if value is None else ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def columns_of(scalars: list[lsm.Scalar]) -> tuple[list[lsm.Variable], dict[str, str]]:
    """Schema rows of the numbers, and long names of the texts, with which a table of runs holds these scalars."""
    numbers = [replace(s.variable, dims=("run",)) for s in scalars if s.variable is not None]
    return numbers, {s.name: s.long_name for s in scalars if s.variable is None}
