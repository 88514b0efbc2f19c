"""Which snapshots of a run are wanted: `--times` and `--every`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_lsm.core.errors import InputError, shown

ROUNDING = 1e-6  # of the last time: by which an end of a range, as it is printed, may be off
ALLOWED = "must be first, last, all, times such as 0.1,0.2, or a range such as 0.1:0.2, in s"


def chosen(times: NDArray, wanted: str, every: int = 1) -> NDArray:
    """Places of the snapshots that are wanted.

    Parameters
    ----------
    times : ndarray, (snapshots,)
        Their times [s], ascending.
    wanted : str
        "first", "last" or "all"; times [s] with commas between them, of which the nearest snapshots are taken; or two
        times with a colon between them, both included, either of which may be left out.
    every : int
        Of these each `every`-th, from the first on.

    Returns
    -------
    ndarray of int
        Counted from 0, ascending, none twice.

    Raises
    ------
    InputError
        If the words mean nothing, a time is not one of the run, or no snapshot lies in a range.
    """
    if every < 1:
        raise InputError(f"--every {every}: must be >= 1")
    words = wanted.strip()
    if words in ("first", "last", "all"):
        ends = {"first": slice(0, 1), "last": slice(-1, None), "all": slice(None)}
        return np.arange(len(times))[ends[words]][::every]
    if ":" in words:
        low, high = _range(wanted)
        slack = ROUNDING * np.abs(times).max()
        found = np.flatnonzero((times >= low - slack) & (times <= high + slack))
        if not found.size:
            raise InputError(f"--times {wanted}: no snapshot lies there; {_held(times)}")
        return found[::every]
    numbers = np.array([_number(word, wanted) for word in words.split(",")])
    slack = ROUNDING * np.abs(times).max()
    outside = numbers[(numbers < times[0] - slack) | (numbers > times[-1] + slack)]
    if outside.size:
        raise InputError(f"--times {wanted}: {outside[0]:g} s is not within the run; {_held(times)}")
    return np.unique(np.abs(times - numbers[:, None]).argmin(axis=1))[::every]


def _held(times: NDArray) -> str:
    return f"it has {len(times)} snapshots from {times[0]:g} to {times[-1]:g} s"


def _range(wanted: str) -> tuple[float, float]:
    """Both ends of a range of times [s]."""
    ends = wanted.split(":")
    if len(ends) != 2:
        raise InputError(f"--times {shown(wanted)}: {ALLOWED}")
    low, high = (_number(end, wanted) if end.strip() else None for end in ends)
    return -np.inf if low is None else low, np.inf if high is None else high


def _number(word: str, wanted: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"--times {shown(wanted)}: {ALLOWED}")
    return value
