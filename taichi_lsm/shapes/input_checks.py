"""Checks of what a caller passes to the makers of shapes: each raises InputError naming the argument."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import BitGenerator, Generator, SeedSequence
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError

FLATTEST_FACES = 1e4  # radius of a face over the size of the body; at 3e4 some bodies are a per cent off

Seed = int | Sequence[int] | SeedSequence | BitGenerator | Generator


def number_array(field: str, value: ArrayLike) -> NDArray[np.float64]:
    """Copy of `value` as float64; InputError if it is no array of numbers."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{field} = {value!r}: must be an array of numbers ({error})") from None


def random_generator(seed: Seed) -> Generator:
    """`numpy.random.default_rng` for a seed; InputError if it takes no such seed."""
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError) as error:
        raise InputError(f"seed = {seed!r}: must be an integer >= 0 or several of them ({error})") from None


def check_at_least(field: str, value: float, least: float, reason: str = "") -> None:
    """Refuse a number below `least`, or none at all."""
    if not value >= least:
        raise InputError(f"{field} = {value}: must be at least {least:g}{reason}")


def check_between(field: str, value: float, least: float, most: float) -> None:
    """Refuse a number outside of least <= value <= most."""
    if not least <= value <= most:
        raise InputError(f"{field} = {value}: must be from {least:g} to {most:g}")


def check_positive(field: str, value: float) -> None:
    """Refuse a number that is infinite or not above 0."""
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{field} = {value}: must be finite and > 0")


def check_flatness(flatness: float | None, most: float = FLATTEST_FACES) -> None:
    """Refuse faces so flat that the balls of a polyhedron are no longer found to rounding; None is a choice of ours."""
    if flatness is not None and not (np.isfinite(flatness) and 0 < flatness <= most):
        above = f", at most {most:g}" if np.isfinite(most) else ""
        raise InputError(f"flatness = {flatness}: must be finite and > 0{above}")


def check_corner_radius(corner_radius: float, most: float = 0.5) -> None:
    """Refuse a corner radius [equivalent diameters] that no grain can have; at 0.5 it is a disc or a sphere."""
    if not 0 < corner_radius < most:
        raise InputError(f"corner_radius = {corner_radius}: must be above 0 and below {most:g} equivalent diameters")


def check_fewest_and_most(field: str, value: tuple[int, int], least: int) -> None:
    """Refuse a range of numbers of sides or faces that is empty or begins below `least`."""
    if len(value) != 2 or not least <= value[0] <= value[1]:
        raise InputError(f"{field} = {value}: must be (fewest, most) with {least} <= fewest <= most")


def check_cells(
    count: int, corner_radius: float, field: str, sides: tuple[int, int], fewest: int, max_aspect: float
) -> None:
    """Refuse what no cells of a tiling can meet; `field` names their `sides`, or faces, of which they have `fewest`."""
    check_at_least("count", count, 0)
    check_corner_radius(corner_radius)
    check_fewest_and_most(field, sides, fewest)
    if not max_aspect > 1:
        raise InputError(f"max_aspect = {max_aspect}: must be above 1")
