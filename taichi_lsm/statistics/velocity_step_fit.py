"""Fits the parameters of rate-and-state friction to a stack of velocity steps."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .rate_and_state import LAWS, Law, known_law
from .resampling import LEAST_CYCLES, Resampled, interval, resampled_weights
from .steady_means import LEVEL
from .step_stack import PIECE, Array, StepStack, step_stack

RESAMPLES = 400  # of the cycles
GRID = 12  # slip distances that are tried before the fit
LEAST_DISTANCE, MOST_DISTANCE = 0.5, 2.0  # over the spacing of samples and over the slip after a step
CORRECTIONS = 3  # of the fit to resampled cycles
DERIVATIVE = 1e-5  # step of a, b and ln D_c
TINY, LEAST_START = 1e-5, 1e-3  # of a in the fit with a spring, which has no solution at 0
MOST_LOST = 0.05  # share of resamples whose slip distance is at a bound


class StepFit(NamedTuple):
    """Rate-and-state parameters of a stack of velocity steps.

    Parameters
    ----------
    law
        "ageing" or "slip".
    a, b
        Direct and evolution effect [1].
    slip_distance
        D_c [m].
    rate_dependence
        a - b [1].
    chi_square
        Sum of the squared residuals of the mean cycle over their variance by the scatter of the cycles, weighted by
        slip and with its correlation [1]; about degrees_of_freedom if the law describes the data.
    degrees_of_freedom
        Number of independent samples of the mean cycle less that of the parameters [1].
    """

    law: Law
    a: Resampled
    b: Resampled
    slip_distance: Resampled
    rate_dependence: Resampled
    chi_square: float
    degrees_of_freedom: float


class LawComparison(NamedTuple):
    """Which law describes a stack of velocity steps better.

    Parameters
    ----------
    better
        The law of smaller chi-square.
    chi_square_difference
        That of the other law less that of the better one [1]. Both laws have the same number of parameters: it is also
        the difference of Akaike's criterion.
    share
        Share of the resampled stacks which the better law fits better [1]; 0.95 and more counts as told.
    ageing, slip
        The two fits.
    unknown
        Why the data do not tell the laws apart; "" if they do.
    """

    better: Law
    chi_square_difference: float
    share: float
    ageing: StepFit
    slip: StepFit
    unknown: str = ""


def fit_velocity_step(
    slip: npt.ArrayLike,
    friction: npt.ArrayLike,
    v_before: npt.ArrayLike,
    v_after: npt.ArrayLike,
    law: Law = "ageing",
    *,
    stiffness: float = math.inf,
    trend: bool = False,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> StepFit:
    """Fit a, b and D_c to repeated velocity steps by least squares; 95 % intervals by resampling whole cycles.

    Parameters
    ----------
    slip
        (sample,) or (step, sample) x [m] since each step, rising, negative before it: slip of the platen, or of the
        load point with a spring.
    friction
        (cycle, sample), or (cycle, step, sample) where a cycle has steps of its own, such as one up and one down.
    v_before, v_after
        Velocities [m s-1] before and after the step, one number or (step,). The first has lasted to the steady state.
    law
        "ageing" or "slip".
    stiffness
        k [m-1]: stiffness of the spring over the normal force, inf if the layer is slid at the imposed velocity.
    trend
        Fit a linear trend of the friction along slip as well, one for each step.
    resamples
        How often the cycles are drawn anew.
    seed
        Of the draws.

    Returns
    -------
    StepFit
        Errors are nan, with the reason, for fewer than 8 cycles; that of D_c also if b is not told from 0, or if D_c
        lies beyond the slips of the data.

    Raises
    ------
    InputError
        For shapes that do not go together, values that are not finite, slips that do not rise, and less than 5 samples
        on each side of the step.

    Notes
    -----
    Samples count by the slip that they stand for, so that rows which are dense after a step are not preferred.

    References
    ----------
    Marone (1998), doi:10.1146/annurev.earth.26.1.643, for the method.
    """
    stack = step_stack(slip, friction, v_before, v_after, stiffness, trend)
    shares = resampled_weights(stack.cycles, resamples, seed)
    return _fit(stack, known_law(law), shares)[0]


def compare_laws(
    slip: npt.ArrayLike,
    friction: npt.ArrayLike,
    v_before: npt.ArrayLike,
    v_after: npt.ArrayLike,
    *,
    stiffness: float = math.inf,
    trend: bool = False,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> LawComparison:
    """Fit both laws to the same resampled cycles and tell which is better; arguments as in `fit_velocity_step`."""
    stack = step_stack(slip, friction, v_before, v_after, stiffness, trend)
    shares = resampled_weights(stack.cycles, resamples, seed)
    (ageing, of_ageing), (slipping, of_slip) = (_fit(stack, law, shares) for law in LAWS)
    better = LAWS[int(slipping.chi_square < ageing.chi_square)]
    prefers_ageing = float(np.mean(of_ageing < of_slip))
    share = prefers_ageing if better == "ageing" else 1.0 - prefers_ageing
    apart = abs(ageing.chi_square - slipping.chi_square)
    told = share >= LEVEL and stack.cycles >= LEAST_CYCLES
    reason = "" if told else f"{better} fits better in {share:.0%} of the resampled stacks only: run more cycles"
    return LawComparison(better, apart, share, ageing, slipping, reason)


def _fit(stack: StepStack, law: Law, shares: Array) -> tuple[StepFit, Array]:
    """The fit to all cycles, and the misfit (resamples,) of each resampled mean cycle."""
    cycles = stack.weighted(stack.friction)
    mean = cycles.mean(axis=0)
    start = _started(stack, law, mean)
    stack = replace(stack, piece=PIECE * math.exp(start[2]))
    best, slopes = _best(stack, law, mean, start)
    drawn, misfits = _redrawn(stack, law, best, slopes, shares @ cycles)
    a, b, log_distance = best

    def of(value: float, values: Array, positive: bool = False) -> Resampled:
        if stack.cycles < LEAST_CYCLES:
            return Resampled(value, unknown=f"{stack.cycles} cycles, at least {LEAST_CYCLES} are needed: run more")
        return interval(float(value), values, stack.cycles, positive)

    distance = of(math.exp(log_distance), np.exp(drawn[:, 2]), positive=True)
    fitted_b = of(b, drawn[:, 1])
    if not distance.unknown:
        reason = _why_unknown(stack, fitted_b, log_distance, drawn[:, 2])
        distance = Resampled(distance.value, unknown=reason) if reason else distance
    variance, independent = _noise(cycles)
    freedom = independent - 3 - stack.levels.shape[1]
    misfit = float(np.sum((mean - stack.weighted(stack.model(best, law))) ** 2))
    chi_square = misfit / variance * independent / mean.size
    fit = StepFit(
        law, of(a, drawn[:, 0]), fitted_b, distance, of(a - b, drawn[:, 0] - drawn[:, 1]), chi_square, freedom
    )
    return fit, misfits


def _why_unknown(stack: StepStack, b: Resampled, log_distance: float, drawn: Array) -> str:
    """Reason why the data do not tell D_c; "" if they do."""
    if b.low <= 0.0 <= b.high:
        return "b is not told from 0, no evolution is seen: run more cycles, or larger steps"
    least, most = np.log(_bounds(stack))
    at_bound = np.mean((drawn < least + 1e-6) | (drawn > most - 1e-6))
    if at_bound > MOST_LOST or not least + 1e-3 < log_distance < most - 1e-3:
        return f"beyond {math.exp(least):.2g} to {math.exp(most):.2g} m in {at_bound:.0%} of the resampled stacks"
    return ""


def _bounds(stack: StepStack) -> tuple[float, float]:
    """Least and greatest D_c [m] that such slips can show."""
    after = np.where(stack.slip >= 0.0, stack.slip, np.nan)
    return LEAST_DISTANCE * float(np.nanmin(np.diff(after, axis=1))), MOST_DISTANCE * float(stack.slip.max())


def _noise(cycles: Array) -> tuple[float, float]:
    """Variance of a weighted sample of the mean cycle, and number of independent samples, from the cycles' scatter."""
    scatter = cycles - cycles.mean(axis=0)
    count, samples = scatter.shape
    variance = float(np.sum(scatter**2)) / (count * (count - 1) * samples)
    power = np.abs(np.fft.rfft(scatter, 2 * samples, axis=1)) ** 2
    correlation = np.fft.irfft(power.sum(axis=0))[: samples // 2]
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation <= 0.0)) or correlation.size  # to the first crossing of 0
    return variance, samples / float(2.0 * np.sum(correlation[:end]) - 1.0)


def _best(stack: StepStack, law: Law, mean: Array, start: Array) -> tuple[Array, Array]:
    """a, b, ln D_c (3,) that fit the weighted mean cycle (step * sample,), and the slopes (step * sample, 3) there."""
    from scipy.optimize import least_squares

    least, most = np.log(_bounds(stack))
    lowest = np.array([TINY if math.isfinite(stack.stiffness) else -np.inf, -np.inf, least])
    highest = np.array([np.inf, np.inf, most])

    def residuals(parameters: Array) -> Array:
        return stack.weighted(stack.model(parameters, law)) - mean

    def slopes(parameters: Array) -> Array:
        near = stack.weighted(stack.model(parameters + DERIVATIVE * np.eye(3), law))
        far = stack.weighted(stack.model(parameters - DERIVATIVE * np.eye(3), law))
        return (near - far).T / (2.0 * DERIVATIVE)

    start = np.clip(start, lowest + DERIVATIVE, highest - DERIVATIVE)
    start[0] = max(start[0], LEAST_START) if math.isfinite(stack.stiffness) else start[0]
    scale = {"bounds": (lowest, highest), "x_scale": (0.01, 0.01, 1.0), "xtol": 1e-6}
    found = least_squares(residuals, start, slopes, **scale)  # pyright: ignore[reportArgumentType]
    return found.x, slopes(found.x)


def _redrawn(stack: StepStack, law: Law, best: Array, slopes: Array, targets: Array) -> tuple[Array, Array]:
    """Parameters (n, 3) that fit resampled mean cycles (n, step * sample), and the misfits (n,).

    By Gauss's and Newton's steps with the slopes at the parameters of all cycles, which are near; a step that makes the
    misfit larger is not made.
    """
    least, most = np.log(_bounds(stack))
    lowest = np.array([TINY if math.isfinite(stack.stiffness) else -np.inf, -np.inf, least])
    highest = np.array([np.inf, np.inf, most])
    inverse = np.linalg.pinv(slopes)
    found = np.tile(best, (len(targets), 1))
    left = targets - stack.weighted(stack.model(best, law))
    misfit = np.sum(left**2, axis=1)
    for _ in range(CORRECTIONS):
        tried = np.asarray(np.clip(found + left @ inverse.T, lowest, highest), np.float64)
        there = targets - stack.weighted(stack.model(tried, law))
        now = np.sum(there**2, axis=1)
        better = (now < misfit)[:, None]
        found, left, misfit = np.where(better, tried, found), np.where(better, there, left), np.minimum(now, misfit)
    return found, misfit


def _started(stack: StepStack, law: Law, mean: Array) -> Array:
    """a, b, ln D_c (3,) of the best slip distance of a grid, whose a and b are linear: the model of steps at once."""
    found, chosen = -1.0, np.zeros(3, np.float64)
    least, most = np.log(_bounds(stack))
    for distance in np.linspace(least, most, GRID + 2)[1:-1]:
        shapes = stack.weighted(stack.imposed(np.array([[1.0, 0.0, distance], [0.0, 1.0, distance]]), law))
        basis, upper = np.linalg.qr(shapes.T)
        fitted = mean @ basis
        if fitted @ fitted > found:
            found, chosen = fitted @ fitted, np.array([*np.linalg.solve(upper, fitted), distance], np.float64)
    return chosen
