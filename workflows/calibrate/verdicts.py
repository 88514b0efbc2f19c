"""What a calibration says in words: targets out of reach, posteriors at the border of the prior or as wide as it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from workflows.calibrate.design import first_design
from workflows.calibrate.emulator import Emulators
from workflows.calibrate.posterior import Posterior, misfits_of, variances_of
from workflows.calibrate.priors import Prior, points_at
from workflows.calibrate.targets import Target

REACH = 3.0  # combined errors from a target beyond which parameters do not give it
EVERYWHERE = 2**12  # points of the prior that are looked at
EDGE = 0.05  # share of the prior at either end
AGAINST = 0.5  # density there, over the greatest one, from which a posterior lies against the border
AS_WIDE = 0.9  # deviation of a posterior over that of its prior from which nothing was learned
EVEN = 12.0**-0.5  # standard deviation of the even distribution from 0 to 1


def verdicts(
    emulators: Emulators, posterior: Posterior, targets: Sequence[Target], priors: Sequence[Prior]
) -> Iterator[str]:
    """One line for each thing that one should know of a result."""
    found = [*out_of_reach(emulators, posterior, targets)]
    if not found and len(targets) > 1:
        found = [*not_at_once(emulators, posterior, targets, priors)]
    yield from found
    if found:  # the posterior is that of the least bad parameters, and its place says nothing
        return
    for i, prior in enumerate(priors):
        yield from _of_parameter(prior, posterior, posterior.shares[:, i])


def out_of_reach(emulators: Emulators, posterior: Posterior, targets: Sequence[Target]) -> Iterator[str]:
    """The targets that no parameters give, with the nearest value: all errors count, those of the emulators as well."""
    shares = first_design(EVERYWHERE, posterior.shares.shape[1], 0)
    everywhere = emulators.predict(shares)
    own, apart = variances_of(emulators, targets)
    for i, target in enumerate(targets):
        mean = np.concatenate([everywhere.mean[:, i], posterior.predicted.mean[:, i]])
        variance = np.concatenate([everywhere.variance[:, i], posterior.predicted.variance[:, i]])
        away = np.abs(mean - target.value) / np.sqrt(variance + own[i] + apart[i])
        if away.min() > REACH:
            nearest = int(np.argmin(np.abs(mean - target.value)))
            value, error = mean[nearest], np.sqrt(variance[nearest])
            yield (
                f"no parameters within the priors give {target.metric} = {target.value:.4g}: the nearest is "
                f"{value:.4g} +- {error:.2g}, {away[nearest]:.3g} errors away; widen the priors, let other parameters "
                "vary, or allow a model_error"
            )


def not_at_once(
    emulators: Emulators, posterior: Posterior, targets: Sequence[Target], priors: Sequence[Prior]
) -> Iterator[str]:
    """That each target can be reached, but not all at once: by chi-squared, as unlikely as REACH errors of one."""
    from scipy.stats import chi2

    squares, _ = misfits_of(posterior.predicted, emulators, targets)
    best = int(np.argmin(squares))
    if squares[best] <= chi2.isf(chi2.sf(REACH**2, 1), len(targets)):
        return
    mean = posterior.predicted.mean[best]
    (point,) = points_at(priors, posterior.shares[[best]])
    where = ", ".join(f"{name} = {value:.3g}" for name, value in point.items())
    gives = ", ".join(f"{t.metric} {m:.4g} for {t.value:.4g}" for t, m in zip(targets, mean, strict=True))
    yield (
        f"no parameters within the priors give all targets at once: the best, {where}, give {gives}, "
        f"{np.sqrt(squares[best]):.3g} errors away together; let other parameters vary, or allow a model_error"
    )


def _of_parameter(prior: Prior, posterior: Posterior, shares: NDArray) -> Iterator[str]:
    """That the targets do not constrain a parameter, or that they may want it beyond its prior."""
    if posterior.mean_and_deviation(shares)[1] > AS_WIDE * EVEN:
        yield f"{prior.name} is not constrained by the targets: its posterior is as wide as its prior, {prior}"
        return
    density, _ = np.histogram(shares, bins=round(1.0 / EDGE), range=(0.0, 1.0), weights=posterior.weights)
    for end, at_end in (("low", density[0]), ("high", density[-1])):
        if at_end > AGAINST * density.max():
            value = prior.at(np.array([0.0 if end == "low" else 1.0]))[0]
            yield (
                f"{prior.name}: the posterior lies against the {end} end of its prior, {value:.4g}: the targets may "
                "want it beyond; widen the prior if it allows that"
            )
