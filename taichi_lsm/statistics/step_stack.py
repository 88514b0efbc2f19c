"""A stack of repeated velocity steps, and the models of friction that are fitted to it."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .input_checks import numbers, require_positive, rising
from .rate_and_state import Law, friction_after_step

Array = npt.NDArray[np.float64]
LEAST_SAMPLES = 5  # before and after a step
PIECE = 0.05  # of slip in which the spring is solved, over the slip distance


@dataclass(frozen=True)
class StepStack:
    """Cycles of one or more velocity steps, on the same slips.

    Parameters
    ----------
    slip
        (step, sample) x [m] since each step, negative before it.
    friction
        (cycle, step, sample) friction [1].
    v_before, v_after
        (step,) velocities [m s-1].
    stiffness
        k [m-1] of the spring between load point and layer, inf without.
    weights
        (step, sample) weight of each sample: the slip that it stands for.
    levels
        (step * sample, m) orthonormal shapes, weighted, that are no effect of the step: the level of each step and, if
        asked for, its trend along slip.
    piece
        Longest slip [m] in which the spring is solved at once: the same for all parameters, or the model would jump.
    """

    slip: Array
    friction: Array
    v_before: Array
    v_after: Array
    stiffness: float
    weights: Array
    levels: Array
    piece: float = math.inf

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return len(self.friction)

    def weighted(self, friction: Array) -> Array:
        """Frictions (..., step, sample) times sqrt(weight), less levels and trends: (..., step * sample)."""
        flat = (friction * np.sqrt(self.weights)).reshape(*friction.shape[:-2], -1)
        return flat - (flat @ self.levels) @ self.levels.T

    def imposed(self, parameters: Array, law: Law) -> Array:
        """Friction (..., step, sample) of parameters (..., 3) = a, b, ln(D_c/m) where the steps are at once: (6)."""
        a, b, log_distance = np.moveaxis(parameters, -1, 0)[..., None]
        steps = [
            friction_after_step(x, v, w, a, b, np.exp(log_distance), law)
            for x, v, w in zip(self.slip, self.v_before, self.v_after, strict=True)
        ]
        return np.stack(steps, axis=-2)

    def model(self, parameters: Array, law: Law) -> Array:
        """As `imposed`, behind the spring if there is one."""
        if math.isinf(self.stiffness):
            return self.imposed(parameters, law)
        steps = [
            behind_spring(x, float(w / v), parameters, self.stiffness, law, self.piece)
            for x, v, w in zip(self.slip, self.v_before, self.v_after, strict=True)
        ]
        return np.stack(steps, axis=-2)


def step_stack(
    slip: npt.ArrayLike,
    friction: npt.ArrayLike,
    v_before: npt.ArrayLike,
    v_after: npt.ArrayLike,
    stiffness: float,
    trend: bool,
) -> StepStack:
    """A checked stack; arguments as in `fit_velocity_step`."""
    y = np.asarray(friction, dtype=float)
    y = numbers("friction", y[:, None] if y.ndim == 2 else y, 3)
    _, steps, samples = y.shape
    x = numbers("slip", np.broadcast_to(np.asarray(slip, dtype=float), (steps, samples)), 2)
    before, after = (
        numbers(name, np.broadcast_to(np.asarray(v, float), steps), 1)
        for name, v in (("v_before", v_before), ("v_after", v_after))
    )
    if not (np.all(before > 0) and np.all(after > 0) and np.all(before != after)):
        raise InputError(f"v_before, v_after: {before}, {after}, must be > 0 m/s and differ in every step")
    if math.isnan(stiffness) or not math.isinf(stiffness):
        require_positive(stiffness=stiffness)
    for row in x:
        rising("slip", row)
        if min(np.sum(row < 0), np.sum(row >= 0)) < LEAST_SAMPLES:
            raise InputError(f"slip: {row[0]:g} to {row[-1]:g} m, must hold {LEAST_SAMPLES} samples on each side of 0")
    weights = np.stack([np.gradient(row) for row in x])
    root = np.sqrt(weights)
    shapes = [
        np.where(np.arange(steps)[:, None] == s, root * x**p, 0.0) for s in range(steps) for p in range(1 + trend)
    ]
    levels, _ = np.linalg.qr(np.stack(shapes, axis=-1).reshape(-1, len(shapes)))
    return StepStack(x, y, before, after, stiffness, weights, levels)


def behind_spring(slip: Array, ratio: float, parameters: Array, stiffness: float, law: Law, piece: float) -> Array:
    """Friction (..., sample) less that before the step, as `spring_slider` has it, for many parameters at once.

    The midpoint rule for the state; the velocity from the exact solution of its logistic equation at a constant rate of
    the state, however stiff the spring is: with s = V_load/V, s' = -(k/a - (b/a) psi') s + k/a.

    Parameters
    ----------
    slip
        (sample,) x [m] of the load point.
    ratio
        Its velocity after over before the step.
    parameters
        (..., 3) a > 0, b, ln(D_c/m).
    stiffness
        k [m-1].
    law
        "ageing" or "slip".
    piece
        Longest slip [m] in which it is solved at once; about PIECE D_c.
    """
    a, b = parameters[..., 0], parameters[..., 1]
    distance = np.exp(parameters[..., 2])

    def rate(psi: Array, slowness: Array) -> Array:
        """Slope of psi = ln(V_before theta/D_c) along the slip of the load point, by (2) or (3)."""
        velocity = ratio / slowness
        change = np.exp(-psi) - velocity if law == "ageing" else -velocity * (np.log(velocity) + psi)
        return change / (ratio * distance)

    def relaxed(slowness: Array, rate_of_state: Array, h: float) -> Array:
        """V_load/V after a slip h of the load point."""
        decay = (stiffness - b * rate_of_state) * (h / a)
        decay = np.where(np.abs(decay) < 1e-9, 1e-9, decay)
        return slowness * np.exp(-decay) - stiffness * (h / a) * np.expm1(-decay) / decay

    state, slowness = np.zeros_like(a), np.full_like(a, ratio)
    out, at = [], 0.0
    for x in slip:
        pieces = max(1, math.ceil((x - at) / piece - 1e-9)) if x > 0.0 else 0
        for _ in range(pieces):
            h = (x - at) / pieces
            first = rate(state, slowness)
            middle = rate(state + 0.5 * h * first, relaxed(slowness, first, 0.5 * h))
            slowness, state = relaxed(slowness, middle, h), state + h * middle
        at = max(at, x)
        out.append(a * np.log(ratio / slowness) + b * state)
    return np.stack(out, axis=-1)
