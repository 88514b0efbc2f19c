"""What is known of parameters before a calibration: ranges, or normal distributions within what is allowed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_lsm.core.errors import InputError, finite, shown
from workflows.common.parameter_problems import as_written, nearest
from workflows.common.parameter_types import accepts, allowed
from workflows.common.parameters import Params
from workflows.sweep.factors import Point, range_of

MOST_PARAMETERS = 6  # of a calibration: more are not resolved by the points of a posterior
NORMAL_KEYS = ("mean", "deviation")


@dataclass(frozen=True)
class Prior:
    """What is known of one parameter.

    Attributes
    ----------
    name
        Of the parameter.
    low, high
        Ends of what it can be; of a normal distribution what the parameter allows, which may be infinite.
    log
        Whether its logarithm is distributed evenly between the ends, in place of itself.
    mean, deviation
        Of a normal distribution, which is cut off at the ends; None for an even one.
    """

    name: str
    low: float
    high: float
    log: bool = False
    mean: float | None = None
    deviation: float | None = None

    def at(self, share: NDArray) -> NDArray:
        """Values below which this share of the distribution lies: its quantiles; any shape."""
        share = np.asarray(share, dtype=float)
        if self.mean is not None and self.deviation is not None:
            from scipy.stats import truncnorm

            ends = ((self.low - self.mean) / self.deviation, (self.high - self.mean) / self.deviation)
            return np.asarray(truncnorm.ppf(share, *ends, loc=self.mean, scale=self.deviation))
        ends = np.log([self.low, self.high]) if self.log else np.array([self.low, self.high])
        value = (1.0 - share) * ends[0] + share * ends[1]
        return np.clip(np.exp(value) if self.log else value, self.low, self.high)  # rounding may leave the ends

    def share(self, value: NDArray) -> NDArray:
        """The share of the distribution that lies below values: the inverse of `at`; any shape."""
        value = np.asarray(value, dtype=float)
        if self.mean is not None and self.deviation is not None:
            from scipy.stats import truncnorm

            ends = ((self.low - self.mean) / self.deviation, (self.high - self.mean) / self.deviation)
            return np.asarray(truncnorm.cdf(value, *ends, loc=self.mean, scale=self.deviation))
        if self.log:
            return np.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def __str__(self) -> str:
        """As "0.1 to 0.9", with what is not even."""
        if self.mean is not None:
            return f"normal {self.mean:g} +- {self.deviation:g}"
        return f"{self.low:g} to {self.high:g}{', logarithms even' if self.log else ''}"


def priors_of(table: Any, params_class: type[Params]) -> tuple[Prior, ...]:
    """Read the table `[calibrate.priors]`.

    Parameters
    ----------
    table
        {parameter: {from, to}, {from, to, spacing = "log"} or {mean, deviation}}.
    params_class
        Of the experiment: its fields say what is allowed.

    Raises
    ------
    InputError
        With the key, its value, what is allowed and what to do.
    """
    if not isinstance(table, Mapping) or not table:
        raise InputError("calibrate.priors: must be given, a table of {from = ..., to = ...} by parameter")
    if len(table) > MOST_PARAMETERS:
        raise InputError(f"calibrate.priors: {len(table)} parameters, must be at most {MOST_PARAMETERS}; fix others")
    return tuple(_prior(str(name), given, params_class) for name, given in table.items())


def _prior(name: str, given: Any, params_class: type[Params]) -> Prior:
    key, fields = f"calibrate.priors.{as_written(name)}", params_class.model_fields
    if name not in fields:
        raise InputError(f"{key}: unknown parameter.{nearest(name, fields)}")
    if not accepts(fields[name].annotation, float):
        raise InputError(f"{key}: takes {allowed(fields[name])}, must be a parameter that any number in a range can be")
    low, high = bounds_of(fields[name].metadata)
    if isinstance(given, Mapping) and set(given) & set(NORMAL_KEYS):
        prior = _normal(key, given, name, low, high)
    else:
        span = range_of(key, given)
        prior = Prior(name, span.low, span.high, span.log)
        for end, value in (("from", span.low), ("to", span.high)):
            if not low <= value <= high:
                raise InputError(f"{key}.{end} = {value:g}: must be {allowed(fields[name])}")
    return prior


def _normal(key: str, given: Mapping[str, Any], name: str, low: float, high: float) -> Prior:
    if unknown := sorted(set(given) - set(NORMAL_KEYS)):
        raise InputError(f"{key}.{as_written(unknown[0])}: unknown beside {' and '.join(NORMAL_KEYS)}, leave it out")
    for word in NORMAL_KEYS:
        if not finite(given.get(word)):
            raise InputError(f"{key}.{word} = {shown(given.get(word))}: must be a number")
    mean, deviation = float(given["mean"]), float(given["deviation"])
    if deviation <= 0.0:
        raise InputError(f"{key}.deviation = {deviation:g}: must be > 0")
    if not low <= mean <= high:
        raise InputError(f"{key}.mean = {mean:g}: must be from {low:g} to {high:g}, which the parameter allows")
    return Prior(name, low, high, mean=mean, deviation=deviation)


def bounds_of(metadata: Sequence[Any]) -> tuple[float, float]:
    """(least, greatest) value that the bounds of a field allow; infinite where it has none."""
    low, high = -math.inf, math.inf
    for rule in metadata:
        for word in ("ge", "gt"):
            low = max(low, float(getattr(rule, word)) if _has(rule, word) else low)
        for word in ("le", "lt"):
            high = min(high, float(getattr(rule, word)) if _has(rule, word) else high)
    return low, high


def _has(rule: Any, word: str) -> bool:
    return getattr(rule, word, None) is not None


def points_at(priors: Sequence[Prior], shares: NDArray) -> list[Point]:
    """Values of all parameters at rows (n, d) of the unit cube, to 12 digits as files have them."""
    columns = [prior.at(shares[:, i]) for i, prior in enumerate(priors)]
    return [
        {prior.name: float(f"{value:.12g}") for prior, value in zip(priors, row, strict=True)}
        for row in zip(*columns, strict=True)
    ]


def shares_of(priors: Sequence[Prior], points: Sequence[Mapping[str, float]]) -> NDArray:
    """Rows (n, d) of the unit cube at which parameters have these values: the inverse of `points_at`."""
    found = [prior.share(np.array([point[prior.name] for point in points])) for prior in priors]
    return np.clip(np.stack(found, axis=-1), 0.0, 1.0) if points else np.empty((0, len(priors)))
