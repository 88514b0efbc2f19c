"""Units of a laboratory's columns, and what they are in SI."""

from __future__ import annotations

from typing import Any

from taichi_lsm.core.errors import InputError, shown
from workflows.common.parameter_problems import nearest

UNITS: dict[str, dict[str, float]] = {  # kind -> unit -> its size in SI
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9},
    "stress": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5},
    "number": {"1": 1.0, "%": 1e-2},
}


def size_of(unit: Any, kind: str, key: str) -> float:
    """Size of a unit in SI.

    Parameters
    ----------
    unit
        What was given.
    kind
        "length", "stress" or "number".
    key
        Where it was given, for the message.

    Raises
    ------
    InputError
        If it is no unit of this kind.
    """
    known = UNITS[kind]
    if not isinstance(unit, str) or unit not in known:
        hint = nearest(unit, known) if isinstance(unit, str) else ""
        raise InputError(f"{key} = {shown(unit)}: must be a unit of a {kind}, one of {', '.join(known)}.{hint}")
    return known[unit]
