"""Curves of error against cost from the trials, their orders, and the cost of ten times less error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workflows.accuracy import Trial

LEAST_ORDER = 0.3  # in the value of the parameter: below it, the error hardly depends on the parameter
LEAST_GROWTH = 0.02  # of the cost, likewise: below it, the parameter is free


@dataclass(frozen=True)
class Curve:
    """One line of a work-precision diagram: root mean square errors, with standard errors, over relative costs."""

    parameter: str
    quantity: str
    value: np.ndarray
    setting: list
    error: np.ndarray
    error_se: np.ndarray
    relative: np.ndarray

    def order(self) -> float:
        """Order p of error ~ value^-p; nan for fewer than two points with an error."""
        known = np.isfinite(self.error) & (self.error > 0.0)
        if known.sum() < 2:
            return math.nan
        return float(-np.polyfit(np.log(self.value[known]), np.log(self.error[known]), 1)[0])

    def slope(self) -> float:
        """Exponent q of error ~ cost^-q: infinite where the error falls and the cost does not rise."""
        p, known = self.order(), np.isfinite(self.error) & (self.error > 0.0) & np.isfinite(self.relative)
        if known.sum() < 2 or math.isnan(p):
            return math.nan
        growth = float(np.polyfit(np.log(self.value[known]), np.log(self.relative[known]), 1)[0])
        return p / growth if p * growth > 0.0 and abs(growth) > LEAST_GROWTH else math.inf

    def tenfold(self) -> float:
        """Factor of time for ten times less error; infinite if more time does not help."""
        if abs(self.order()) < LEAST_ORDER:
            return math.inf
        return 10.0 ** (1.0 / self.slope())

    def resolved(self) -> bool:
        """Whether the error changes by more than two of its standard errors."""
        se = 2.0 * np.where(np.isfinite(self.error_se), self.error_se, 0.0)
        return bool(np.nanmax(self.error - se) > np.nanmin(self.error + se))

    def cost_at(self, error: float) -> float:
        """Relative cost at which the fitted line reaches the error; nan for fewer than two points with an error."""
        known = np.isfinite(self.error) & (self.error > 0.0) & np.isfinite(self.relative)
        if known.sum() < 2:
            return math.nan
        q, offset = np.polyfit(np.log(self.relative[known]), np.log(self.error[known]), 1)
        return float(np.exp((np.log(error) - offset) / q)) if q < 0.0 else math.inf


def curves(trials: Sequence[Trial]) -> dict[tuple[str, str], Curve]:
    """{(parameter, quantity): Curve} with the settings in rising value."""
    found = {}
    for key in dict.fromkeys((t.parameter, t.quantity) for t in trials):
        own = [t for t in trials if (t.parameter, t.quantity) == key]
        values = sorted({t.value for t in own})
        rows = []
        for value in values:
            errors = np.array([t.error for t in own if t.value == value])
            one = next(t for t in own if t.value == value)
            rms = float(np.sqrt(np.mean(errors**2)))
            scatter = float(np.std(errors, ddof=1) / np.sqrt(len(errors))) if len(errors) > 1 else math.nan
            rows.append((value, one.setting, rms, scatter, one.relative))
        value, setting, error, error_se, relative = zip(*rows)
        numbers = (np.array(column, float) for column in (error, error_se, relative))
        found[key] = Curve(*key, np.array(value, float), list(setting), *numbers)
    return found
