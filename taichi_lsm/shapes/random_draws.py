"""Random grains that touch an ellipse or ellipsoid all round: what may be asked for, and draws until one closes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.random import Generator

from ..core.errors import InputError
from .base import GrainShape
from .dilated_balls import SLACK
from .input_checks import check_at_least, check_between, check_corner_radius, check_flatness, random_generator

TRIES = 20  # draws of one grain

Shape = TypeVar("Shape", bound=GrainShape)


def check_request(
    count: int, elongation: float, angularity: float, corner_radius: float, flatness: float, flattest: float = np.inf
) -> None:
    """Refuse numbers out of the ranges that `random_polygons` and `random_polyhedra` state."""
    check_at_least("count", count, 0)
    check_between("elongation", elongation, 1, 4)
    check_between("angularity", angularity, 0, 1)
    check_corner_radius(corner_radius)
    check_flatness(flatness, flattest)


def slack_of(angularity: float) -> float:
    """Radius of a side or face over the least that leaves the others their place; it grows as 1/(1 - angularity)."""
    return SLACK / max(1.0 - angularity, 1e-6)


def closed_grains(
    draw: Callable[[Generator, str], Shape], count: int, seed: int, name: str, request: str
) -> list[Shape]:
    """`count` grains named "name seed-k", each the first of TRIES draws from a generator of its own that closes.

    draw: makes a grain of this name or raises ValueError for one that does not close; request: the parameters that
    the message of the InputError quotes if none does.
    """
    shapes = []
    for k in range(count):
        rng, error = random_generator([seed, k]), None
        for _ in range(TRIES):
            try:
                shapes.append(draw(rng, f"{name} {seed}-{k}"))
                break
            except ValueError as failure:  # slivers, on which any step of the fit may fail: another draw
                error = failure
        else:
            raise InputError(
                f"{request}: no grain in {TRIES} draws ({error}); ask for a smaller corner radius, elongation or "
                "angularity"
            )
    return shapes
