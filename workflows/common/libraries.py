"""Libraries of the extras, loaded when they are used."""

from __future__ import annotations

import importlib
from types import ModuleType

from taichi_lsm.core.errors import InputError


def library(name: str, command: str, extra: str = "calibration") -> ModuleType:
    """A module of a library of an extra; InputError that names the extra if it is not installed.

    Parameters
    ----------
    name
        Of the module, such as "sklearn.gaussian_process".
    command
        What needs it, for the message.
    extra
        What pip calls the libraries that are installed together.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise InputError(
            f"{command}: needs {name.split('.')[0]}, which is not installed; pip install 'taichi-lsm[{extra}]'"
        ) from None
