"""What a velocity step changes in the long run: a - b from steady friction, and the dilatancy coefficient."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .input_checks import require_positive
from .steady_means import Estimate, combine_replicas
from .step_stack import step_stack


class Dilatancy(NamedTuple):
    """Change of porosity with velocity.

    Parameters
    ----------
    coefficient
        d phi / d ln V [1], positive if faster shear is looser.
    steps
        (step,) its value for each step [1].
    """

    coefficient: Estimate
    steps: npt.NDArray[np.float64]


def steady_rate_dependence(
    slip: npt.ArrayLike, friction: npt.ArrayLike, v_before: float, v_after: float, settled_from: float
) -> Estimate:
    """Rate dependence a - b of steady friction: (mu_after - mu_before)/ln(V_after/V_before), without a law of state.

    Parameters
    ----------
    slip
        (sample,) x [m] since the step, negative before it.
    friction
        (cycle, sample) [1].
    v_before, v_after
        Velocities [m s-1].
    settled_from
        Slip [m] after the step from which friction counts as steady; at least four D_c leave 2 % of the transient.

    Returns
    -------
    Estimate
        Mean over the cycles [1], its error from their scatter, with Student's t: the cycles are the independent unit.

    Raises
    ------
    InputError
        As `fit_velocity_step`, and if no sample lies beyond `settled_from`.

    References
    ----------
    Marone (1998), doi:10.1146/annurev.earth.26.1.643.
    """
    stack = step_stack(slip, friction, v_before, v_after, math.inf, trend=False)
    require_positive(settled_from=settled_from)
    x, y, weights = stack.slip[0], stack.friction[:, 0], stack.weights[0]
    before, after = x < 0.0, x >= settled_from
    if not after.any():
        raise InputError(f"settled_from: {settled_from:g} m, the slip ends at {x[-1]:g} m; must be below it")
    change = np.average(y[:, after], 1, weights[after]) - np.average(y[:, before], 1, weights[before])
    return _over_cycles(change / math.log(v_after / v_before))


def dilatancy_coefficient(
    porosity_before: npt.ArrayLike, porosity_after: npt.ArrayLike, v_before: npt.ArrayLike, v_after: npt.ArrayLike
) -> Dilatancy:
    """Dilatancy coefficient (phi_after - phi_before)/ln(V_after/V_before) of velocity steps, Samuelson et al. (2009).

    Parameters
    ----------
    porosity_before, porosity_after
        (step,) steady porosity [1] on each side of the steps; of a platen of constant area, changes of thickness over
        thickness times (1 - porosity) are the same.
    v_before, v_after
        Velocities [m s-1], one number or (step,).

    Returns
    -------
    Dilatancy
        The error is that of the scatter of the steps, with Student's t; nan, with the reason, for one step.

    Raises
    ------
    InputError
        For shapes that differ, values that are not finite, and velocities that are equal.

    References
    ----------
    Segall & Rice (1995), doi:10.1029/95JB02403; Samuelson, Elsworth & Marone (2009), doi:10.1029/2008JB006273.
    """
    before, after = np.atleast_1d(np.asarray(porosity_before, float)), np.atleast_1d(np.asarray(porosity_after, float))
    if before.shape != after.shape or before.ndim != 1:
        raise InputError(
            f"porosity_before, porosity_after: shapes {before.shape}, {after.shape}, must be equal (step,)"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        logarithm = np.log(np.asarray(v_after, float) / np.asarray(v_before, float)) * np.ones_like(before)
        steps = (after - before) / logarithm
    if not np.isfinite(steps).all():
        at = int(np.argmin(np.isfinite(steps)))
        raise InputError(f"step {at}: porosities and velocities must be finite, velocities > 0 m/s and differ")
    return Dilatancy(_over_cycles(steps), steps)


def _over_cycles(values: npt.NDArray[np.float64]) -> Estimate:
    """Mean over cycles with the error of their scatter."""
    if values.size == 1:
        return Estimate(float(values[0]), math.nan, 1.0, math.nan, "one cycle: run more")
    return combine_replicas(values)
