"""Checks of what the analysis functions are given: an InputError names the argument and what is allowed."""

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, finite, shown


def require_positive(**values: object) -> None:
    """InputError unless every value is one finite number above 0."""
    for name, value in values.items():
        if not (finite(value) and value > 0):  # pyright: ignore[reportOperatorIssue]
            raise InputError(f"{name}: {shown(value)}, must be a finite number > 0")


def series(name: str, values: npt.ArrayLike, least: int, size: int | None = None) -> npt.NDArray[np.float64]:
    """Values as (n,) finite floats with n >= least, or n = size where one is given; InputError otherwise."""
    array = numbers(name, values, 1)
    if size is not None and array.size != size:
        raise InputError(f"{name}: {array.size} values, must be as many as the others, {size}")
    if array.size < least:
        raise InputError(f"{name}: {array.size} values, at least {least} are needed")
    return array


def numbers(name: str, values: npt.ArrayLike, dimensions: int) -> npt.NDArray[np.float64]:
    """Values as finite floats of so many dimensions; InputError otherwise."""
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: {shown(values)}, must be numbers") from None
    if array.ndim != dimensions:
        raise InputError(f"{name}: shape {array.shape}, must have {dimensions} dimension{'s' * (dimensions > 1)}")
    if not np.isfinite(array).all():
        raise InputError(f"{name}: {np.sum(~np.isfinite(array))} of {array.size} values are not finite")
    return array


def rising(name: str, values: npt.NDArray[np.float64]) -> None:
    """InputError unless the values increase strictly."""
    if not np.all(np.diff(values) > 0):
        at = int(np.argmin(np.diff(values) > 0)) + 1
        raise InputError(f"{name}: value {at} is {values[at]:g} after {values[at - 1]:g}, must rise from row to row")
