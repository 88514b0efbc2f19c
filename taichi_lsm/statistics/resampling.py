"""Values with intervals by resampling whole cycles of an experiment: Efron (1979), doi:10.1214/aos/1176344552."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .steady_means import LEVEL

LEAST_CYCLES = 8  # fewer do not show how much they scatter (tests/statistics/test_velocity_step_coverage.py)


class Resampled(NamedTuple):
    """A value with its 95 % interval, which need not be symmetric; in the unit of the value.

    Parameters
    ----------
    value
        The value.
    standard_error
        Standard deviation over the resampled cycles; nan if it is unknown.
    low, high
        Ends of the 95 % interval; nan if unknown.
    unknown
        Why the error is unknown, and what to do; "" if it is known.
    """

    value: float
    standard_error: float = math.nan
    low: float = math.nan
    high: float = math.nan
    unknown: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """(least, greatest) of the 95 % interval."""
        return self.low, self.high

    def __repr__(self) -> str:
        """The value, its error and the interval: "0.0151 +- 0.0012, 95 % interval 0.0127 to 0.0175"."""
        if self.unknown:
            return f"{self.value:.4g} +- unknown ({self.unknown})"
        return f"{self.value:.4g} +- {self.standard_error:.2g}, 95 % interval {self.low:.4g} to {self.high:.4g}"


def resampled_weights(cycles: int, resamples: int, seed: int) -> npt.NDArray[np.float64]:
    """(resamples, cycles) share of each cycle in means over as many cycles, drawn with replacement."""
    drawn = np.random.default_rng(seed).multinomial(cycles, np.full(cycles, 1.0 / cycles), size=resamples)
    return drawn / cycles


def interval(value: float, drawn: npt.NDArray[np.float64], cycles: int, positive: bool = False) -> Resampled:
    """The value with an interval of Student's t on the scatter of its resampled values.

    Parameters
    ----------
    value
        Of all cycles.
    drawn
        (resamples,) of resampled cycles.
    cycles
        n: the scatter is widened by sqrt(n/(n - 1)), t has n - 1 degrees of freedom.
    positive
        The interval is symmetric in the logarithm, for lengths that may be uncertain by a large factor.

    Returns
    -------
    Resampled
        In place of quantiles of the resampled values, which are too narrow: they know neither of the two factors
        (docs/statistics.md).
    """
    from scipy.special import stdtrit

    wide = math.sqrt(cycles / (cycles - 1.0)) * float(stdtrit(cycles - 1.0, 0.5 + LEVEL / 2))
    error = float(np.std(drawn)) * math.sqrt(cycles / (cycles - 1.0))
    if positive:
        spread = math.exp(wide * float(np.std(np.log(drawn))))
        return Resampled(value, error, value / spread, value * spread)
    return Resampled(value, error, value - wide * float(np.std(drawn)), value + wide * float(np.std(drawn)))
