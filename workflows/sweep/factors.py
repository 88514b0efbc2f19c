"""How parameters vary over the runs of a sweep: grids, columns that go together, and samples of ranges."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_lsm.core.errors import InputError, finite, shown
from workflows.sweep.saltelli import saltelli_sample

MOST_RUNS = 100_000  # of a sweep
SPACINGS = ("linear", "log")
METHODS = ("latin-hypercube", "sobol")
SALTELLI = "saltelli"  # blocks of points from which `lsm sensitivity` finds the indices of Sobol
SAMPLE_KEYS = ("method", "count", "seed", "ranges")

Point = dict[str, Any]  # {name of a parameter: its value in one run}


@dataclass(frozen=True)
class Range:
    """Values of a parameter from `low` to `high`, spaced evenly, or their logarithms."""

    low: float
    high: float
    log: bool = False

    def at(self, share: float) -> float:
        """Value at a share of the way from `low` (0) to `high` (1), of the logarithms if `log`."""
        if self.log:
            return math.exp((1.0 - share) * math.log(self.low) + share * math.log(self.high))
        return (1.0 - share) * self.low + share * self.high


@dataclass(frozen=True)
class Factor:
    """What varies together, and is combined with all other factors.

    Attributes
    ----------
    dim
        Its name: that of its parameter, "together" or "sample".
    points
        Its values.
    log
        Names of those of its parameters whose logarithms are spaced evenly, or were drawn.
    """

    dim: str
    points: list[Point]
    log: tuple[str, ...] = ()


def points_of(table: Mapping[str, Any], whole: frozenset[str] = frozenset()) -> list[Point]:
    """All points of a sweep: `combined` of its `factors_of`."""
    return combined(factors_of(table, whole))


def combined(factors: Sequence[Factor]) -> list[Point]:
    """Every combination of the points of all factors, of which the last varies fastest; one empty point of none."""
    return [
        {k: v for part in parts for k, v in part.items()} for parts in itertools.product(*(f.points for f in factors))
    ]


def factors_of(table: Mapping[str, Any], whole: frozenset[str] = frozenset()) -> list[Factor]:
    """What varies in a sweep.

    Parameters
    ----------
    table
        The table `[sweep]` of a file: `grid`, of which every combination is taken; `together`, whose lists have one
        length and are gone through side by side; `sample`, points of ranges by a Latin hypercube (McKay et al. 1979)
        or a scrambled Sobol sequence (Sobol 1967, Owen 1998). Those that are given are combined with each other.
    whole
        Names of parameters that are whole numbers: values of ranges are rounded.

    Raises
    ------
    InputError
        With the key, its value, what is allowed and what to do.
    """
    factors = _grid(_table(table, "grid"), whole)
    factors += [Factor("together", _together(_table(table, "together")))]
    factors += [_sample(_table(table, "sample"), whole)]
    factors = [factor for factor in factors if factor.points]
    number = math.prod(len(factor.points) for factor in factors)
    if number > MOST_RUNS:
        raise InputError(f"sweep: {number} points, must be at most {MOST_RUNS}; vary fewer parameters or values")
    names = [name for factor in factors for name in factor.points[0]]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"sweep: {', '.join(twice)}: varied in more than one place, must be in one of them")
    return factors


def _table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = table.get(key, {})
    if not isinstance(found, Mapping):
        raise InputError(f"sweep.{key} = {shown(found)}: must be a table, [sweep.{key}]")
    return found


def _grid(grid: Mapping[str, Any], whole: frozenset[str]) -> list[Factor]:
    """One factor for each parameter of the grid."""
    columns = {name: _values(f"sweep.grid.{name}", given, name in whole) for name, given in grid.items()}
    log = {name: (name,) if _in_log(given) else () for name, given in grid.items()}
    return [Factor(name, [{name: value} for value in values], log[name]) for name, values in columns.items()]


def _values(key: str, given: Any, whole: bool) -> list[Any]:
    """The values of one parameter: a list as it is, or a range with a count."""
    if isinstance(given, Mapping):
        count = given.get("count")
        span = range_of(key, given, ("count",))
        if not (isinstance(count, int) and _is_count(count, 2)):
            raise InputError(f"{key}.count = {shown(count)}: must be a whole number from 2 to {MOST_RUNS}")
        return _distinct(key, [_number(span.at(i / (count - 1)), whole) for i in range(count)])
    return _distinct(key, _list(key, given))


def _list(key: str, given: Any) -> list[Any]:
    if not isinstance(given, list) or not given:
        raise InputError(f"{key} = {shown(given)}: must be a list of values, or {{from = ..., to = ..., count = ...}}")
    return given


def _distinct(key: str, values: list[Any]) -> list[Any]:
    twice = [value for i, value in enumerate(values) if value in values[:i]]
    if twice:
        raise InputError(f"{key}: {shown(twice[0])} is there twice, values must differ; replicas = N repeats runs")
    return values


def _together(columns: Mapping[str, Any]) -> list[Point]:
    """One factor whose points are the rows of the columns."""
    if not columns:
        return []
    lists = {name: _list(f"sweep.together.{name}", values) for name, values in columns.items()}
    lengths = {name: len(values) for name, values in lists.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(f"sweep.together: lists of different lengths ({told}), must be of one length")
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]


def _sample(sample: Mapping[str, Any], whole: frozenset[str]) -> Factor:
    """One factor whose points are drawn from ranges; none if nothing is drawn."""
    if not sample:
        return Factor("sample", [])
    unknown = sorted(set(sample) - set(SAMPLE_KEYS))
    if unknown:
        raise InputError(f"sweep.sample.{unknown[0]}: unknown, must be one of {', '.join(SAMPLE_KEYS)}")
    ranges = sample.get("ranges")
    if not isinstance(ranges, Mapping) or not ranges:
        raise InputError("sweep.sample.ranges: must be given, a table of {from = ..., to = ...} by parameter")
    spans = {name: range_of(f"sweep.sample.ranges.{name}", given) for name, given in ranges.items()}
    count, seed, method = sample.get("count"), sample.get("seed", 1), sample.get("method", METHODS[0])
    if not (isinstance(count, int) and _is_count(count, 1)):
        raise InputError(f"sweep.sample.count = {shown(count)}: must be a whole number from 1 to {MOST_RUNS}")
    if not (isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed < 2**31):
        raise InputError(f"sweep.sample.seed = {shown(seed)}: must be a whole number from 0 to {2**31 - 1}")
    shares = unit_sample(method, count, len(spans), seed)
    points = [
        {name: _number(span.at(share), name in whole) for (name, span), share in zip(spans.items(), row, strict=True)}
        for row in shares.tolist()
    ]
    return Factor("sample", points, tuple(name for name, span in spans.items() if span.log))


def unit_sample(method: str, count: int, dimension: int, seed: int) -> np.ndarray:
    """Points (count, dimension) in the unit cube, by a method of METHODS; InputError for another one.

    By SALTELLI `count` blocks of points, see `workflows.sweep.saltelli`.
    """
    from scipy.stats import qmc

    if method == "latin-hypercube":
        return qmc.LatinHypercube(dimension, rng=np.random.default_rng(seed)).random(count)
    if method in ("sobol", SALTELLI):
        if count & (count - 1):
            near = 2 ** max(0, round(math.log2(count)))
            raise InputError(
                f"sweep.sample.count = {count}: must be a power of two, such as {near}, for a balanced sequence"
            )
        if method == SALTELLI:
            return saltelli_sample(count, dimension, seed)
        return qmc.Sobol(dimension, rng=np.random.default_rng(seed)).random_base2(count.bit_length() - 1)
    raise InputError(f"sweep.sample.method = {shown(method)}: must be one of {', '.join((*METHODS, SALTELLI))}")


def range_of(key: str, given: Any, more: Sequence[str] = ()) -> Range:
    """The range {from, to, spacing} of a file, which may have the keys `more` as well; InputError if it is none."""
    if not isinstance(given, Mapping):
        raise InputError(f"{key} = {shown(given)}: must be {{from = ..., to = ...}}")
    allowed = ("from", "to", "spacing", *more)
    unknown = sorted(set(given) - set(allowed))
    if unknown:
        raise InputError(f"{key}.{unknown[0]}: unknown, must be one of {', '.join(allowed)}")
    for name in ("from", "to"):
        if not finite(given.get(name)):
            raise InputError(f"{key}.{name} = {shown(given.get(name))}: must be a number")
    low, high, spacing = float(given["from"]), float(given["to"]), given.get("spacing", "linear")
    if spacing not in SPACINGS:
        raise InputError(f"{key}.spacing = {shown(spacing)}: must be one of {', '.join(SPACINGS)}")
    if not low < high:
        raise InputError(f"{key}.to = {high:g}: must be > from = {low:g}")
    if spacing == "log" and low <= 0.0:
        raise InputError(f'{key}.from = {low:g}: must be > 0 with spacing = "log"')
    return Range(low, high, spacing == "log")


def _number(value: float, whole: bool) -> float | int:
    return round(value) if whole else float(f"{value:.12g}")


def _in_log(given: Any) -> bool:
    """Whether a range of a file is spaced by a factor."""
    return isinstance(given, Mapping) and given.get("spacing") == "log"


def _is_count(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= MOST_RUNS
