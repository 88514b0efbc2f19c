"""The libraries of calibrations and sensitivities: an extra, loaded when they are used."""

from __future__ import annotations

import importlib
from types import ModuleType

from taichi_lsm.core.errors import InputError

EXTRA = "pip install 'taichi-lsm[calibration]'"


def library(name: str, command: str) -> ModuleType:
    """A module of a library of the extra; InputError that names the extra if it is not installed.

    Parameters
    ----------
    name
        Of the module, such as "sklearn.gaussian_process".
    command
        What needs it, for the message.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise InputError(f"{command}: needs {name.split('.')[0]}, which is not installed; {EXTRA}") from None
