"""What a sweep found: means of a metric over its seeds, and what to draw them against."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

import taichi_lsm as lsm
from workflows.common.one_run import COMPLETED
from workflows.common.parameter_coordinates import RENAMED
from workflows.common.parameter_problems import nearest

if TYPE_CHECKING:
    import xarray

SEED = "seed"  # what replicas differ by
MOST_FACETS = 12
EVEN = 0.05  # greatest share by which ratios of values that are spaced by a factor differ
SAMPLE = "sample"


class Estimated(NamedTuple):
    """The runs of one point: values of what they differ by from others, by name, and the mean over their seeds."""

    values: dict[str, Any]
    mean: lsm.statistics.Estimate
    runs: int


@dataclass(frozen=True)
class Choice:
    """What is drawn.

    Attributes
    ----------
    metric
        Variable of sweep.nc.
    against
        Parameters along the horizontal axis, one in each panel side by side.
    colour, facets
        Parameters that have a colour for each value, and a panel for each value or combination of values.
    log
        Parameters whose values are spaced by a factor.
    """

    metric: str
    against: tuple[str, ...]
    colour: str | None
    facets: tuple[str, ...]
    log: frozenset[str]


def factors_in(table: xarray.Dataset) -> list[dict[str, Any]]:
    """The factors of a sweep.nc: `dim`, `names`, `size`, and `log`, those of the names that were spaced by a factor.

    Raises
    ------
    InputError
        If the file has none, as one of something else.
    """
    try:
        found = json.loads(table.attrs["factors"])
        return [{"log": [], **f, "names": [str(name) for name in f["names"]], "size": int(f["size"])} for f in found]
    except (KeyError, TypeError, ValueError) as error:
        raise lsm.InputError(f"factors: are missing ({error}), must be of a sweep.nc that lsm sweep wrote") from None


def choose(
    table: xarray.Dataset,
    metric: str | None = None,
    against: str | None = None,
    colour: str | None = None,
    facet: str | None = None,
) -> Choice:
    """What to draw of a sweep.nc; what is None follows from its factors.

    By default: the first metric with a standard error; against the numbers with most values, or each drawn parameter; a
    colour for each value of the factor with most values of the others, and a panel for each of the rest.

    Raises
    ------
    InputError
        For a metric or a parameter that the file does not have; with what it has.
    """
    factors = factors_in(table)
    varied = [name for f in factors for name in f["names"] if name in table.coords]
    metric = _metric(table, metric)
    chosen = {what: _parameter(table, what, name) for what, name in (("--colour", colour), ("--facet", facet)) if name}
    if against is not None:
        axes = (_parameter(table, "--against", against),)
    else:
        axes = _default_axes(table, factors, set(chosen.values()))
    taken = {*axes, *chosen.values()}
    # A factor is spoken for by any of its names; drawn points differ in all of theirs, and get no panels.
    rest = [
        next(name for name in f["names"] if name in table.coords)
        for f in sorted(factors, key=lambda f: -f["size"])
        if f["dim"] not in (SEED, SAMPLE) and f["size"] > 1 and set(f["names"]) & set(varied) - {SEED}
        if not taken & set(f["names"])
    ]
    by_colour = chosen.get("--colour") or (rest.pop(0) if rest else None)
    facets = (chosen["--facet"],) if facet else tuple(rest)
    if len(axes) > 1 or (not facet and _count(table, facets) > MOST_FACETS):
        facets = ()
    log = {name for f in factors for name in f["log"]}
    log |= {name for name in (*axes, by_colour) if name and spaced_by_a_factor(table[name].values)}
    return Choice(metric, axes, by_colour, facets, frozenset(log))


def _metric(table: xarray.Dataset, metric: str | None) -> str:
    metrics = [str(name) for name in table.data_vars if table[name].dtype.kind == "f"]
    if metric is not None and metric not in metrics:
        hint = nearest(metric, metrics)
        raise lsm.InputError(f"--metric {metric}: unknown, must be one of {', '.join(metrics) or 'none'}.{hint}")
    known = [name for name in metrics if np.isfinite(table[name].values).any()]
    if not known:
        raise lsm.InputError("the sweep has no metric to draw: none of its runs is complete")
    return metric or next((name for name in known if error_of(table, name)), known[0])


def _parameter(table: xarray.Dataset, option: str, name: str) -> str:
    """The coordinate of a parameter, which may have another name in files."""
    found = RENAMED.get(name, name)
    if found not in table.coords:
        own = [str(given) for given in table.coords if str(given) != "label"]
        raise lsm.InputError(f"{option} {name}: unknown, must be one of {', '.join(own)}.{nearest(name, own)}")
    return found


def _default_axes(table: xarray.Dataset, factors: Iterable[dict[str, Any]], taken: set[str]) -> tuple[str, ...]:
    drawn = [name for f in factors if f["dim"] == SAMPLE for name in f["names"] if _is_number(table, name)]
    if drawn:
        return tuple(drawn)
    free = [f for f in factors if f["dim"] != SEED and not taken & set(f["names"])] or list(factors)
    ranked = sorted(free, key=lambda f: (not any(_is_number(table, n) for n in f["names"]), -f["size"]))
    names = [name for f in ranked for name in f["names"] if name in table.coords]
    numbers = [name for name in names if _is_number(table, name)]
    if not names:
        raise lsm.InputError("nothing varies in the sweep: there is nothing to draw against")
    return ((numbers or names)[0],)


def _is_number(table: xarray.Dataset, name: str) -> bool:
    return name in table.coords and table[name].dtype.kind in "if"


def _count(table: xarray.Dataset, names: Sequence[str]) -> int:
    """Number of combinations of the values of these parameters."""
    return math.prod(len(set(table[name].values.tolist())) for name in names)


def error_of(table: xarray.Dataset, metric: str) -> str | None:
    """The variable with the standard error of a metric within each run; None if there is none."""
    name = f"{metric.removesuffix('_mean')}_se"
    return name if name in table.data_vars and name != metric else None


def spaced_by_a_factor(values: Iterable[Any]) -> bool:
    """Whether numbers, at least three, follow each other by the same factor, and not by the same difference."""
    numbers = np.unique(np.asarray(list(values)))
    if numbers.dtype.kind not in "if" or len(numbers) < 3 or not np.isfinite(numbers).all() or numbers[0] <= 0:
        return False
    steps = np.diff(np.log(numbers))
    return bool(np.ptp(steps) <= EVEN * steps.mean() and np.ptp(np.diff(numbers)) > EVEN * np.diff(numbers).mean())


def estimates(table: xarray.Dataset, choice: Choice) -> list[Estimated]:
    """Means of the metric over the seeds of each point, by `lsm.statistics.combine_replicas`, in the order of the runs.

    Runs that are not complete, or do not know the metric, count as not there. Points differ in any parameter that
    varies, but for the seed, unless that is drawn itself.
    """
    drawn = {*choice.against, *choice.facets} | ({choice.colour} if choice.colour else set())
    varied = {name for f in factors_in(table) for name in f["names"] if name in table.coords}
    names = sorted(varied - {SEED} | drawn)
    error = error_of(table, choice.metric)
    samples = f"{choice.metric.removesuffix('_mean')}_ess"
    usable = (table.status.values == COMPLETED) & np.isfinite(table[choice.metric].values)
    columns = {name: table[name].values.tolist() for name in names}
    groups: dict[tuple, list[int]] = {}
    for i in np.flatnonzero(usable).tolist():
        groups.setdefault(tuple(columns[name][i] for name in names), []).append(i)
    found = []
    for key, rows in groups.items():
        within = table[error].values[rows] if error else np.full(len(rows), np.nan)
        counts = table[samples].values[rows] if error and samples in table.data_vars else None
        mean = lsm.statistics.combine_replicas(table[choice.metric].values[rows], within, counts)
        found.append(Estimated(dict(zip(names, key, strict=True)), mean, len(rows)))
    return found
